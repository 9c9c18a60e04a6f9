"""Lists and shares as sentences have them, for all rooms."""

import difflib
from collections.abc import Iterable, Sequence
from pathlib import PurePath

_LONGEST = 80
"""Characters of a name that a message repeats."""

_LIKENESS = 0.65
"""Least share of letters in common of a guess: 'alfa' is alpha (0.67), 'sweep' no creep (0.60)."""


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


def nearest(given: object, known: Iterable[str]) -> str | None:
    """Return what is spelled most like a text; None where nothing is.

    Capitals do not count, nor do an ending of files in common and the order of words, and a hyphen
    or a blank is an underscore.
    """
    # of a longer text no name is meant, and difflib would take minutes
    wanted = _plain(str(given)[:_LONGEST])
    ending = PurePath(wanted).suffix
    plain: dict[str, str] = {}
    for name in known:
        plain.setdefault(_in_order(_plain(name).removesuffix(ending)), name)
    asked = _in_order(wanted.removesuffix(ending))
    near = difflib.get_close_matches(asked, list(plain), 1, _LIKENESS)
    return plain[near[0]] if near else None


def _in_order(name: str) -> str:
    return "_".join(sorted(name.split("_")))


def _plain(name: str) -> str:
    return name.casefold().replace("-", "_").replace(" ", "_")


def did_you_mean(given: object, known: Iterable[str]) -> str:
    """Return a question that names what is spelled most like a text; empty where nothing is."""
    near = nearest(given, known)
    return "" if near is None else f" Did you mean {near!r}?"


def unknown_name(what: str, given: object, known: Iterable[str], owner: str = "") -> str:
    """Return what is said of a name that nobody knows: what was got, meant, and may be written.

    Parameters
    ----------
    what
        What it was to name, in the singular.
    given
        The name.
    known
        Names that would do.
    owner
        What has no such thing, as the subject of a sentence: 'The law giesekus'.
    """
    names = list(known)
    text = str(given)
    shown = repr(text if len(text) <= _LONGEST else f"{text[:_LONGEST]}…")
    said = f"{owner} has no {what} {shown}." if owner else f"Unknown {what} {shown}."
    remedy = f"Write {'one of: ' if len(names) > 1 else ''}{', '.join(names)}."
    return f"{said}{did_you_mean(given, names)} {remedy if names else 'It has none; leave it out.'}"
