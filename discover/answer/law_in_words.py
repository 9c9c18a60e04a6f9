"""The law of an answer in one line: its name, its constants in one of four forms, its modes."""

from collections.abc import Sequence

from discover.answer import modes_in_words as modes
from discover.answer.constant import Constant
from discover.answer.fields import AnswerFields
from discover.words import LEVEL, significant

WITH_INTERVALS, BEST_FIT, SOME, ONE = range(4)
"""Forms of the constants: with 95 % intervals; best fit of all, of a few, of one."""

_FEW = 3  # Constants with which others are counted
_LEVEL = f"{LEVEL} "
_OF_MODES = ("modulus_Pa", "relaxation_time_s", *modes.OF_SWEEP)


def law(answer: AnswerFields, form: int) -> str:
    """Return the law by name, its constants in one of these forms, and its modes."""
    if not answer.title:
        return answer.instead
    title = answer.title[:1].upper() + answer.title[1:]
    several = len(answer.modes) > 1
    # moduli and times of several modes stand in their table, terms of a sum in its equation
    own = [
        one for one in answer.constants
        if not (several and (one.name in _OF_MODES or one.letter.endswith("_+")))
        and not (answer.is_empirical and one.is_term)
    ]  # fmt: skip
    linear = (*_OF_MODES, "eta_s")
    own = sorted(own, key=lambda one: (one.name in linear) is (answer.law is not None))
    named = _constants_as(own, form)
    if several:
        # a solvent, or modes faster than the data: a melt has the one and no other
        and_viscosity = answer.solvent_viscosity_Pa_s and "η_s" not in (one.symbol for one in own)
        added = sum(modes.is_added(answer, one) for one in answer.modes)
        among = f" ({added} added)" * bool(added)
        named.append(f"{len(answer.modes)} modes{among}{' and η_s' * bool(and_viscosity)}")
    elif (
        answer.modes
        and not modes.is_plain(answer)
        and [one.name for one in own] in ([], ["eta_s"] * len(named))
    ):
        (mode,) = answer.modes
        time = f"λ = {significant(mode.relaxation_time_s, 3)} s"
        named = [f"G = {significant(mode.modulus_Pa, 3)} Pa", time, *named]
    for one in answer.constants:
        known = one.name in modes.OF_SWEEP and not one.is_poor
        if known and differ(one.ci95, answer.tolerance):
            level = "" if form or any(one.has_interval for one in own) else _LEVEL
            named.append(f"the sweep's {modes.OF_SWEEP[one.name]} × {one.measured(level)}")
    if answer.temperature_C is not None and not answer.shift_factors:
        named.append(f"at {modes.degrees(answer.temperature_C)}")
    return f"{', '.join([title, *named])}."


def _constants_as(own: Sequence[Constant], form: int) -> list[str]:
    """Return constants with intervals, as the set of the best fit, or the first and how many."""
    if form == WITH_INTERVALS:
        return _with_intervals(own)
    most = {BEST_FIT: len(own), SOME: _FEW, ONE: 1}[form]
    shown = own[: most + (len(own) == most + 1)]  # one more has as many words as a count
    told = [one.best_fit for one in shown]
    if any(one.ci95 is not None for one in shown):
        told[0] = f"best fit {told[0]}"
    if more := len(own) - len(shown):
        told.append(f"{more} more constants")
    return told


def _with_intervals(several: Sequence[Constant]) -> list[str]:
    """Return constants in words; the first interval says that it is one of 95 %."""
    first = next((one for one in several if one.has_interval), None)
    return [one.with_interval(_LEVEL if one is first else "") for one in several]


def is_a_set(answer: AnswerFields) -> bool:
    """Return whether constants go together: one is far from the middle of its interval.

    Intervals are over all laws that fit as well, so that ends of several make no law that does.
    """
    fitted = [one for one in answer.constants if one.ci95 is not None]
    return len(fitted) > 1 and any(
        one.bound or one.is_skewed or not one.determined for one in fitted
    )


def differ(ci95: Sequence[float] | None, tolerance: float) -> bool:
    """Return whether the interval of a factor says that it is not one, but for a tolerance."""
    low, high = ci95 or (1.0, 1.0)
    return high < 1.0 - tolerance or low > 1.0 + tolerance
