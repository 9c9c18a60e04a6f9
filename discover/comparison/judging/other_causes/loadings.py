"""Runs that are loadings of their own: the factors on their records, by each law that was found.

Learners integrate the factors out (`discover.forward.along_record`), so that these are no constants
of any law. Of what a law predicts the likeliest factor of each run follows at once. Fitted runs are
then judged and shown without it. A run held out tells its own, for which the verdict allows; its
error and its picture do not, and its bands are wider by what loadings differ by.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from discover.comparison.fitting.prepared import with_each_run
from discover.comparison.instrument import Frame
from discover.comparison.instrument.corrected import InRecord
from discover.comparison.judging.as_predicted import SPARSE
from discover.comparison.judging.explanation import Explanation
from discover.comparison.judging.moved_law import MovedLaw
from discover.comparison.judging.refutation import Refutation
from discover.comparison.outcomes.flows import Flow
from discover.comparison.outcomes.outcome import LearnerOutcome, Limits
from discover.dataset import Run
from discover.identify.rivals.bands import PredictionBand
from discover.statistics import HALF_BAND
from discover.statistics.noise.independent_samples import independent_samples
from discover.statistics.reading.loadings import ADVICE, LoadingFound, as_too_far, too_far
from discover.study.data import StudyData


@dataclass(frozen=True)
class OwnLoadings:
    """The factors on the records, by learner.

    Attributes
    ----------
    deviation
        Standard deviation by which loadings are said to differ.
    found
        By learner; of one that runs away in a run none.
    leading
        The learner by whose factors the records are corrected: sparse regression, if it is there.
    """

    deviation: float
    found: Mapping[str, Sequence[LoadingFound]]
    leading: str

    @classmethod
    def of(
        cls,
        outcomes: Mapping[str, LearnerOutcome],
        flows: Sequence[Flow],
        deviation: float,
        law: MovedLaw | None,
    ) -> "OwnLoadings":
        """Return the factors by laws that were found.

        Parameters
        ----------
        outcomes
            By learner, with predictions of the records.
        flows
            Of which those that were measured, or computed in their place, have a factor.
        deviation
            Standard deviation by which loadings are said to differ.
        law
            The sparse law, whose covariance goes into the intervals; None for none.
        """
        runs = [flow for flow in flows if flow.kind in ("training", "held_out")]
        found = {}
        for name, outcome in outcomes.items():
            own = law if name == SPARSE else None
            told = [_factor(outcome, flow, deviation, own) for flow in runs]
            found[name] = [one for one in told if one is not None]
        return cls(deviation, found, SPARSE if SPARSE in found else next(iter(found)))

    def without_intervals(self) -> "OwnLoadings":
        """Return the factors beside laws that explain nothing: of these no interval is claimed."""
        found = {
            name: [replace(one, ci95=None) for one in told] for name, told in self.found.items()
        }
        return replace(self, found=found)

    def to_json(self) -> dict[str, Any]:
        """Return the factors as ``comparison.json`` holds them."""
        return {
            "deviation": self.deviation,
            "factors": {
                name: {
                    one.run: {"factor": one.factor, "ci95": one.ci95, "held_out": one.held_out}
                    for one in found
                }
                for name, found in self.found.items()
            },
        }

    def factor(self, learner: str, run: str) -> float:
        """Return the factor on the record of a run by a learner's law."""
        return next((one.factor for one in self.found[learner] if one.run == run), 1.0)

    def taken_out(self, data: StudyData) -> StudyData:
        """Return data whose records are those of the leading law's factors of one."""

        def corrected(run: Run) -> Run:
            factor = self.factor(self.leading, run.name)
            columns = {
                column: values / factor
                for column in _RECORDS
                if (values := getattr(run, column)) is not None
            }
            return replace(run, **columns)

        return with_each_run(data, corrected)

    def frame(self, learner: str, frame: Frame) -> Frame:
        """Return where a learner worked, with its own factors over those taken out."""
        if learner == self.leading:
            return frame
        made = dict(frame.made)
        for flow in frame.flows:
            gain = self._beside(learner, flow)
            if gain != 1.0:
                none = InRecord(np.ones(len(flow.times)), np.zeros(len(flow.times)))
                own = made.get(flow.name, none)
                made[flow.name] = InRecord(gain * own.gain, gain * own.offset)
        return replace(frame, made=made)

    def _beside(self, learner: str, flow: Flow) -> float:
        return self.factor(learner, flow.name) / self.factor(self.leading, flow.name)

    def held_against(self, explanation: Explanation) -> Explanation:
        """Return what explains the runs by factors no larger than loadings differ by."""
        found = dict(explanation.lack_of_fit)
        for name in explanation.by:
            worst = too_far(self.found.get(name, ()))
            if worst is not None:
                reason = f"the {as_too_far(worst, self.deviation, 'the law')}"
                found[name] = Refutation(reason, ADVICE).of(found[name])
        return replace(explanation, lack_of_fit=found)

    def as_recorded(
        self, outcomes: Mapping[str, LearnerOutcome], flows: Iterable[Flow]
    ) -> dict[str, LearnerOutcome]:
        """Return outcomes whose predictions of runs held out are those without their factors.

        Parameters
        ----------
        outcomes
            By learner, as they were judged.
        flows
            In which they were.
        """
        unseen = [flow for flow in flows if flow.kind == "held_out"]
        found = {}
        for name, outcome in outcomes.items():
            predictions, bands = dict(outcome.predictions), dict(outcome.bands)
            for flow in unseen:
                gain = self._beside(name, flow)
                told, limits = predictions.get(flow.key), bands.get(flow.key)
                if told is None:
                    continue
                predictions[flow.key] = {**told, "sigma12": told["sigma12"] / gain}
                if limits is not None:
                    own = limits["sigma12"][0] / gain, limits["sigma12"][1] / gain
                    held: Limits = {**limits, "sigma12": self._wider(*own)}
                    bands[flow.key] = held
            found[name] = replace(outcome, predictions=predictions, bands=bands)
        return found

    def bands_of_records(
        self, bands: Mapping[str, PredictionBand], flows: Iterable[Flow]
    ) -> dict[str, PredictionBand]:
        """Return bands, those of runs held out wider by what loadings differ by."""
        found = dict(bands)
        for flow in flows:
            band = bands.get(flow.key)
            if flow.kind != "held_out" or band is None:
                continue
            low, high = band.low.copy(), band.high.copy()
            rivals_low, rivals_high = band.rivals_low.copy(), band.rivals_high.copy()
            low[:, 0], high[:, 0] = self._wider(low[:, 0], high[:, 0])
            ends = self._wider(rivals_low[:, 0], rivals_high[:, 0])
            rivals_low[:, 0], rivals_high[:, 0] = ends
            found[flow.key] = replace(
                band, low=low, high=high, rivals_low=rivals_low, rivals_high=rivals_high
            )
        return found

    def _wider(
        self, low: Float[np.ndarray, " n"], high: Float[np.ndarray, " n"]
    ) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
        middle = 0.5 * (low + high)
        half = np.hypot(0.5 * (high - low), HALF_BAND * self.deviation * middle)
        return middle - half, middle + half


_RECORDS = (
    "stress",
    "first_normal_stress_difference",
    "second_normal_stress_difference",
    "storage_modulus",
    "loss_modulus",
)


def _factor(
    outcome: LearnerOutcome, flow: Flow, deviation: float, law: MovedLaw | None
) -> LoadingFound | None:
    """Return the factor on the record of a run by a law; None where that runs away."""
    prediction = outcome.predictions.get(flow.key)
    record = flow.measured if flow.kind == "training" else flow.reference.get("sigma12")
    if prediction is None or record is None or not np.all(np.isfinite(prediction["sigma12"])):
        return None
    even = flow.even(np.asarray(record, dtype=float))
    told, seen = even * prediction["sigma12"], even * np.asarray(record, dtype=float)
    size = float(told @ told)
    if size == 0.0:
        return None
    best = float(seen @ told) / size - 1.0
    left = seen - (1.0 + best) * told
    by_noise = float(left @ left) / max(independent_samples(left), 1.0) / size
    by_law = _by_law(outcome, flow, told / even, even, law)
    prior = deviation**2
    shrunk = prior / (prior + by_noise)
    far = np.sqrt(prior + by_noise + ((by_law or 0.0) if flow.kind == "held_out" else 0.0))
    factor, ci95 = 1.0 + shrunk * best, None
    if by_law is not None:
        half = HALF_BAND * float(np.sqrt(shrunk * by_noise + shrunk**2 * by_law))
        ci95 = factor - half, factor + half
    return LoadingFound(flow.name, flow.kind == "held_out", factor, ci95, float(abs(best) / far))


def _by_law(
    outcome: LearnerOutcome,
    flow: Flow,
    predicted: Float[np.ndarray, " n"],
    even: Float[np.ndarray, " n"],
    law: MovedLaw | None,
) -> float | None:
    """Return the variance of a factor by that of the law's constants; None if not known."""
    covariance = outcome.details.get("covariance")
    if law is None or covariance is None or law.names:
        return None
    slopes = law.derivatives(flow)
    covariance = np.asarray(covariance, dtype=float)
    if slopes is None or covariance.shape != (len(slopes[1]), len(slopes[1])):
        return None
    told = even * predicted
    along = -(slopes[1][:, :, 0] * even) @ told / float(told @ told)
    return max(float(along @ covariance @ along), 0.0)
