"""The one error that a user's input can cause."""


class InputError(ValueError):
    """Something the user gave is wrong.

    The message says what was got, what was wanted and how to mend it. The command line
    prints it on standard error without a traceback and exits with status 2.
    """
