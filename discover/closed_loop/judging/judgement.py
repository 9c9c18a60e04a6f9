"""The verdict: does what was found explain the fitted runs, and does it carry over to others."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from discover.closed_loop.judging.fitted_runs import what_fitted_runs_say
from discover.closed_loop.judging.held_out import HeldOut
from discover.closed_loop.judging.reasons import Grounds, reasons
from discover.closed_loop.judging.silence import Silence
from discover.closed_loop.judging.tolerated_misfit import ToleratedMisfit
from discover.closed_loop.judging.unseen_runs import what_unseen_runs_say
from discover.closed_loop.results.run_record import RunRecord
from discover.closed_loop.results.stages import Verdict
from discover.inference.least_squares import Fit
from discover.statistics.lack_of_fit import LackOfFit
from discover.statistics.residual import FEWEST_FAST


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
    read_as
        Where records follow the model clearly better if they were read otherwise: how, as a clause.
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
    read_as: str = ""

    @property
    def explains(self) -> bool:
        """Whether the model explains the runs, with effects or without any."""
        return self.verdict in ("effects_added", "no_effect_needed")

    def refuted(self, description: str, reason: str = "", advice: str = "") -> "Judgement":
        """Return the judgement on a model that something speaks against.

        Parameters
        ----------
        description
            The reasons, in sentences.
        reason, advice
            As in `LackOfFit.refuted`; by default the reason stays.
        """
        left = self.left.refuted(reason or self.left.reason, advice)
        return replace(
            self, verdict="unexplained", structured=True, left=left, description=description
        )


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
    fitted = what_fitted_runs_say(tolerated, fit, active)
    unseen = what_unseen_runs_say(tolerated, fitted, fit, active, records, held)
    explains = fitted.noise_known_or_small and fitted.explained
    structured = not (explains and unseen.carries_over)
    mistaken = not_from_rest if active and not structured else ()
    structured |= bool(mistaken)
    silent = silence == "records" or (explains and (silence is not None or fitted.nothing))
    structured &= not silent
    short = [r.name for r in records if fitted.noise_known and len(r.time) < FEWEST_FAST]
    worst = max(records, key=lambda record: record.errors[-1])
    text = reasons(
        Grounds(
            fitted, unseen, tolerated.expectation, structured, silent, silence, mistaken, short,
            worst.name,
        )
    )  # fmt: skip
    left = fitted.left
    if fitted.explained and not unseen.carries_over:
        left = left.refuted(left.reason)
    return Judgement(
        _verdict(structured, silent, active),
        structured,
        left,
        fitted.resolution,
        fitted.noise_known_or_small,
        # what does not explain the fitted runs has nothing to carry over
        unseen.carries_over or not fitted.explained,
        tuple(short),
        worst,
        text,
        unseen.error / unseen.asked if unseen.asked > 0.0 else 0.0,
        sum(record.held_out for record in records),
    )


def _verdict(structured: bool, silent: bool, active: Sequence[str]) -> Verdict:
    if silent:
        return "no_signal"
    if structured:
        return "unexplained"
    return "effects_added" if active else "no_effect_needed"
