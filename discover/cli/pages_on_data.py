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
    dataset
        The data.
    name
        The folder, or its name under DISCOVER_DATA.
    out
        Folder for both files; made if it is not there.
    """
    from discover.dataset.checking.folder import check_folder
    from discover.report.data.page import data_page, first_study
    from discover.study.atomic import make_folder, write_text

    here = Path(name)
    # where the study lies a relative path would be another one
    folder = here.resolve().as_posix() if here.is_dir() else name
    make_folder(out)
    write_text(out / STUDY_FILE, first_study(dataset, folder))
    return write_text(out / "report.html", data_page(dataset, check_folder(name), folder))


def write_import_page(
    folder: Path, findings: Sequence["Finding"], said: Sequence[str]
) -> Path | None:
    """Write the page on an imported folder into it; return its path, None if it cannot be read.

    A first study is written beside it unless there is one: that may have been changed by hand.

    Parameters
    ----------
    folder
        Just imported.
    findings
        Of its check.
    said
        What the import said of the files.
    """
    from discover.dataset.load import load_dataset
    from discover.report.data.page import data_page, first_study
    from discover.study.atomic import write_text

    place = folder.resolve().as_posix()
    try:
        dataset = load_dataset(place)
    except InputError:
        return None  # the check says why
    if not (folder / STUDY_FILE).exists():
        write_text(folder / STUDY_FILE, first_study(dataset, place))
    return write_text(folder / IMPORT_PAGE, data_page(dataset, findings, place, said))
