"""The reasons of a verdict, in sentences."""

from collections.abc import Sequence
from dataclasses import dataclass

from discover.closed_loop.judging.fitted_runs import FittedRuns
from discover.closed_loop.judging.silence import Silence
from discover.closed_loop.judging.unseen_runs import UnseenRuns
from discover.statistics.noise.whiteness import SIGNIFICANCE
from discover.statistics.residual import FEWEST_FAST, STRUCTURE, Expectation
from discover.words import percent_of

_MISSING = "Some effect is still missing"


@dataclass(frozen=True)
class Grounds:
    """What a verdict rests on.

    Attributes
    ----------
    fitted, unseen
        What the fitted runs say, and those that no fit saw.
    expectation
        Noise, and the error of the linear data.
    structured
        Whether something is left that nothing explains.
    silent, silence
        Whether the records hold no signal, and what is silent, if anything is.
    not_from_rest
        Runs that cannot have started from rest, where that forbids to believe the effects found.
    short
        Names of runs with too few samples to judge by.
    worst
        Name of the run that is missed most.
    """

    fitted: FittedRuns
    unseen: UnseenRuns
    expectation: Expectation
    structured: bool
    silent: bool
    silence: Silence | None
    not_from_rest: Sequence[str]
    short: Sequence[str]
    worst: str


def reasons(grounds: Grounds) -> str:
    """Return the reasons of a verdict, in sentences."""
    return _Sentences(grounds).all()


class _Sentences:
    def __init__(self, grounds: Grounds):
        self._grounds = grounds
        left, short = grounds.fitted.left, grounds.short
        self._linear = grounds.expectation.linear_error > 0.0
        self._causes = (
            "noise and the error of the linear data explain" if self._linear else "noise explains"
        )
        which = f"The fitted runs of {FEWEST_FAST} samples or more" if short else "The fitted runs"
        self._missed = f"{which} are missed by {percent_of(left.misfit)}"
        self._expected = percent_of(left.expected)

    def all(self) -> str:
        """Return the reasons, with what was not counted."""
        grounds, text = self._grounds, self._main()
        left = grounds.fitted.left
        if left.likeness and grounds.structured and not grounds.fitted.explained:
            text = text.removesuffix(f" {_MISSING}.")
            text += (
                f" {_MISSING}, or a fault of the instrument that no effect describes: "
                f"{left.likeness}."
            )
        if left.outliers:
            text += f" Besides those left out before the fit, {left.outliers} samples are outliers."
        if grounds.short:
            text += f" Runs of fewer samples do not judge: {', '.join(grounds.short)}."
        return text

    def _main(self) -> str:
        grounds = self._grounds
        if grounds.silence == "records":
            return (
                "The records are noise about a constant, whatever rate was imposed: they hold no "
                "signal that a law could be told from."
            )
        if not grounds.fitted.noise_known_or_small:
            return (
                f"{self._missed}, and no run has enough samples to tell noise from a missing "
                "effect. Sample more often, or give the noise ([loop] noise)."
            )
        if grounds.silent:
            return self._of_no_signal()
        if not grounds.structured:
            return self._of_what_explains()
        if grounds.not_from_rest:
            return (
                f"{self._missed}, as {self._causes} ({self._expected}), but "
                f"{' and '.join(grounds.not_from_rest)} cannot have started from rest, as is "
                "assumed: what came before looks like an effect. Say in runs.csv what it was "
                "(start, step_strain, rate_before), or give the record from rest on."
            )
        if grounds.fitted.explained:
            return self._of_what_does_not_carry_over()
        return self._of_what_is_left()

    def _of_no_signal(self) -> str:
        if self._grounds.fitted.nothing:
            return (
                f"{self._missed}, and {self._causes} that: the records hold hardly anything else."
            )
        return (
            f"{self._missed}, but as well without the fluid, which what was added switches off: "
            "that explains nothing, and the records hold no signal that a law could be told from."
        )

    def _of_what_explains(self) -> str:
        fitted = self._grounds.fitted
        left = fitted.left
        if left.misfit > STRUCTURE * left.expected:
            return (
                f"{self._missed}, no more than finite steps, rates known only at the samples and "
                f"rounded numbers leave ({percent_of(fitted.resolution)}). These data show no "
                "smaller effect."
            )
        text = f"{self._missed}, as {self._causes} ({self._expected})."
        if left.probability is None:
            return f"{text} There are too few samples to look for a pattern in what is left."
        if left.probability <= SIGNIFICANCE and fitted.like_noise:
            return f"{text} It has {left.pattern}, but one no larger than that."
        return text

    def _of_what_does_not_carry_over(self) -> str:
        grounds = self._grounds
        left, missed_unseen = grounds.fitted.left.refuted(""), percent_of(grounds.unseen.error)
        like_noise = ""
        if STRUCTURE * left.noise < left.expected and not self._linear:
            like_noise = (
                f", which would pass for correlated noise ({percent_of(left.noise)} changes from "
                "sample to sample)"
            )
        if grounds.unseen.pattern:
            return (
                f"{self._missed}{like_noise or f', as {self._causes} ({self._expected})'}, but the "
                f"runs held out by {missed_unseen}, and what is left of them has a pattern that "
                "neither noise nor an uncertain constant leaves. Some effect is still missing, or "
                "has another form."
            )
        as_noise = like_noise or f" ({self._expected} of it is what {self._causes})"
        return (
            f"{self._missed}{as_noise}, but the runs held out by {missed_unseen}: what was found "
            f"does not carry over to them, most of all not to {grounds.worst}. Some effect is "
            "still missing, or has another form."
        )

    def _of_what_is_left(self) -> str:
        grounds, left = self._grounds, self._grounds.fitted.left
        larger = left.misfit > STRUCTURE * left.expected
        if grounds.silence == "fluid":
            return (
                f"{self._missed} ({self._expected} of it is what {self._causes}), and as well "
                "without the fluid: what was found explains nothing, and something else is in the "
                "records."
            )
        if larger and left.probability is None and grounds.expectation.noise is None:
            return (
                f"{self._missed}, more than changes from sample to sample ({self._expected}), but "
                "so few samples hardly tell noise from a missing effect."
            )
        if larger:
            return (
                f"{self._missed}, more than {self._causes} ({self._expected}); the worst run is "
                f"{grounds.worst}. Some effect is still missing."
            )
        return (
            f"{self._missed}, hardly more than {self._causes} ({self._expected}), but what is left "
            f"has {left.pattern}; the worst run is {grounds.worst}. Some effect is still missing."
        )
