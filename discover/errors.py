"""The one error that a user's input can cause."""

import errno


class InputError(ValueError):
    """Something the user gave is wrong.

    The message says what was got, what was wanted and how to mend it. The command line
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


_FULL = (errno.ENOSPC, errno.EFBIG, errno.EDQUOT)


def plain_os_error(error: OSError) -> str:
    """Return in words what the operating system refused, where, and how to mend a full disk."""
    place = f" ({error.filename})" if error.filename else ""
    full = "; make room and run again, what was finished is kept"
    return f"{error.strerror or error}{place}{full if error.errno in _FULL else ''}"
