"""Does a law explain the runs that it was learned from? The loop's question, asked of learners."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from discover.comparison.fitting.sampled_rates import coarse_rates_of
from discover.comparison.judging.identifiability import SEPARATED
from discover.comparison.outcomes.flows import QUANTITIES, Flow
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.dataset.records.repeats import Repeats
from discover.learners.registry import BANDS_ONLY
from discover.learners.results.recovered_term import RecoveredTerm
from discover.learners.settings import ARITHMETIC
from discover.protocols.between_samples import sampling_interval
from discover.protocols.kinematics import FOLLOWED
from discover.statistics import FitVerdict, LackOfFit, lack_of_fit
from discover.statistics.residual import STRUCTURE, Expectation

_NONE = 1e-3
"""Coefficient of I, of the modulus, up to which arithmetic and rates between samples make one."""

_RESTLESS = (
    "the law builds up stress without any flow, which no fluid does that these runs, from rest, "
    "were measured on"
)


@dataclass(frozen=True)
class Explanation:
    """Whether any law explains the training runs, and what each leaves of them.

    Attributes
    ----------
    lack_of_fit
        By learner.
    outliers
        By learner that explains the training runs, and by the key of a run held out: samples that
        do not judge it. Only runs that have some.
    expectation
        What a complete law may leave: the noise, where it was told, and the sweep's own error.
    repeats
        Runs that repeat one another; None where none does.
    """

    lack_of_fit: Mapping[str, LackOfFit] = field(default_factory=dict)
    outliers: Mapping[str, Mapping[str, tuple[int, ...]]] = field(default_factory=dict)
    expectation: Expectation = field(default_factory=Expectation)
    repeats: Repeats | None = None

    @property
    def noise_given(self) -> bool:
        """Whether the study tells the noise."""
        return self.expectation.noise is not None

    @property
    def sweep_error(self) -> float:
        """Relative error with which the modes describe the sweep that they come from."""
        return self.expectation.linear_error

    @property
    def verdict(self) -> FitVerdict:
        """``"explained"`` if one learner's law leaves noise; ``"no_signal"`` if one finds none."""
        found = {one.verdict for one in self.lack_of_fit.values()}
        if "explained" in found:
            return "explained"
        return "no_signal" if "no_signal" in found else "unexplained"

    @property
    def by(self) -> tuple[str, ...]:
        """Learners whose law explains the runs."""
        return tuple(n for n, one in self.lack_of_fit.items() if one.verdict == "explained")

    @property
    def in_library(self) -> bool:
        """Whether a law of the library explains the runs: the sparse learner's does."""
        return "tensor_sindy" in self.by

    def to_json(self) -> dict[str, Any]:
        """Return verdict and lack of fit as ``comparison.json`` holds them."""
        return {
            "verdict": self.verdict,
            "noise_from": {
                "given": self.expectation.noise,
                "sweep": self.sweep_error,
                "repeats": None if self.repeats is None else self.repeats.error,
                "repeated": [] if self.repeats is None else self.repeats.groups,
            },
            "lack_of_fit": {
                name: {
                    "misfit": one.misfit,
                    "noise": one.noise,
                    "lag_one_correlation": one.lag_one_correlation,
                    "probability": one.probability,
                    "verdict": one.verdict,
                    "outliers": one.outliers,
                    "reason": one.reason,
                    "likeness": one.likeness or one.advice,
                }
                for name, one in self.lack_of_fit.items()
            },
        }


def explain(
    outcomes: Mapping[str, LearnerOutcome],
    flows: Iterable[Flow],
    expectation: Expectation,
    normal_stresses_used: bool = False,
    repeats: Repeats | None = None,
) -> Explanation:
    """Return whether what each learner's law leaves of the training runs is noise.

    Parameters
    ----------
    outcomes
        By learner. One that fits nearly any σ12 explains nothing, and is left out unless it is
        alone.
    flows
        The flows; only those of training are looked at.
    expectation
        What a complete law may leave.
    normal_stresses_used
        Whether measured normal stresses were part of the fit.
    repeats
        Runs that repeat one another, whose error the expectation holds.
    """
    training = [flow for flow in flows if flow.kind == "training"]
    return Explanation(
        {
            name: what_it_leaves(outcome, training, expectation, normal_stresses_used)
            for name, outcome in outcomes.items()
            if name not in BANDS_ONLY or len(outcomes) == 1
        },
        expectation=expectation,
        repeats=repeats,
    )


def what_it_leaves(
    outcome: LearnerOutcome,
    training: Sequence[Flow],
    expectation: Expectation,
    normal_stresses_used: bool,
) -> LackOfFit:
    """Return what one learner's law leaves of the training runs; parameters as in `explain`."""
    residuals, records, rates, even, intervals = [], [], [], [], []
    for flow in training:
        prediction = outcome.predictions[flow.key]
        for quantity in QUANTITIES if normal_stresses_used else QUANTITIES[:1]:
            record = flow.reference.get(quantity) if quantity != "sigma12" else flow.measured
            if record is None or not np.any(record):
                continue
            if prediction is None or not np.all(np.isfinite(prediction[quantity])):
                nan = float("nan")
                reason = f"the law runs away in {flow.name}, a run that it was learned from"
                return LackOfFit("unexplained", nan, nan, nan, None, reason=reason)
            record = np.asarray(record, dtype=float)
            residuals.append(prediction[quantity] - record)
            records.append(record)
            even.append(flow.even(record))
            rates.append(np.asarray(flow.rate, dtype=float))
            intervals.append(sampling_interval(flow.times, flow.protocol, quantity))
    # moduli that are constant are those of a linear fluid, and of no dead sensor
    imposed = rates if all(flow.protocol.control in FOLLOWED for flow in training) else None
    found = lack_of_fit(residuals, records, expectation, imposed, even, intervals)
    if found.verdict == "unexplained" and found.misfit <= least_seen(outcome):
        reason = f"what is left ({100 * found.misfit:.1g} %) is arithmetic"
        return replace(found, verdict="explained", reason=reason, rest="is arithmetic")
    coarse = coarse_rates_of(outcome)
    if found.verdict == "explained" and coarse is not None and coarse.hides:
        reason = "what the rate did between its samples hides as much"
        return replace(found, verdict="unexplained", reason=reason)
    if found.verdict == "explained" and not _rests(outcome) and any(map(_from_rest, training)):
        return found.refuted(_RESTLESS)
    return found


def least_seen(outcome: LearnerOutcome) -> float:
    """Return the relative size up to which a misfit is arithmetic."""
    return max(ARITHMETIC, STRUCTURE * outcome.resolution)


def _rests(outcome: LearnerOutcome) -> bool:
    """Return whether a law leaves a fluid without flow and stress as it is.

    Of all terms only I alone is there at rest. With it σ + c I is the stress of a law of another
    modulus, so that it takes the start from rest for one from a strained state.
    """
    return not any(t.term == "I" and _there(t) for t in outcome.terms)


def _there(term: RecoveredTerm) -> bool:
    """Return whether a term is more than its interval, or arithmetic, leaves of none."""
    size = abs(term.coefficient)
    return size > SEPARATED or (size > _NONE and term.is_told_from_zero)


def _from_rest(flow: Flow) -> bool:
    """Return whether a run starts from rest, and not from a state that it has long been in."""
    protocol = flow.protocol
    went_on = float(protocol.begins) < 0.0 or float(protocol.cycle[0]) != float(protocol.cycle[1])
    return not (flow.is_of_states or went_on)
