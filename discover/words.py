"""Lists and shares as sentences have them, for all rooms."""

import difflib
from collections.abc import Iterable, Sequence


def listed(parts: Sequence[str]) -> str:
    """Return what is listed in a sentence: 'one', 'one and another', 'one, another and a third'."""
    return " and ".join([", ".join(parts[:-1]), parts[-1]] if len(parts) > 1 else parts)


def counted(count: int, thing: str) -> str:
    """Return how many there are: '1 run', '2 runs'."""
    return f"{count} {thing}{'' if count == 1 else 's'}"


def plainly(value: float) -> str:
    """Return a number with three digits, without a power of ten below a million."""
    return f"{float(f'{value:.3g}'):g}"


def percent_of(share: float) -> str:
    """Return a share as a percentage, with two digits below a hundred and whole from there."""
    return f"{100.0 * share:.2g} %" if abs(share) < 0.995 else f"{100.0 * share:.0f} %"


def did_you_mean(given: object, known: Iterable[str]) -> str:
    """Return a question that names what is spelled most like a text; empty where nothing is."""
    near = difflib.get_close_matches(str(given), list(known), 1)
    return f" Did you mean {near[0]!r}?" if near else ""
