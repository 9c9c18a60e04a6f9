"""How Python processes are started: nothing that lies in the working directory runs in them."""

import sys


def python_command(*arguments: str) -> list[str]:
    """Return a command line of this very Python, with the working directory off its path.

    Without ``-P`` a ``jax.py`` among somebody's data would be run, in the child's own children too.
    """
    return [sys.executable, "-P", *arguments]
