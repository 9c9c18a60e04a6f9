"""Pictures: figures in, SVG text out. The only place that knows matplotlib."""

import os
from pathlib import Path


def keep_out_of_the_working_directory() -> None:
    """Have matplotlib pass over a ``matplotlibrc`` that lies in the working directory.

    It reads one as it is imported, and one that is broken, or a pipe, would end or hold up a
    command. Called where a command begins, when nothing else runs yet; costs no time elsewhere.
    """
    if not os.path.lexists("matplotlibrc"):
        return
    here = os.getcwd()
    os.chdir(Path(__file__).parent)
    try:
        import matplotlib  # noqa: F401
    finally:
        os.chdir(here)
