"""The verdict on a closed loop: what was found, how sure, what to measure next."""

from collections.abc import Sequence

import numpy as np

from discover.closed_loop.results.law_fit import LawFit
from discover.closed_loop.results.loop_result import LoopResult
from discover.closed_loop.results.stages import Stage
from discover.dataset.coarse_rates import MORE_SAMPLES, CoarseRates, coarse_in
from discover.inference.constants import ConstantByMode, StageParameter
from discover.laws.registry import LAWS
from discover.protocols.kinematics import ONLY_STATES
from discover.report.free_form_words import free_form_sentence
from discover.report.wording import (
    A_TRANSIENT,
    FIGURE_SYMBOLS,
    effect_title,
    effects_title,
    estimate,
    interval,
    percent,
    readable,
    sentence,
    significant,
)
from discover.statistics.residual import FEWEST_TESTED
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

_UNTESTED = {
    "effects_added": "Fitted, not tested: with what is added the declared model describes",
    "no_effect_needed": "Fitted, not tested: with its constants fitted the declared model "
    "describes",
}

_MEASURED = {
    "flows": "what was measured",
    "states": "the states that were measured",
}

_UNKNOWN_NOISE = "The runs have too few samples to tell noise from a missing effect"

_UNKNOWN_RATE = "What the rate did between its samples hides all that could tell what is missing"

_NOT_CARRIED = "What explains the fitted runs does not carry over to the runs held out"

_MOST_NAMES = 3

_SETTLED = 0.95
_SLOW = 0.5  # correlation from which noise and a slow effect look alike for some samples on end


def loop_verdict(result: LoopResult) -> list[str]:
    """Return the verdict on a closed loop: an answer to each of `QUESTIONS`, in order."""
    return [_loop_found(result), _loop_sure(result), _loop_next(result)]


def _loop_found(result: LoopResult) -> str:
    names = _several([effect_title(stage.effect) for stage in result.stages], "and")
    if result.verdict == "no_signal" and not names:
        return (
            f"{_LOOP['no_signal']}: they hold hardly anything but noise, or do not follow what was "
            "imposed."
        )
    if result.verdict == "no_signal":
        return (
            f"{_LOOP['no_signal']}: {names} would explain them, with a fluid that is as good as "
            "absent."
        )
    if result.verdict == "unexplained" and names and result.remaining.get("without_fluid"):
        return (
            f"No candidate explains the data: what comes nearest ({names}) leaves as much without "
            "the fluid."
        )
    # what comes near without explaining is not called added
    lead = "what comes nearest is, " if result.verdict == "unexplained" else "added "
    parts = []
    for i, stage in enumerate(result.stages):
        parts.append(
            f"{lead if i == 0 else ''}{KINDS[stage.kind]}: {effect_title(stage.effect)}, "
            + _values(stage)
        )
    verdict = _LOOP[result.verdict]
    if untested := _untested(result):
        verdict = f"{_UNTESTED[result.verdict]} {_MEASURED[untested]}"
    if result.verdict == "unexplained":
        if (coarse := _coarse(result)) is not None and coarse.hides:
            verdict = _UNKNOWN_RATE
        elif not result.remaining.get("noise_known", True):
            verdict = _UNKNOWN_NOISE
        elif not result.remaining.get("carries_over", True):
            verdict = _NOT_CARRIED
        if result.free_form and result.free_form[0].explains:
            parts.append(f"but {free_form_sentence(result.free_form[0])}")
        elif result.free_form:
            parts.append(f"and {free_form_sentence(result.free_form[0])}")
    if result.laws:
        parts.append(_law_chosen(result.laws))
    return sentence([verdict, *parts])


def _values(stage: Stage) -> str:
    """Return the constants of an effect, and which of them these data leave open."""
    told = [
        f"{named(name, p)} = {estimate(p.value, p.ci95)} {p.unit}".rstrip()
        + f" (95 % {interval(p.ci95)})"
        for name, p in stage.parameters.items()
        if name not in stage.left_open
    ]
    for one in stage.told_together:
        value = f"{estimate(one.value, one.ci95)} {one.unit}".rstrip()
        told.append(f"{_in_words(one.name)} = {value} (95 % {interval(one.ci95)})")
    if stage.left_open:
        names = listed([_in_words(name) for name in stage.left_open])
        alone = " alone" if stage.told_together else ""
        left = f"{names}{alone} not determined by these data"
        return f"{', '.join(told)}, with {left}" if told else left
    return ", ".join(told)


def _in_words(name: str) -> str:
    """Return the name of a constant as it is read."""
    return readable(name.replace("_", " ").replace("build up", "build-up"))


def _law_chosen(laws: Sequence[LawFit]) -> str:
    """Return which law was taken of several, and from which these runs do not tell it."""
    best, *others = laws
    alike = [LAWS[one.law].title for one in others if not one.is_told_apart]
    told = f"; these runs do not tell it from {_several(alike, 'and')}" if alike else ""
    ends = f" ({_several(list(best.at_end), 'and')} at an end of its range)" if best.at_end else ""
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


def _loop_sure(result: LoopResult) -> str:
    before, after = result.error_before, result.error_after
    parts, said = [], ""
    if before.held_out is not None and after.held_out is not None:
        unseen = "on runs that no fit saw"
        if result.folds:
            unseen = "on each run, by a search that did not see it,"
        said, sizes = _change(result, before.held_out, after.held_out)
        parts.append(f"{unseen} the error {said} {sizes}")
        if result.held_in_band is not None:
            share = percent(result.held_in_band)
            parts.append(f"the 95 % band of all explanations holds {share} of their samples")
    verb, sizes = _change(result, before.fit, after.fit)
    # a verb is said again only where it is another one
    told = sizes if verb == said else f"the error {verb} {sizes}"
    linear = result.remaining.get("linear_error") or 0.0
    noise = f"where noise explains {percent(result.noise_floor)}"
    if linear > result.noise_floor:
        noise += f" and the misfit of the linear sweep by its modes {percent(linear)}"
    elif result.verdict == "unexplained" and result.remaining.get("noise_unsure"):
        # slow noise is not told from a misfit
        noise = (
            f"of which {percent(result.noise_floor)} changes from sample to sample, as noise does"
        )
    if not result.remaining.get("noise_known", True):
        noise = "of which nobody knows how much is noise"
    sentences = [sentence([*parts, f"on the fitted runs {told}, {noise}"])]
    parts = []
    together = result.remaining.get("autocorrelation") or 0.0
    if result.verdict in _EXPLAINED and together > _SLOW:
        parts.append(
            f"neighbouring samples of what is left are correlated to {together:.2g}: it is taken "
            "for noise, and an effect that varies slowly would look the same"
        )
    none = percent(result.explanations.unexplained_probability)
    nothing = f"that something else is right has a probability of {none}"
    untested = _untested(result)
    if untested == "flows":
        parts.append(
            "no run was held out, and no more flows were measured than what was fitted takes, so "
            f"none tested it: {nothing}"
        )
    elif before.held_out is None:
        parts.append("no run was held out to judge by")
    if untested == "states":
        sentences.append(ONLY_STATES)
        if result.stages:
            parts.append(nothing)
    if (coarse := _coarse(result)) is not None:
        sentences.append(coarse.sentence)
    if said := result.remaining.get("read_otherwise"):
        sentences.append(said)
    if steps := result.remaining.get("step_instants"):
        runs = listed([*steps]) if len(steps) <= _MOST_NAMES else f"{len(steps)} runs"
        sentences.append(
            f"The rate of {runs} steps between two samples, which do not tell "
            "when: the instants are fitted along, those of a run held out to that run itself."
        )
    if few := result.remaining.get("not_judging", ()):
        verb = "have too few samples to judge" if len(few) > 1 else "has too few samples to judge"
        parts.append(f"{_several(few, 'and')} {verb}")
    if weights := result.remaining.get("weights"):
        ratio = significant(max(weights.values()) / min(weights.values()), 2)
        parts.append(
            f"the noise of runs differs by up to a factor of {ratio}, and each weighs by its own"
        )
    if count := result.remaining.get("outliers", 0):
        which = "samples are outliers" if count > 1 else "sample is an outlier"
        parts.append(f"{count} {which} and did not count")
    if result.verdict == "effects_added" and (told := _alternatives(result)):
        parts.append(told)
    for stage in result.stages:
        if stage.aliases:
            others = _several([*map(effect_title, stage.aliases)], "or")
            parts.append(f"these data cannot tell {effect_title(stage.effect)} from {others}")
    return " ".join([*sentences, *(sentence([part]) for part in parts)])


def _alternatives(result: LoopResult) -> str:
    """Return what is likelier than what was found, or nearly as likely; empty if nothing is."""
    found = result.explanations.likeliest_first
    own = result.explanations.holding([stage.effect for stage in result.stages])
    others = [e for e in found if e is not own]
    if own is None or not others:
        return ""
    share = own.probability / sum(e.probability for e in found)
    if share > _SETTLED:
        return ""
    names = " with ".join(map(effect_title, others[0].effects)) or "the declared model alone"
    rest = f" and {len(others) - 1} more" if len(others) > 1 else ""
    return f"of what fits alike this has {percent(share)}, beside {names}{rest}"


def _change(result: LoopResult, before: float, after: float) -> tuple[str, str]:
    """Return what an error did, as a verb, and from where to where, as far as digits show it."""
    if percent(before) == percent(after):
        return "stays at" if result.stages or result.folds else "is", percent(after)
    return "falls" if after < before else "rises", f"from {percent(before)} to {percent(after)}"


def _several(names: Sequence[str], word: str) -> str:
    """Return the first of several names, and how many more there are."""
    shown = list(names[:_MOST_NAMES])
    if more := len(names) - len(shown):
        shown.append(f"{more} more")
    return f" {word} ".join(shown)


def _coarse(result: LoopResult) -> CoarseRates | None:
    """Return what rates read in too few samples leave open, if that is not small."""
    return coarse_in(result.remaining.get("sampled_rate"))


def _loop_next(result: LoopResult) -> str:
    if _coarse(result) is not None:
        return MORE_SAMPLES
    rates = [float(np.max(np.abs(record.rate))) for record in result.records]
    faster = f"a shear rate above {significant(max(rates, default=0.0), 3)} 1/s"
    if result.verdict == "no_signal" or result.remaining.get("without_fluid"):
        return (
            "See that the sensor is connected and the sample there, and measure where the stress "
            "stands out of the noise: with a larger sample, a more sensitive transducer, or "
            f"{faster}."
        )
    untested = _untested(result)
    if untested == "states":
        return A_TRANSIENT
    if result.verdict in _EXPLAINED and (told := _telling_test(result)):
        return told
    if untested:
        return "Fit another run, or hold one out: at another rate, or of another test."
    doubtful = _most_doubtful(result.stages)
    if doubtful is not None and result.verdict != "unexplained":
        check = doubtful.check.rstrip(". ")
        if not check[1:2].isdigit():  # N2 keeps its capital
            check = check[:1].lower() + check[1:]
        title = effect_title(doubtful.effect)
        if not doubtful.aliases:
            return f"To confirm {title}: {check}."
        others = _several([*map(effect_title, doubtful.aliases)], "and")
        return f"To tell {title} from {others}: {check}."
    if not result.remaining.get("noise_known", True):
        return (
            f"Record at least {FEWEST_TESTED} samples in each run, or repeat a run to learn its "
            "noise and write it in the study ([loop] noise)."
        )
    if result.verdict == "unexplained":
        return (
            "Repeat one run with another geometry or instrument: what changes is the instrument's, "
            "what stays is the fluid's."
        )
    hidden = max(
        result.noise_floor,
        *(float(result.remaining.get(name, 0.0)) for name in ("resolution", "linear_error")),
    )
    return (
        f"What changes the stress by less than {percent(max(hidden, 1e-5))} may still hide; what "
        f"tests the model hardest is a faster flow: {faster}."
    )


_EXPLAINED = ("effects_added", "no_effect_needed")


def _untested(result: LoopResult) -> str:
    """Return why nothing tested what explains the records, `Untested`; empty where it was."""
    return str(result.remaining.get("untested") or "") if result.verdict in _EXPLAINED else ""


def _telling_test(result: LoopResult) -> str:
    """Return the test that tells the likeliest explanation from others; empty if none does."""
    following = result.next_tests
    best = following.best
    if best is None:
        return ""
    titles = [effects_title(effects) for effects in following.explanations]
    first, *_ = best.pairs
    chosen = first[0]
    others = _several([titles[j] for i, j in best.pairs if i == chosen], "and")
    what = f" ({FIGURE_SYMBOLS[best.quantity]})" if best.quantity != "sigma12" else ""
    count = len(following.tests)
    return f"To tell {titles[chosen]} from {others}: {best.title}{what}, of {count} tests weighed."


def _most_doubtful(stages: Sequence[Stage]) -> Stage | None:
    """Return the stage to confirm first: one with aliases before one without."""
    with_aliases = [stage for stage in stages if stage.aliases]
    return next(iter([*with_aliases, *stages]), None)
