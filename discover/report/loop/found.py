"""What a closed loop found: the effects with their constants, and how the declared model stands."""

from collections.abc import Sequence

from discover.inference.by_mode.constants import ConstantByMode, StageParameter
from discover.laws.registry import LAWS
from discover.loop.asked import doubted, several, untested_by
from discover.loop.loop_result import LoopResult
from discover.loop.parts import LawFit
from discover.report.free_form_words import free_form_sentence
from discover.report.wording import (
    effect_title,
    readable,
    sentence,
    significant,
)

KINDS = {
    "constitutive": "in the fluid",
    "kinematic": "in the flow",
    "signal": "in the instrument",
}

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

_MEASURED = {
    "flows": "what was measured",
    "states": "the states that were measured",
}


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
        curve = result.free_form[0]
        parts.append(free_form_sentence(curve))
    if result.laws:
        parts.append(_law_chosen(result.laws))
    return sentence([_how_it_stands(result), *parts])


def _how_it_stands(result: LoopResult) -> str:
    """Return the verdict in words."""
    if untested := untested_by(result):
        return f"{_UNTESTED[result.verdict]} {_MEASURED[untested]}"
    return _LOOP[result.verdict] if doubted(result) is None else _OPEN


def _in_words(name: str) -> str:
    """Return the name of a constant as it is read."""
    return readable(name.replace("_", " ").replace("build up", "build-up"))


def _law_chosen(laws: Sequence[LawFit]) -> str:
    """Return which law was taken of several, and from which these runs do not tell it."""
    best, *others = laws
    alike = [LAWS[one.law].title for one in others if (one.probability or 0.0) > _ALIKE]
    told = f"; these runs do not exclude {several(alike, 'and')}" if alike else ""
    ends = f" ({several(list(best.at_end), 'and')} at an end of its range)" if best.at_end else ""
    return f"of {len(laws)} laws {best.title}{ends} was taken{told}"


def named(name: str, parameter: StageParameter) -> str:
    """Return a parameter's name in the field's letters, and of one by mode, what it stands for."""
    text = _in_words(name)
    if not isinstance(parameter, ConstantByMode):
        return text
    if not parameter.degree:
        return f"{text} (one for all modes; the interval lets them differ)"
    time = significant(parameter.mean_time_s, 3)
    return f"{text} (varies from mode to mode) at λ = {time} s"
