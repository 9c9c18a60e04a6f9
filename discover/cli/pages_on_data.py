"""Pages on data folders, and the first study beside each of them."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from discover.errors import InputError

if TYPE_CHECKING:  # --help needs no data
    from discover.dataset import Dataset
    from discover.dataset.checking.finding import Finding

STUDY_FILE = "study.toml"
PAGE = "report.html"
IMPORT_PAGE = "data.html"
"""What an import calls its page: a data folder may be a folder of results too."""

_MARK = '<meta name="generator" content="discover data">'
_LOOKED_AT = 1000  # characters of a page, in which the mark stands


def write_page(dataset: "Dataset", name: str, out: Path) -> tuple[Path, list[str]]:
    """Write a page on a data folder and a first study beside it.

    `name`: the folder, or its name under DISCOVER_DATA. `out`: folder for both files; made if it is
    not there.

    Returns the page's path, and what was left as it is since it was there before, in words.
    """
    from discover.dataset.checking.folder import check_folder
    from discover.study.atomic import make_folder

    here = Path(name)
    # where the study lies a relative path would be another one
    folder = here.resolve().as_posix() if here.is_dir() else name
    make_folder(out)
    path = _place_for_page(out, PAGE, IMPORT_PAGE)
    kept = [] if path.name == PAGE else [f"{out / PAGE} is no page on data and is kept."]
    _write_page(dataset, folder, path, check_folder(name))
    if not _write_study(dataset, folder, out):
        kept.append(
            f"{out / STUDY_FILE} was there before and is kept. For a new one remove it, or choose "
            "another --out."
        )
    return path, kept


def write_import_page(
    folder: Path, findings: Sequence["Finding"], said: Sequence[str]
) -> Path | None:
    """Write the page on an imported folder into it; return its path, None if it cannot be read.

    A first study is written beside it unless there is one: that may have been changed by hand.
    """
    from discover.dataset.load import load_dataset

    place = folder.resolve().as_posix()
    try:
        dataset = load_dataset(place)
    except InputError:
        return None  # the check says why
    _write_study(dataset, place, folder)
    return _write_page(dataset, place, _place_for_page(folder, IMPORT_PAGE, PAGE), findings, said)


def _place_for_page(folder: Path, *names: str) -> Path:
    """Return the first place where there is no page, or one on data, which a new one replaces."""
    for path in (folder / name for name in names):
        if not os.path.lexists(path):
            return path
        if path.is_file() and not path.is_symlink():
            with path.open(encoding="utf-8", errors="replace") as page:
                if _MARK in page.read(_LOOKED_AT):
                    return path
    raise InputError(
        f"{folder} holds a {names[0]} and a {names[1]} that are no pages on data, and they are "
        "not written over. Choose another --out."
    )


def _write_study(dataset: "Dataset", folder: str, out: Path) -> bool:
    """Write a first study; return whether what is there now is that."""
    from discover.report.data.page import first_study
    from discover.study.atomic import write_text

    study, path = first_study(dataset, folder), out / STUDY_FILE
    if os.path.lexists(path):
        return path.is_file() and path.read_bytes() == study.encode("utf-8", "backslashreplace")
    write_text(path, study)
    return True


def _write_page(
    dataset: "Dataset",
    folder: str,
    path: Path,
    findings: Sequence["Finding"],
    said: Sequence[str] = (),
) -> Path:
    from discover.report.data.page import data_page
    from discover.study.atomic import write_text

    return write_text(path, data_page(dataset, findings, folder, said))
