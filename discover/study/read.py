"""Read a study file, with one clear error for whatever is wrong in it."""

import hashlib
from pathlib import Path
from typing import Any

from discover._version import __version__
from discover.dataset.load import folder_roots, resolve_folder
from discover.dataset.tables.table import read_bytes, read_toml
from discover.study.from_result import result_file
from discover.study.schema import Study
from discover.validation import validated


def read_study(path: str | Path) -> Study:
    """Return the study in a TOML file.

    Raises InputError if the file cannot be read, is not TOML, or holds an unknown key or a wrong
    value.
    """
    path = Path(path)
    content, text = read_toml(path, "study file", "Write it like those in studies/.")
    study = parse_study(content, str(path))
    study._path, study._text = path, text
    return study


def parse_study(content: dict, where: str = "the study") -> Study:
    """Return a study from nested dictionaries, as TOML gives them.

    Raises InputError if a key is unknown or a value is wrong; names the key.
    """
    return validated(Study, content, where)


def folder_elsewhere(study: Study) -> Path | None:
    """Return the data folder of a study if it lies outside all folders where one would look.

    These are the folder of the study file, the one that DISCOVER_DATA names, and the working
    directory. A link that leads out of them counts as outside.

    Raises InputError if there is no such folder.
    """
    if study.data.folder is None:
        return None
    base = None if study.path is None else study.path.parent
    folder = resolve_folder(study.data.folder, base).resolve()
    roots = (root.resolve() for root in folder_roots(base))
    return None if any(folder.is_relative_to(root) for root in roots) else folder


def fingerprint(study: Study, *extra: object) -> str:
    """Return a hash of everything that decides a study's results.

    Used to tell whether a result folder belongs to this study: the study, the measured files it
    names, the version of this software, and what the caller adds (task, seed).

    Raises InputError if the data folder or a file in it cannot be read.
    """
    # a page without overlays is what it was before there were any
    left_out: dict[str, Any] = {} if study.report.overlay else {"report": True}
    if study.verdict == type(study.verdict)():  # and without a tolerance of its own
        left_out["verdict"] = True
    for part in ("loop", "compare"):  # and so is a task without loadings of its own
        if getattr(study, part).loading is None:
            left_out[part] = {"loading"}
    digest = hashlib.sha256(study.model_dump_json(exclude=left_out).encode())
    for item in (__version__, *extra):
        digest.update(f"|{item!r}".encode())
    if study.data.folder is not None:
        base = None if study.path is None else study.path.parent
        for path in sorted(resolve_folder(study.data.folder, base).glob("*.csv")):
            digest.update(path.name.encode("utf-8", "surrogateescape"))
            digest.update(read_bytes(path, path.name))
    if study.model.from_ is not None:
        earlier = result_file(study.model.from_, study.path)
        digest.update(read_bytes(earlier, earlier.name))
    for asked in study.report.overlay:
        if asked.file is not None:
            base = Path() if study.path is None else study.path.parent
            digest.update(read_bytes(base / asked.file, asked.file))
    return digest.hexdigest()[:16]
