"""Pages on data folders, and the first study beside each of them."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from discover.errors import InputError

if TYPE_CHECKING:  # --help needs no data
    from discover.dataset import Dataset
    from discover.dataset.checking.finding import Finding

STUDY_FILE = "study.toml"
IMPORT_PAGE = "data.html"
"""What an import calls its page: a data folder may be a folder of results too."""


def write_page(dataset: "Dataset", name: str, out: Path) -> Path:
    """Write a page on a data folder and a first study beside it; return the page's path.

    Parameters
    ----------
    name
        The folder, or its name under DISCOVER_DATA.
    out
        Folder for both files; made if it is not there.
    """
    from discover.dataset.checking.folder import check_folder
    from discover.study.atomic import make_folder

    here = Path(name)
    # where the study lies a relative path would be another one
    folder = here.resolve().as_posix() if here.is_dir() else name
    make_folder(out)
    _write_study(dataset, folder, out)
    return _write_page(dataset, folder, out / "report.html", check_folder(name))


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
    if not (folder / STUDY_FILE).exists():
        _write_study(dataset, place, folder)
    return _write_page(dataset, place, folder / IMPORT_PAGE, findings, said)


def _write_study(dataset: "Dataset", folder: str, out: Path) -> None:
    from discover.report.data.page import first_study
    from discover.study.atomic import write_text

    write_text(out / STUDY_FILE, first_study(dataset, folder))


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
