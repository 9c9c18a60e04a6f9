"""A word on studies that read data from elsewhere."""

from collections.abc import Sequence
from pathlib import Path

from discover.cli.console import say


def tell_of_folders(paths: Sequence[Path]) -> None:
    """Print a note for every study whose data lie outside the folders where one would look.

    A study file may come from somebody else; what it reads should surprise nobody.

    Parameters
    ----------
    paths
        Study files; those that are wrong are passed over, for the command itself to refuse.
    """
    from discover.errors import InputError
    from discover.study.read import folder_elsewhere, read_study

    for path in paths:
        try:
            folder = folder_elsewhere(read_study(path))
        except InputError:
            continue
        if folder is not None:
            say(
                f"discover: note: {path.name} reads its data from {folder}, which is neither "
                "beside it nor under DISCOVER_DATA or the working directory.",
                err=True,
            )
