"""What a closed loop found: the effects with their constants, and how the declared model stands."""

from collections.abc import Sequence

from discover.inference.by_mode.constants import ConstantByMode, StageParameter
from discover.laws.registry import LAWS
from discover.loop.asked import doubted, several, untested_by
from discover.loop.loop_result import LoopResult
from discover.loop.parts import LawFit, Stage
from discover.report.free_form_words import free_form_sentence
from discover.report.wording import (
    effect_title,
    estimate,
    interval,
    percent,
    readable,
    sentence,
    significant,
)
from discover.words import listed

KINDS = {
    "constitutive": "in the fluid",
    "kinematic": "in the flow that the fluid felt",
    "signal": "in the instrument's signal",
}

_LOOP = {
    "effects_added": "The declared model lacked something, and adding it explains the data",
    "no_effect_needed": "Nothing is missing that these data show: the declared model explains them",
    "unexplained": "What is left still has structure that no candidate explains",
    "no_signal": "The records hold no signal that a law could be told from",
}

_OPEN = "The declared model lacked something, but what that is stays open"

_UNTESTED = {
    "effects_added": "Fitted, not tested: with what is added the declared model describes",
    "no_effect_needed": "Fitted, not tested: with its constants fitted the declared model "
    "describes",
}

_ALIKE = 0.05
"""Probability of a law from which on these runs do not tell it from the likeliest."""

_MEASURED = {
    "flows": "what was measured",
    "states": "the states that were measured",
}


def what_was_found(result: LoopResult) -> str:
    """Return the effects found, with their constants, and whether they explain the data."""
    names = several([effect_title(stage.effect) for stage in result.stages], "and")
    if result.verdict == "no_signal":
        why = (
            f"{names} would explain them, with a fluid that is as good as absent"
            if names
            else "they hold hardly anything but noise, or do not follow what was imposed"
        )
        return f"{_LOOP['no_signal']}: {why}."
    parts = [
        f"{KINDS[stage.kind]}: {effect_title(stage.effect)}, {_values(stage)}"
        for stage in result.stages
    ]
    if parts:
        # what comes near without explaining is not called added
        lead = "what comes nearest is, " if result.verdict == "unexplained" else "added "
        if (share := doubted(result)) is not None:
            lead = f"with a probability of {percent(share)} it is, "
        parts[0] = lead + parts[0]
    if result.verdict == "unexplained" and result.free_form:
        curve = result.free_form[0]
        parts.append(f"and {free_form_sentence(curve)}")
    if result.laws:
        parts.append(_law_chosen(result.laws))
    return sentence([_how_it_stands(result), *parts])


def _how_it_stands(result: LoopResult) -> str:
    """Return the verdict in words."""
    if untested := untested_by(result):
        return f"{_UNTESTED[result.verdict]} {_MEASURED[untested]}"
    return _LOOP[result.verdict] if doubted(result) is None else _OPEN


def _values(stage: Stage) -> str:
    """Return the constants of an effect, and which of them these data leave open."""
    told = [
        f"{named(name, p)} = {estimate(p.value, p.ci95)} {p.unit}".rstrip()
        + f" (95 % {interval(p.ci95)})"
        for name, p in stage.parameters.items()
        if name not in stage.left_open
    ]
    if stage.left_open:
        names = listed([_in_words(name) for name in stage.left_open])
        left = f"{names} not determined by these data"
        return f"{', '.join(told)}, with {left}" if told else left
    return ", ".join(told)


def _in_words(name: str) -> str:
    """Return the name of a constant as it is read."""
    return readable(name.replace("_", " ").replace("build up", "build-up"))


def _law_chosen(laws: Sequence[LawFit]) -> str:
    """Return which law was taken of several, and from which these runs do not tell it."""
    best, *others = laws
    alike = [LAWS[one.law].title for one in others if (one.probability or 0.0) > _ALIKE]
    told = f"; these runs do not tell it from {several(alike, 'and')}" if alike else ""
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
    return f"{text} (it differs from mode to mode) at a relaxation time of {time} s"
