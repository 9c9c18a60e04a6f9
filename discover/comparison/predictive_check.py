"""Predictive check of a learner's law: whether what it leaves of the training runs is noise."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from discover.comparison.flows import QUANTITIES, Flow
from discover.comparison.outcome import LearnerOutcome
from discover.dataset.records.repeats import repeats_among
from discover.protocols.between_samples import sampling_interval
from discover.protocols.kinematics import FOLLOWED
from discover.statistics import LackOfFit, lack_of_fit
from discover.statistics.residual import Expectation
from discover.study.data import StudyData
from discover.study.declared_model import DeclaredModel
from discover.study.schema import Study


def expectation_of(study: Study, model: DeclaredModel, data: StudyData) -> Expectation:
    """Return what a complete law may leave of the runs: noise, the sweep's own error, repeats."""
    repeats, noise = repeats_among(list(data.dataset)), study.loop.noise
    linear_error = 0.0 if model.spectrum is None else model.spectrum.relative_error
    told = 0.0 if repeats is None or noise is not None else repeats.error
    return Expectation(noise, linear_error, told)


def lacks_of_fit(
    outcomes: Mapping[str, LearnerOutcome],
    flows: Iterable[Flow],
    expectation: Expectation,
    normal_stresses_used: bool = False,
) -> dict[str, LackOfFit]:
    """Return what each learner's law leaves of the training runs, and whether that is noise.

    `outcomes`: by learner. `flows`: the flows; only those of training are looked at. `expectation`:
    what a complete law may leave. `normal_stresses_used`: whether measured normal stresses were
    part of the fit.
    """
    training = [flow for flow in flows if flow.kind == "training"]
    return {
        name: _lack_of_fit(outcome, training, expectation, normal_stresses_used)
        for name, outcome in outcomes.items()
    }


def _lack_of_fit(
    outcome: LearnerOutcome,
    training: Sequence[Flow],
    expectation: Expectation,
    normal_stresses_used: bool,
) -> LackOfFit:
    residuals, records, rates, even, intervals = [], [], [], [], []
    for flow in training:
        prediction = outcome.predictions[flow.key]
        for quantity in QUANTITIES if normal_stresses_used else QUANTITIES[:1]:
            record = flow.reference.get(quantity) if quantity != "sigma12" else flow.measured
            if record is None or not np.any(record):
                continue
            if prediction is None or not np.all(np.isfinite(prediction[quantity])):
                nan = float("nan")
                reason = f"the law diverges in {flow.name}, a run that it was learned from"
                return LackOfFit("unexplained", nan, nan, nan, None, reason=reason)
            record = np.asarray(record, dtype=float)
            residuals.append(prediction[quantity] - record)
            records.append(record)
            even.append(flow.even(record))
            rates.append(np.asarray(flow.rate, dtype=float))
            intervals.append(sampling_interval(flow.times, flow.protocol, quantity))
    # moduli that are constant are those of a linear fluid, and of no dead sensor
    imposed = rates if all(flow.protocol.control in FOLLOWED for flow in training) else None
    return lack_of_fit(residuals, records, expectation, imposed, even, intervals)
