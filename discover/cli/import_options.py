"""What ``discover data import`` does around the import itself: options, sources, writing."""

import hashlib
import os
import re
from collections.abc import Mapping as AnyMapping
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from discover.cli.console import number, pairs
from discover.dataset.importing.convert import ImportedFolder
from discover.dataset.importing.mapping import (
    EVERY_BLOCK,
    MAPPING_FILE,
    Mapping,
    make_mapping,
    read_mapping,
    write_mapping,
)
from discover.dataset.importing.quantities import to_celsius
from discover.dataset.load import DATA_FILES, TESTS_FILE
from discover.dataset.read_run import INDEX_FILE
from discover.dataset.tables.table import read_bytes
from discover.errors import InputError
from discover.study.atomic import make_folder, require_free, write_text


def merge_mapping(
    path: Path | None, given: AnyMapping[str, Sequence[str] | None],
    layout: AnyMapping[str, object], geometry: str | None = None,
    blocks: Sequence[int] | None = None, start_time_s: float | None = None,
) -> Mapping:  # fmt: skip
    """Return the mapping of a file with the options of the command line on top.

    `given`: as ``stress=Shear stress``, ``creep``, ``melt.txt:2=creep``, ``40``, ``melt.txt=313K``.
    `geometry`: as ``cone_plate:radius_mm=25,angle_deg=1``. Raises InputError if one is wrong.
    """
    content = {} if path is None else read_mapping(path).model_dump(exclude_none=True)
    for key, example in (("columns", "stress='Shear stress'"), ("units", "stress=kPa")):
        content[key] = {**content.get(key, {}), **pairs(given[key] or (), example)}
    if geometry is not None:
        kind, _, rest = geometry.partition(":")
        numbers = {
            key: number(value, f"--geometry {key}")
            for key, value in pairs(filter(None, rest.split(",")), "radius_mm=25").items()
        }
        content["geometry"] = {"type": kind.strip().replace("-", "_"), **numbers}
    if blocks:
        content["blocks"] = list(blocks)
    if start_time_s is not None:
        content["start_time_s"] = start_time_s
    of_files = dict(content.get("temperatures", {}))
    for option in given["temperatures"] or ():
        file, equals, value = option.rpartition("=")
        degrees = _degrees(value if equals else option)
        if equals:
            of_files[Path(file.strip()).name] = degrees
        else:
            content["temperature_C"] = degrees
    content["temperatures"] = of_files
    spelled = [one if "=" in one else f"{EVERY_BLOCK}={one}" for one in given["tests"] or ()]
    said = pairs(spelled, "melt.txt:2=creep")
    # what is said of every block now goes before what was found of each
    content["tests"] = said if EVERY_BLOCK in said else {**content.get("tests", {}), **said}
    known = {key: value for key, value in layout.items() if value is not None}
    content["layout"] = {**content.get("layout", {}), **known}
    return make_mapping(content, "the options" if path is None else f"{path.name} and the options")


def _degrees(text: str) -> float:
    found = re.fullmatch(r"\s*(\S+?)\s*°?\s*([CKF]?)\s*", text)
    if found is None:
        raise InputError(
            f"--temperature must be a number; got {text!r}. Write 40, melt.txt=40 or 313K."
        )
    degrees = to_celsius(number(found[1], "--temperature"), found[2] or "C")
    assert degrees is not None
    return round(degrees, 6)  # 313.15 - 273.15 is no 40


def sources_of(
    mapping: Mapping, path: Path | None, files: Sequence[Path]
) -> tuple[list[Path], list[str]]:
    """Files to import, those of folders too, or of the mapping file, and which changed."""
    if files or path is None:
        each = (sorted(one.glob("[!.]*.*")) if one.is_dir() else [one] for one in files)
        return [one for own in each for one in own], []
    found: list[Path] = []
    changed = []
    remedy = f"Correct [[source]] in {path.name}, or put the file there."
    for source in mapping.source:
        found.append(path.parent / source.file)
        digest = hashlib.sha256(read_bytes(found[-1], source.file, remedy)).hexdigest()
        if source.sha256 is not None and digest != source.sha256:
            changed.append(f"{source.file} has changed since it was imported before.")
    return found, changed


def write_folder(
    imported: ImportedFolder, out: Path, overwrite: bool, mapping_file: Path | None = None
) -> None:
    """Write a data folder, ``runs.csv`` last; InputError if it holds data, or a file read."""
    for name in (*imported.files, *([] if mapping_file else [MAPPING_FILE])):
        read = [source.file for source in imported.mapping.source if _same(out / name, source.file)]
        if read:
            raise InputError(
                f"{out / name} is a file that this import reads, and a table of that name would "
                "replace it. Give the data folder a place of its own, as in --out "
                f"{out / 'imported'}."
            )
    make_folder(out)
    if not overwrite:
        require_free(out, (*DATA_FILES, TESTS_FILE))
    sources = tuple(
        source.model_copy(update={"file": Path(os.path.relpath(source.file, out)).as_posix()})
        for source in imported.mapping.source
    )
    mapping = imported.mapping.model_copy(update={"source": sources})
    if mapping_file is None or not _same(out / MAPPING_FILE, mapping_file):
        write_text(out / MAPPING_FILE, write_mapping(mapping))
    for name in sorted(imported.files, key=lambda name: name == INDEX_FILE):
        write_text(out / name, imported.files[name])


def _same(first: Path, second: str | Path) -> bool:
    try:
        return os.path.samefile(first, second)
    except OSError:  # one of them is not there
        return False


if TYPE_CHECKING:  # --help needs no data
    from discover.dataset import Dataset
    from discover.dataset.checking.runs import Finding

STUDY_FILE, PAGE = "study.toml", "data.html"
_MARK = '<meta name="generator" content="discover data">'
_LOOKED_AT = 1000  # characters of a page, in which the mark stands


def write_page(
    dataset: "Dataset", folder: str, out: Path, findings: Sequence["Finding"],
    said: Sequence[str] = (),
) -> tuple[Path, list[str]]:  # fmt: skip
    """Write a page on a data `folder`, and a first study if there is none; also what is kept."""
    from discover.report.data import data_page, first_study

    make_folder(out)
    path, place = out / PAGE, out / STUDY_FILE
    if path.is_file() and _MARK not in path.read_text("utf-8", "replace")[:_LOOKED_AT]:
        raise InputError(
            f"{path} is no page on data, and is not written over. Choose another --out."
        )
    write_text(path, data_page(dataset, findings, folder, said))
    study = first_study(dataset, folder)
    if not os.path.lexists(place):
        write_text(place, study)
    elif not place.is_file() or place.read_bytes() != study.encode("utf-8", "backslashreplace"):
        return path, [f"{place} was there before and is kept. For a new one remove it, or choose "
                      "another --out."]  # fmt: skip
    return path, []


def write_import_page(
    folder: Path, findings: Sequence["Finding"], said: Sequence[str]
) -> Path | None:
    """Write the page on an imported folder into it; None if the folder cannot be read."""
    from discover.dataset.load import load_dataset

    place = folder.resolve().as_posix()
    try:
        dataset = load_dataset(place)
    except InputError:
        return None  # the check says why
    return write_page(dataset, place, folder, findings, said)[0]
