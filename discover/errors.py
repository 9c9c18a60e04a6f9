"""The one error that a user's input can cause."""

import errno
from collections.abc import Iterator
from contextlib import contextmanager


class InputError(ValueError):
    """Something the user gave is wrong.

    The message says what was got, what was wanted and how to fix it. The command line
    prints it on standard error without a traceback and exits with status 2.

    Examples
    --------
    >>> import discover as dc
    >>> try:
    ...     dc.make_law("giesekus", {"alpha": -1.0})
    ... except dc.InputError:
    ...     print("a mobility is not negative")
    a mobility is not negative
    """


class Problems:
    """Input errors that are collected and raised together, so that all are mended at once."""

    def __init__(self) -> None:
        self._found: list[str] = []

    def __bool__(self) -> bool:
        return bool(self._found)

    @contextmanager
    def collected(self) -> Iterator[None]:
        """Keep an input error for later and go on behind the block."""
        try:
            yield
        except InputError as error:
            self._found += problems_in(str(error))

    def add(self, text: str) -> None:
        """Keep one problem, a whole sentence."""
        self._found.append(text)

    def require_none(self, where: str = "") -> None:
        """Raise InputError with what was collected: one problem, or a list of several."""
        if self._found:
            raise InputError(self.listed(where))

    def listed(self, where: str = "") -> str:
        """Return each problem once: its text alone, or a list under a place."""
        found = list(dict.fromkeys(self._found))
        if len(found) == 1:
            return found[0]
        return _MARK.join([f"{f'{where}: ' if where else ''}{len(found)} problems.", *found])


_MARK = "\n- "
"""Between the problems of one message."""


def problems_in(message: str) -> list[str]:
    """Return the problems that the message of an `InputError` lists; itself where it is one."""
    first, *others = message.split(_MARK)
    return others or [first]


_FULL = "; make room and run again, what was finished is kept"
_REMEDIES = dict.fromkeys((errno.ENOSPC, errno.EFBIG, errno.EDQUOT), _FULL)
_REMEDIES[errno.ENAMETOOLONG] = "; give a shorter name"


def plain_os_error(error: OSError) -> str:
    """Return in words what the operating system refused, where, and how to mend it."""
    place = f" ({error.filename})" if error.filename else ""
    return f"{error.strerror or error}{place}{_REMEDIES.get(error.errno or 0, '')}"
