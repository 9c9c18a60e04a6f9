"""The verdict on a closed loop in words: how the declared model stands, and how sure that is."""

from collections.abc import Iterator, Sequence

from discover.inference.by_mode.constants import ConstantByMode, StageParameter
from discover.laws.registry import LAWS
from discover.loop.asked import EXPLAINED, MOST_NAMES, doubted, several, untested_by
from discover.loop.loop_result import LoopResult
from discover.loop.parts import LawFit
from discover.protocols.kinematics import ONLY_STATES
from discover.report.free_form_words import free_form_sentence
from discover.report.wording import percent, sentence
from discover.words import effect_title, listed, readable, significant

KINDS = {"constitutive": "in the fluid", "kinematic": "in the flow", "signal": "in the instrument"}

_LOOP = {
    "effects_added": "Your model is missing an effect; with it the data are fitted to the noise",
    "no_effect_needed": "Your model fits the data to the noise; nothing is missing",
    "unexplained": "A systematic residual remains that no candidate explains",
    "no_signal": "No signal: the data hold no more than noise",
}

_OPEN = "Your model is missing an effect, but the data do not identify it"

_UNTESTED = {
    "effects_added": "Fitted, not tested: with the added effects your model describes",
    "no_effect_needed": "Fitted, not tested: with its constants fitted your model describes",
}

_ALIKE = 0.05
"""Probability of a law from which on these runs do not exclude it."""

_MEASURED = {"flows": "what was measured", "states": "the states that were measured"}

_SLOW = 0.5
"""Correlation from which noise and a slow effect look alike for some samples on end."""


def loop_verdict(result: LoopResult) -> list[str]:
    """Return the verdict on a closed loop: what was found, then how sure that is."""
    return [what_was_found(result), how_sure(result)]


def what_was_found(result: LoopResult) -> str:
    """Return how the declared model stands; effects and constants have a section of their own."""
    names = several([effect_title(stage.effect) for stage in result.stages], "and")
    if result.verdict == "no_signal":
        why = (
            f"{names} alone would explain them, without any fluid"
            if names
            else "the stress does not follow what was imposed"
        )
        return f"{_LOOP['no_signal']}: {why}."
    parts = []
    if result.verdict == "unexplained" and result.free_form:
        parts.append(free_form_sentence(result.free_form[0]))
    if result.laws:
        parts.append(_law_chosen(result.laws))
    return sentence([_how_it_stands(result), *parts])


def _how_it_stands(result: LoopResult) -> str:
    """Return the verdict in words."""
    if untested := untested_by(result):
        return f"{_UNTESTED[result.verdict]} {_MEASURED[untested]}"
    return _LOOP[result.verdict] if doubted(result) is None else _OPEN


def _law_chosen(laws: Sequence[LawFit]) -> str:
    """Return which law was taken of several, and from which these runs do not tell it."""
    best, *others = laws
    alike = [LAWS[one.law].title for one in others if (one.probability or 0.0) > _ALIKE]
    told = f"; these runs do not exclude {several(alike, 'and')}" if alike else ""
    ends = f" ({several(list(best.at_end), 'and')} at an end of its range)" if best.at_end else ""
    return f"of {len(laws)} laws {best.title}{ends} was taken{told}"


def named(name: str, parameter: StageParameter) -> str:
    """Return a parameter's name in the field's letters, and of one by mode, what it stands for."""
    text = readable(name.replace("_", " ").replace("build up", "build-up"))
    if not isinstance(parameter, ConstantByMode):
        return text
    if not parameter.degree:
        return f"{text} (one for all modes; the interval lets them differ)"
    time = significant(parameter.mean_time_s, 3)
    return f"{text} (varies from mode to mode) at λ = {time} s"


def how_sure(result: LoopResult) -> str:
    """Return what these data do not decide, and what did not count."""
    sentences = []
    if result.held_in_band is not None:
        share = percent(result.held_in_band)
        sentences.append(f"{share} of the held-out samples lie inside the 95 % band.")
    if untested_by(result) == "states":
        sentences.append(ONLY_STATES)
    if (deviation := result.remaining.get("loading_deviation")) and result.verdict in EXPLAINED:
        sentences.append(
            f"Each run has a loading factor, fitted jointly ({percent(deviation)} scatter); "
            "that of a held-out run is unknown."
        )
    if steps := result.remaining.get("step_instants"):
        runs = listed([*steps]) if len(steps) <= MOST_NAMES else f"{len(steps)} runs"
        sentences.append(
            f"The rate of {runs} steps between two samples: the instants are fitted jointly, "
            "those of a held-out run to that run."
        )
    if count := result.remaining.get("outliers", 0):
        sentences.append(f"{count} {'outliers were' if count > 1 else 'outlier was'} excluded.")
    return " ".join([*sentences, *(sentence([doubt]) for doubt in _what_tests_it(result))])


def _what_tests_it(result: LoopResult) -> Iterator[str]:
    """Tell what no run tests, and how probable it is that something else is right."""
    together = result.remaining.get("autocorrelation") or 0.0
    if result.verdict in EXPLAINED and together > _SLOW:
        yield (
            f"the residual is smooth (lag-1 correlation {together:.2g}); it is taken for noise, "
            "but a slowly varying effect would look the same"
        )
    untested = untested_by(result)
    if untested == "flows":
        yield ("no run was held out, and there are as few flows as fitted constants")
    elif result.error_before.held_out is None:
        yield "no run was held out"
    if doubted(result) is not None:
        none = percent(result.explanations.unexplained_probability)
        yield f"probability that no candidate is right: {none}"
