"""Sentences of an answer; the first lines have at most sixty words."""

from collections.abc import Mapping, Sequence
from typing import Any

from discover.answer import law_in_words
from discover.answer import modes_in_words as modes
from discover.answer.fields import AnswerFields
from discover.words import LEVEL, counted, listed, percent_of

_MOST_WORDS = 60
# How the law has its constants, and how brief the rest is, until both are that short
_SHORTER = (
    *((law_in_words.WITH_INTERVALS, brief) for brief in range(5)),
    *((law_in_words.BEST_FIT, brief) for brief in range(1, 5)),
    *((law_in_words.SOME, brief) for brief in range(2, 6)),
    *((law_in_words.ONE, brief) for brief in range(4, 6)),
)

SYMBOLS = {"sigma12": "σ12", "N1": "N1", "N2": "N2", "uniaxial": "uniaxial extension"}
"""Quantities as text writes them."""

_USELESS = 0.25  # Relative discrepancy beyond which a law is of no use for any prediction

A_TRANSIENT = (
    "Measure a transient, such as start-up: steady or periodic states alone identify no law."
)
"""What to measure where nothing but states was."""


def headline(answer: AnswerFields) -> str:
    """Return the first line: law, constants, how well it describes, where to use it."""
    return " ".join(filter(None, first_lines(answer)))


def first_lines(answer: AnswerFields) -> tuple[str, str]:
    """Return the law by name with constants, then how well it describes and where to use it.

    As short as need be: what gives way is in the table. Without a law, what stands in its place.
    """
    told = "", ""
    for form, brief in _SHORTER:
        parts = (
            description(answer, brief),
            answer.failed,
            where(answer, brief),
            left_out(answer, brief),
        )
        told = law_in_words.law(answer, form), " ".join(filter(None, parts))
        if words(" ".join([*told, answer.alternative, answer.next_test])) <= _MOST_WORDS:
            break
    return told


def words(text: str) -> int:
    """Return how many words a text has; numbers are some, signs are none."""
    return sum(any(map(str.isalnum, one)) for one in text.split())


def description(answer: AnswerFields, brief: int = 0) -> str:
    """Return how well the law describes the runs, and if that is enough.

    `brief`: 1 without the worst run, 2 without interval, 3 without whose errors several are and
    what these lack, 4 without a tolerance of which `where` says that it is missed.
    """
    if not answer.title:
        return ""
    found, each = answer.discrepancy, _unseen(answer)
    most = max((one.inside for one in each.values()), default=1.0)
    (note,) = (one.note for one in each.values()) if len(each) == 1 else ("",)
    on = note if note.partition(" ")[2].startswith("unseen") else "unseen runs"
    enough = tolerance(answer, brief) if brief < 4 or not _misses(answer) else ""
    if answer.fits_to_the_noise and most <= answer.tolerance:
        size = "≤ " * (len(each) > 1) + at_most(most)
        said, enough = f"Mean error {size} on {on}{after_noise(answer)}", ""
    elif answer.fits_to_the_noise:
        of = "" if answer.noise is None else f" of {percent_of(answer.noise)}"
        said = f"Fits {'the flow curve ' * answer.range.steady}within the noise{of}"
    elif found is None or not found.size:
        said = "" if answer.error is None else f"{_OF_FITTED} {percent_of(answer.error)}"
    else:
        low, high = (percent_of(end).removesuffix(" %") for end in found.ci95)
        ends = f" ({LEVEL} {low}–{high} %)" * (low != high and brief < 2)
        # of fitted runs it is no error that a prediction could have
        said = f"{_OF_FITTED if low == high else ESTIMATED} {percent_of(found.size)}{ends}"
        if found.unseen:
            said = _of_unseen(answer, each, f"{percent_of(found.size)}{ends} on {on}", brief)
    if brief > 2 and enough and _meet_alone(answer, each):
        return f"{said} ({enough})."
    return f"{'; '.join(filter(None, [said, enough]))}." if said else ""


def after_noise(answer: AnswerFields) -> str:
    """Return that errors do not hold the noise."""
    return f" after removing {percent_of(answer.noise)} noise" if answer.noise else ""


def only_quantity(answer: AnswerFields) -> str:
    """Return the symbol of the one stress that was fitted; empty of several."""
    flow, *others = answer.range.flows
    return "" if others else SYMBOLS.get("sigma12" if flow == "shear" else flow, "")


def _unseen(answer: AnswerFields) -> dict[str, Any]:
    """Return errors of what was measured and not fitted, by symbol."""
    each = {symbol: answer.expected(name) for name, symbol in SYMBOLS.items()}
    return {s: one for s, one in each.items() if one.inside is not None and not one.is_residual}


def _of_unseen(answer: AnswerFields, each: Mapping[str, Any], size: str, brief: int) -> str:
    """Return mean errors of unseen runs: of each quantity where several were measured, or of all.

    And the worst of these, where one misses the tolerance and the range does not say it.
    """
    worst = None if brief or answer.met_up_to else worst_run(answer)
    of_worst = [] if worst is None else [f"worst run {worst[1]}"]
    if len(each) < 2:
        of = f" of {next(iter(each))}" if each and brief < 3 else ""
        return ", ".join([f"Mean error{of} {size}", *of_worst])
    told, in_shear = [], answer.range.flows == ("shear",)
    for symbol, one in each.items():
        known = of_worst * (in_shear and symbol == "σ12")
        if one.uncorrected and brief < 3:
            known = [*known, f"not corrected for {one.uncorrected}"]
        behind = f" ({', '.join(known)})" * bool(known)
        told.append(f"{symbol} {at_most(one.inside)}{behind}")
    data = " on unseen data" * (brief < 3)
    return f"Mean error{data}: {', '.join([*told, *of_worst * (not in_shear)])}"


def _meet_alone(answer: AnswerFields, each: Mapping[str, Any]) -> list[str]:
    """Return the quantities that meet the tolerance, where others do not."""
    meeting = [symbol for symbol, one in each.items() if one.inside <= answer.tolerance]
    return meeting if len(meeting) < len(each) else []


def _misses(answer: AnswerFields) -> bool:
    """Return whether runs miss the tolerance in the mean, and at each rate."""
    return answer.adequate is False and not answer.met_up_to


def left_out(answer: AnswerFields, brief: int = 0) -> str:
    """Return what of the instrument is no part of the fluid, and so of no simulation.

    `brief`: from 3 on in fewer words, from 4 on of several no names, from 5 on nothing: the table
    has them.
    """
    names = [one.title for one in answer.suspects]
    if not names or brief > 4:
        return ""
    if brief < 3:
        return f"Not part of this law: {listed(names)} (instrument)."
    named = brief < 4 or len(names) == 1
    return (
        f"Instrument effects: {listed(names)}."
        if named
        else f"{len(names)} instrument effects (table)."
    )


_OF_FITTED, ESTIMATED = "Residual of the fitted runs", "Estimated error of the fitted runs"
"""What a law leaves of them; and what it may miss, where no run is unseen."""


def tolerance(answer: AnswerFields, brief: int = 0) -> str:
    """Return whether the tolerance is met, or unless `brief` in how many runs.

    Of several quantities that do and do not, by which; empty where `where` says up to which rate.
    """
    if answer.adequate is None:
        return ""
    over, level = len(_over_tolerance(answer)), f"tolerance {percent_of(answer.tolerance)}"
    each = _unseen(answer)
    if meeting := _meet_alone(answer, each):
        return level if brief > 2 else f"{level} met by {listed(meeting)} only"
    if over and answer.met_up_to:
        return ""
    state = "met" if answer.adequate else "missed"
    every = len(answer.error_by_run)
    if over and every > 1 and (not brief or answer.adequate):
        state = f"met in {every - over or 'none'} of {counted(every, 'run')}"
    return f"{level} {state}"


def flows_of(kinds: Sequence[str]) -> str:
    """Return kinds of flow, in words."""
    return listed([str(_FLOWS.get(one, one)) for one in kinds])


_FLOWS = {
    "uniaxial": "uniaxial extension",
    "planar": "planar extension",
    "biaxial": "biaxial extension",
}


def usable(answer: AnswerFields) -> tuple[list[str], str]:
    """Return for what the law may be used, and what else it predicts.

    That is what nothing tested and equally good laws agree in, up to the first that they do not.
    """
    flows, tested, implied = answer.range.flows, [], {}
    for name, symbol in SYMBOLS.items():
        one = answer.expected(name)
        fitted = ("shear" if name == "sigma12" else name) in flows
        if fitted if one.inside is None else one.inside <= _USELESS:
            states = name == "sigma12" and answer.range.steady
            tested.append("steady shear stress" if states else symbol)
    for name in ("N1", "uniaxial"):
        if (near := answer.expected(name).spread[0]) is not None:
            if near > answer.tolerance:
                break
            implied[SYMBOLS[name].removeprefix("uniaxial ")] = near
    tested += [flows_of([one]) for one in flows if one not in ("shear", "uniaxial")]
    if not implied:
        return tested, ""
    apart = at_most(max(implied.values())).removeprefix("< ")
    differ_by = f"equally good laws differ by {apart} (no error bound)"
    return tested, f"Untested: {listed([*implied])}; {differ_by}."


def where(answer: AnswerFields, brief: int = 0) -> str:
    """Return for what the law may be used, and in which flows; of no use, where it was fitted.

    `brief`: from 2 on without why it has no steady flow, from 4 on without what nothing tested.
    """
    place, (quantities, implied) = _place(answer), usable(answer)
    implied *= brief < 4
    if not place:
        return ""
    if not quantities or (answer.adequate is False and (answer.size or 0.0) > _USELESS):
        return f"Do not use to predict; fitted in {flows_of(answer.range.flows)}, {place}."
    begin = f"If {percent_of(answer.size or 0.0)} suffices, use" if _misses(answer) else "Use"
    use = f"{begin} for {listed(quantities)}"
    only = " only" * (len(quantities) == 1 and not implied)
    place = _in_part(answer, place) or f", {place}"
    comma = "," * bool(only and not place.startswith(","))
    said = f"{use}{only}{comma}{place}.", _unsteady(answer, brief), implied
    return " ".join(filter(None, said))


def _unsteady(answer: AnswerFields, brief: int) -> str:
    """Return from which rate on the law predicts no steady flow; empty where it does at each."""
    temperatures = [*answer.range.by_temperature]
    at = f" at {modes.degrees(temperatures[0])}" if len(temperatures) == 1 else ""
    above = answer.falls_above.removesuffix(at)  # which was said
    why = " (falling flow curve)" * (brief < 2)
    return f"No steady flow above {above}{why}." if above else ""


def _in_part(answer: AnswerFields, place: str) -> str:
    """Return where each run meets the tolerance, and by how much others miss it; empty if none."""
    worst, one = worst_run(answer), answer.range
    if worst is None or not (met := answer.met_up_to):
        return ""
    within, number = f"within {percent_of(answer.tolerance)}", met.removesuffix(" 1/s")
    (at, own), *others = [*one.by_temperature.items()] or [(None, one)]
    unlike = others or one.frequency_rad_s or (at is None and answer.shift_factors)
    if unlike or not one.tests or own.rate_1_s is None:
        return f", {place}: {within} up to {met}; up to {worst[1]} off above"
    low, high = map(modes.short, own.rate_1_s)
    slow = met if low == number else f"{low}–{met}"
    flows = listed(one.tests) + ("" if at is None else f" at {modes.degrees(at)}")
    return f" in {flows}: {within} at {slow}; up to {worst[1]} off at {number}–{high} 1/s"


def _place(answer: AnswerFields) -> str:
    """Return rates and frequencies of the fitted runs, by the temperature of the measurement.

    In numbers without units where the modes have none.
    """
    one = answer.range
    if modes.is_plain(answer) and one.weissenberg is not None:
        slow = ""
        if one.deborah is not None and one.oscillates:
            near = one.deborah[0] < _NEARLY_STEADY
            ends = f"≤ {modes.short(one.deborah[1])}" if near else f"= {modes.span(one.deborah)}"
            slow = f" and De = λω {ends}"
        rate = "" if one.rate_1_s is None else f" ({modes.short(one.rate_1_s[1])} 1/s)"
        flows = listed([*one.tests, *["oscillatory shear"] * bool(one.deborah and one.oscillates)])
        return f"{flows}{', ' * bool(flows)}Wi = λγ̇ ≤ {modes.short(one.weissenberg[1])}{rate}{slow}"
    tests = f"{listed(one.tests)} at " if one.tests else ""
    if not one.by_temperature:
        reduced = (
            f" reduced to {modes.reduced_to(answer.temperature_C)}" if answer.shift_factors else ""
        )
        if rates := _rates(one):
            return f"{tests}{rates}{reduced}"
        return f"{tests}strains up to {modes.short(one.strain[1])}" if tests and one.strain else ""
    joint = ", " if len(one.by_temperature) == 1 else " at "
    told = [f"{_rates(r)}{joint}{modes.degrees(at)}" for at, r in one.by_temperature.items()]
    return tests + (listed(told) if len(told) <= modes.MOST_SHIFTS else f"{told[0]} to {told[-1]}")


_NEARLY_STEADY = 0.5  # Deborah number below which a fluid relaxes several times in each cycle


def _rates(one: Any) -> str:
    """Return the rates of a range and the frequencies of what oscillates, or its amplitudes."""
    if one.amplitude is not None and one.frequency_rad_s is not None:
        at = f"oscillatory shear at {modes.span(one.frequency_rad_s)} rad/s"
        return f"{at}, strain amplitude {modes.span(one.amplitude)}"
    found = [] if one.rate_1_s is None else [f"{modes.span(one.rate_1_s)} 1/s"]
    if (frequencies := one.frequency_rad_s) is not None:
        several = any(sign in (told := modes.span(frequencies)) for sign in ("–", " to "))
        found.append(f"{'' if several else 'oscillating at '}{told} rad/s")
    return ", ".join(found)


def _over_tolerance(answer: AnswerFields) -> dict[str, float]:
    """Return runs that are missed by more than the tolerance, with their discrepancy."""
    return {name: size for name, size in answer.error_by_run.items() if size > answer.tolerance}


def worst_run(answer: AnswerFields) -> tuple[str, str] | None:
    """Return name and error of the run that is missed most; None where all are within tolerance."""
    over = _over_tolerance(answer)
    if not over:
        return None
    name = max(over, key=lambda name: over[name])
    return name, percent_of(over[name])


def at_most(value: float) -> str:
    """Return a relative error; of one that is large or tiny only that it is."""
    if value < _LITTLE:
        return f"< {percent_of(_LITTLE)}"
    return percent_of(value) if value <= MUCH else f"> {percent_of(MUCH)}"


MUCH, _LITTLE = 2.0, 1e-3
"""Relative errors from which on, and up to which, their size says nothing."""


def suspects(answer: AnswerFields) -> str:
    """Return what is suspected of the instrument; empty where nothing is."""
    if not answer.suspects:
        return ""
    if not answer.fits_to_the_noise and answer.discrepancy and len(answer.discrepancy.by_run) == 1:
        names = listed([one.title for one in answer.suspects])
        return f"One run does not tell {names} from what the law lacks."
    if len(answer.suspects) == 1:
        return f"{SUSPECTED}: {answer.suspects[0].text}."
    names = listed([one.title for one in answer.suspects])
    return f"{SUSPECTED}: {names}{'' if separable(answer) else f', {NOT_SEPARABLE}'}."


SUSPECTED = "Effects of the instrument, fitted too but not part of the law"
"""Heading of effects of the instrument and of the flow in the gap."""

NOT_SEPARABLE = "sizes not separable"
"""What is said of several of them that these runs do not give a size each."""


def separable(answer: AnswerFields) -> bool:
    """Return whether the runs give each suspect a size of its own."""
    return len(answer.suspects) < 2 or all(one.is_separate for one in answer.suspects)
