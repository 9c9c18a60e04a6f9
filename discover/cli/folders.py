"""A word on studies that read data from elsewhere."""

from typing import TYPE_CHECKING

from discover.cli.console import say

if TYPE_CHECKING:  # --help needs no studies
    from discover.study.schema import Study


def tell_of_folder(study: "Study") -> None:
    """Print a note if a study's data lie outside the folders where one would look.

    A study file may come from somebody else; what it reads should surprise nobody.

    Parameters
    ----------
    study
        As read; if its folder does not exist, nothing is said: the command refuses it.
    """
    from discover.errors import InputError
    from discover.study.read import folder_elsewhere

    try:
        folder = folder_elsewhere(study)
    except InputError:
        return
    if folder is not None:
        name = "the study" if study.path is None else study.path.name
        say(
            f"discover: note: {name} reads its data from {folder}, which is neither "
            "beside it nor under DISCOVER_DATA or the working directory.",
            err=True,
        )
