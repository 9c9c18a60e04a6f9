"""How Python processes are started: nothing that lies in the working directory runs in them."""

import sys


def python_command(*arguments: str) -> list[str]:
    """Return a command line of this very Python, with the working directory off its path.

    ``python -m`` and ``python -c`` search the working directory first, so that a ``pip.py`` or
    ``jax.py`` lying among somebody's data would be run. ``-P`` holds for the child's own children
    too, where Python's library starts them.
    """
    return [sys.executable, "-P", *arguments]
