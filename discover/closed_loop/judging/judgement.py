"""The verdict: does what was found explain the fitted runs, and does it carry over to others."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from discover.closed_loop.judging.held_out import HeldOut
from discover.closed_loop.judging.tolerated_misfit import ToleratedMisfit
from discover.closed_loop.results.run_record import RunRecord
from discover.closed_loop.results.stages import Verdict
from discover.forward.least_squares import Fit
from discover.statistics.lack_of_fit import LackOfFit
from discover.statistics.residual import FEWEST_FAST, STRUCTURE, summarise, tells_noise
from discover.statistics.unseen import CARRIED, Unseen, refutes
from discover.statistics.whiteness import SIGNIFICANCE
from discover.words import percent_of

Silence = Literal["records", "fluid"]
"""What holds no signal: the records themselves, or what a fit leaves to the fluid of them."""


@dataclass(frozen=True)
class Judgement:
    """What is to be believed of a final model.

    Attributes
    ----------
    verdict, structured
        The verdict, and whether something is left that nothing explains.
    left
        What is left of the fitted runs.
    resolution
        Relative error of them that arithmetic explains.
    noise_known, carries_over
        Whether the runs are long enough to tell noise from structure, or the noise was given; and
        whether the held-out runs are predicted as well as can be asked.
    not_judging
        Runs with too few samples to judge by, where others have more.
    missed, unseen
        How many times what can be asked the runs held out are missed, and how many there are.
    worst
        The run that is missed most.
    description
        The reasons, in sentences.
    """

    verdict: Verdict
    structured: bool
    left: LackOfFit
    resolution: float
    noise_known: bool
    carries_over: bool
    not_judging: tuple[str, ...]
    worst: RunRecord
    description: str
    missed: float = 0.0
    unseen: int = 0


def judge(
    tolerated: ToleratedMisfit,
    fit: Fit,
    active: Sequence[str],
    records: Sequence[RunRecord],
    held: HeldOut | None,
    silence: Silence | None = None,
    not_from_rest: Sequence[str] = (),
) -> Judgement:
    """Return the verdict on a final model.

    Parameters
    ----------
    tolerated
        What a complete model may leave of the fitted runs.
    fit, active
        The final fit and the effects in it.
    records
        All runs with their predictions.
    held
        Runs held out, if any.
    silence
        What is silent, if anything is.
    not_from_rest
        Fitted runs that are taken as starting from rest and cannot have started so. What came
        before them looks like an effect, so no effect that explains them is believed.
    """
    expectation, weight = tolerated.expectation, tolerated.weight
    left = tolerated.left(fit.residual)
    error, expected, given = left.misfit, left.expected, tolerated.noise_known
    plain = not given or left.verdict != "unexplained"
    explained = plain or tolerated.explained(fit, active)
    # steps are computed on only where noise alone does not explain what is left
    asked = float("inf") if plain else error
    resolution = tolerated.resolution.limit(fit.theta, active, asked)
    known = given or error <= STRUCTURE * resolution
    missed_held_out = _error([record for record in records if record.held_out])
    # knocks in runs that no fit saw refute no law
    unseen = None if held is None else held.unseen.without_outliers(expectation)
    if unseen is not None:
        missed_held_out = min(missed_held_out, unseen.error)
    asked_of_held_out = max(error, expected, resolution)
    carries_over = held is None or missed_held_out <= CARRIED * asked_of_held_out
    if held is not None and not carries_over:
        # held-out runs may be noisier than the fitted ones, or rounded more coarsely
        own = summarise(held.residual, held.weight).noise
        limit = held.resolution.limit(fit.theta, active, missed_held_out)
        asked_of_held_out = max(asked_of_held_out, held.resolution.mean(own), limit)
        carries_over = missed_held_out <= CARRIED * asked_of_held_out
        # and a few samples, off by chance, decide nothing
        carries_over |= tells_noise(weight) and not tells_noise(held.weight)
    pattern = False
    if unseen is not None and explained and carries_over and tolerated.noise_known:
        pattern = _refuted_by(tolerated, fit, unseen, plain)
    if held is not None and pattern:
        limit = held.resolution.limit(fit.theta, active, missed_held_out)
        # what arithmetic did to the fitted runs, constants carry over
        pattern = missed_held_out > STRUCTURE * max(limit, resolution)
    carries_over &= not pattern
    nothing = plain and left.verdict == "no_signal"
    structured = not (known and explained and carries_over)
    mistaken = bool(active and not structured and not_from_rest)
    structured |= mistaken
    verdict: Verdict = "unexplained" if structured else "no_effect_needed"
    if active and not structured:
        verdict = "effects_added"
    silent = silence == "records" or (known and explained and (silence is not None or nothing))
    if silent:
        verdict, structured = "no_signal", False
    worst = max(records, key=lambda record: record.errors[-1])
    linear = expectation.linear_error > 0.0
    causes = "noise and the error of the linear data explain" if linear else "noise explains"
    short = tuple(r.name for r in records if given and len(r.time) < FEWEST_FAST)
    which = f"The fitted runs of {FEWEST_FAST} samples or more" if short else "The fitted runs"
    missed = f"{which} are missed by {percent_of(error)}"
    like_noise = ""
    if explained and not carries_over:
        left = left.refuted(left.reason)
        if STRUCTURE * left.noise < expected and not linear:
            like_noise = (
                f", which would pass for correlated noise ({percent_of(left.noise)} changes from "
                "sample to sample)"
            )
    if silence == "records":
        text = (
            "The records are noise about a constant, whatever rate was imposed: they hold no "
            "signal that a law could be told from."
        )
    elif not known:
        text = (
            f"{missed}, and no run has enough samples to tell noise from a missing effect. Sample "
            "more often, or give the noise ([loop] noise)."
        )
    elif silent and nothing:
        text = f"{missed}, and {causes} that: the records hold hardly anything else."
    elif silent:
        text = (
            f"{missed}, but as well without the fluid, which what was added switches off: that "
            "explains nothing, and the records hold no signal that a law could be told from."
        )
    elif not structured and error > STRUCTURE * expected:
        text = (
            f"{missed}, no more than finite steps, rates known only at the samples and rounded "
            f"numbers leave ({percent_of(resolution)}). These data show no smaller effect."
        )
    elif not structured:
        text = f"{missed}, as {causes} ({percent_of(expected)})."
        if left.probability is None:
            text += " There are too few samples to look for a pattern in what is left."
        elif left.probability <= SIGNIFICANCE and plain:
            text += f" It has {left.pattern}, but one no larger than that."
    elif mistaken:
        text = (
            f"{missed}, as {causes} ({percent_of(expected)}), but {' and '.join(not_from_rest)} "
            "cannot have started from rest, as is assumed: what came before looks like an effect. "
            "Say in runs.csv what it was (start, step_strain, rate_before), or give the record "
            "from rest on."
        )
    elif pattern:
        text = (
            f"{missed}{like_noise or f', as {causes} ({percent_of(expected)})'}, but the runs held "
            f"out by {percent_of(missed_held_out)}, and what is left of them has a pattern that "
            "neither noise nor an uncertain constant leaves. Some effect is still missing, or has "
            "another form."
        )
    elif explained:
        text = (
            f"{missed}{like_noise or f' ({percent_of(expected)} of it is what {causes})'}, but the "
            f"runs held out by {percent_of(missed_held_out)}: what was found does not carry over "
            f"to them, most of all not to {worst.name}. Some effect is still missing, or has "
            "another form."
        )
    elif silence == "fluid":
        text = (
            f"{missed} ({percent_of(expected)} of it is what {causes}), and as well without the "
            "fluid: what was found explains nothing, and something else is in the records."
        )
    elif error > STRUCTURE * expected and left.probability is None and expectation.noise is None:
        text = (
            f"{missed}, more than changes from sample to sample ({percent_of(expected)}), but so "
            "few samples hardly tell noise from a missing effect."
        )
    elif error > STRUCTURE * expected:
        text = (
            f"{missed}, more than {causes} ({percent_of(expected)}); the worst run is {worst.name}."
            " Some effect is still missing."
        )
    else:
        text = (
            f"{missed}, hardly more than {causes} ({percent_of(expected)}), but what is left has "
            f"{left.pattern}; the worst run is {worst.name}. Some effect is still missing."
        )
    if left.outliers:
        text += f" Besides those left out before the fit, {left.outliers} samples are outliers."
    if short:
        text += f" Runs of fewer samples do not judge: {', '.join(short)}."
    # what does not explain the fitted runs has nothing to carry over
    carries_over = carries_over or not explained
    return Judgement(
        verdict, structured, left, resolution, known, carries_over, short, worst, text,
        missed_held_out / asked_of_held_out if asked_of_held_out > 0.0 else 0.0,
        sum(record.held_out for record in records),
    )  # fmt: skip


def _refuted_by(tolerated: ToleratedMisfit, fit: Fit, unseen: Unseen, together: bool) -> bool:
    """Return whether runs that no fit saw say that something is missing.

    The fitted ones have a voice too where noise explains them, and not arithmetic alone.
    """
    weight = tolerated.weight if together else tolerated.weight[:0]
    seen = [w > 0 for w in weight]
    rows = [r[s] / w[s] for r, w, s in zip(fit.residual, weight, seen, strict=False)]
    records = [r[s] for r, s in zip(tolerated.records, seen, strict=False)]
    return refutes(unseen, rows, records, tolerated.expectation)


def _error(records: Sequence[RunRecord]) -> float:
    """Return the mean error of the final model over the runs that judge; 0 of none."""
    told = [record for record in records if len(record.time) >= FEWEST_FAST]
    return float(np.mean([record.errors[-1] for record in told or records] or [0.0]))
