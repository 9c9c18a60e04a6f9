"""Words and numbers as sentences have them."""

import difflib
import math
import re
from collections.abc import Iterable, Sequence
from pathlib import PurePath

_LONGEST = 80
"""Characters of a name that a message repeats."""

_LIKENESS = 0.65
"""Least share of letters in common of a guess: 'alfa' is alpha (0.67), 'sweep' no creep (0.60)."""


LEVEL = "95 % CI"
"""What stands before or above an interval of 95 %."""


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
    """Return a share as a percentage of two digits, of three from a hundred on."""
    digits = 3 if 0.995 <= abs(share) < 9.995 else 2
    return f"{float(f'{100.0 * share:.{digits}g}'):.6g} %"


def nearest(given: object, known: Iterable[str]) -> str | None:
    """Return what is spelled most like a text; None where nothing is.

    Capitals, a common ending of files, hyphens for underscores and the order of words do not count.
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
    """Return what is said of an unknown name: what was got, meant, and may be written.

    `what`: what it was to name, in the singular. `owner`: what has no such thing, as a subject.
    """
    names = list(known)
    text = str(given)
    shown = repr(text if len(text) <= _LONGEST else f"{text[:_LONGEST]}…")
    said = f"{owner} has no {what} {shown}." if owner else f"Unknown {what} {shown}."
    remedy = f"Write {'one of: ' if len(names) > 1 else ''}{', '.join(names)}."
    return f"{said}{did_you_mean(given, names)} {remedy if names else 'It has none; leave it out.'}"


def significant(value: float | None, digits: int = 4) -> str:
    """Return a number with so many digits; a dash where there is none."""
    if value is None or math.isnan(value):
        return "–"
    if abs(value) < 1e-12 or not math.isfinite(value):
        return "0" if abs(value) < 1e-12 else f"{value}".replace("-", "−")
    power = _power(value)
    return _digits(float(f"{value:.{digits}g}") / 10.0**power) + _times_ten(power)


FIGURE_SYMBOLS = {
    "sigma12": "σ₁₂",
    "N1": "N₁",
    "N2": "N₂",
    "tensile_stress": "σ₁₁ − σ₂₂",
    "strain": "γ",
    "storage_modulus": "G′",
    "loss_modulus": "G″",
}
"""Symbols of what is recorded, as figures write them."""

_READABLE = (1e-3, 1e5)
"""Between which a number is written without a power of ten."""
_SUPERSCRIPTS = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


def _power(value: float) -> int:
    """Return the power of ten that is written apart; 0 where none is needed."""
    low, high = _READABLE
    return 0 if value == 0 or low <= abs(value) < high else math.floor(math.log10(abs(value)))


def _times_ten(power: int) -> str:
    return f" × 10{str(power).translate(_SUPERSCRIPTS)}" if power else ""


def _digits(value: float) -> str:
    return f"{value + 0.0:.12g}".replace("-", "−")


_LETTERS = (("gammadot", "γ̇"), ("sigma", "σ"), ("epsilon", "ε"), ("kappa", "κ"), ("*", " "))
_WORDS = {"alpha": "α", "beta": "β", "eta s": "ηₛ", "tau": "τ", "xi": "ξ"}
"""Letters that are also parts of English words."""


def readable(term: str) -> str:
    """Return a term in canonical spelling, or words with such terms, with the field's letters."""
    # a full stop between tensors is a product; elsewhere it ends a sentence or is a decimal point
    text = re.sub(r"(?<=sigma|madot)\.(?=sigma|gammadot)", "·", term)
    for spelled, letter in _LETTERS:
        text = text.replace(spelled, letter)
    return re.sub(r"\b(alpha|beta|eta s|tau|xi)\b", lambda found: _WORDS[found[0]], text)


_EFFECTS = {
    "giesekus_mobility": "Giesekus",
    "non_affine_motion": "non-affine motion",
    "ptt_linear": "linear PTT",
    "ptt_exponential": "exponential PTT",
    "parallel_plates": "uncorrected parallel plates",
    "rate_rise_time": "motor response time",
    "relaxation_mode": "added mode",
    "softening_by_work": "work-softened relaxation",
    "solvent_viscosity": "Newtonian viscosity",
    # whatever takes the torque away: of a broken edge runs alone say no more
    "edge_fracture": "torque loss with strain",
    # what runs show; that it is thixotropy would take recovery at rest
    "thixotropy": "flow-softened modulus",
    "thixotropic_modulus": "rate-softened modulus",
    "thixotropic_modulus_by_stress": "stress-softened modulus",
    "thixotropic_relaxation": "rate-softened relaxation",
    "thixotropic_relaxation_by_stress": "stress-softened relaxation",
    "thixotropic_relaxation_two_times": "relaxation with two structure times",
}


def effect_title(name: str) -> str:
    """Return an effect as readers know it: its name in words, or its term in letters."""
    if "sigma" in name or "gammadot" in name:
        return readable(name)
    return _EFFECTS.get(name, name.replace("_", " "))


def effects_title(names: Sequence[str]) -> str:
    """Return a set of effects as readers know it."""
    return " + ".join(map(effect_title, names)) or "your model alone"


def interval(bounds: Sequence[float | None] | None) -> str:
    """Return an interval with as many digits as tell two of its width; a dash without two ends."""
    low, high = bounds or (None, None)
    if low is None or high is None or math.isnan(low) or math.isnan(high):
        return "–"
    width = abs(high - low)
    if not 0.0 < width < math.inf:
        return f"{significant(low)} to {significant(high)}"
    power = _power(max(abs(low), abs(high)))
    decimals = min(1 - math.floor(math.log10(width)) + power, 8)
    low, high = (_digits(round(end / 10.0**power, decimals)) for end in (low, high))
    return f"({low} to {high}){_times_ten(power)}" if power else f"{low} to {high}"


def estimate(value: float | None, bounds: Sequence[float | None] | None) -> str:
    """Return a number with the digits that its interval leaves it, but no fewer than two."""
    low, high = bounds or (None, None)
    if value is None or low is None or high is None or not math.isfinite(value):
        return significant(value)
    width = abs(high - low)
    if value == 0 or not 0.0 < width < math.inf:
        return significant(value)
    digits = 2 + math.floor(math.log10(abs(value))) - math.floor(math.log10(width))
    return significant(value, min(max(digits, 2), 8))
