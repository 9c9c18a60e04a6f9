"""A law that explains records only up to how each was read explains nothing yet.

Other fillings, temperatures, zeros and rates from run to run, a sample that dries, a range of the
transducer that reads otherwise than the next: constants of a law take up most of what they do, and
noise hides the rest from a test that asks for any pattern. So it is asked whether the records
follow the law better as if they had been read so (`discover.statistics.reading.misread`).
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from discover.comparison.judging.as_predicted import SPARSE, AsPredicted, runs_as_predicted
from discover.comparison.judging.explanation import Explanation, least_seen
from discover.comparison.judging.moved_law import MovedLaw
from discover.comparison.judging.other_causes.either_law import bands_of_either, intervals_of_either
from discover.comparison.judging.other_causes.further_mode import clear_further_mode
from discover.comparison.judging.other_causes.smaller_laws import hold_against_smaller_laws
from discover.comparison.judging.refutation import Refutation, hold_against
from discover.comparison.outcomes.flows import Flow, predict
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.identify.rivals.bands import PredictionBand
from discover.statistics import root_of
from discover.statistics.noise.outliers import stray
from discover.statistics.reading.beyond_sweep import ADVICE, REASON, beyond_the_sweep
from discover.statistics.reading.misread import (
    OF_MODES,
    POSSIBLE,
    Misread,
    advice,
    clear_misreading,
    misread,
    not_ruled_out,
    one_more_mode,
    reads,
)
from discover.statistics.reading.reading_faults import Reading
from discover.statistics.residual import Expectation
from discover.words import percent_of

_MODES_ASKED = 12


def hold_against_misreading(
    explanation: Explanation,
    outcomes: Mapping[str, LearnerOutcome],
    flows: Iterable[Flow],
    bands: Mapping[str, PredictionBand],
    law: MovedLaw | None = None,
) -> Explanation:
    """Return what explains the runs as well as if none of them had been read otherwise.

    Parameters
    ----------
    explanation
        What explains the runs, those held out among them.
    outcomes
        By learner, with predictions of the records.
    flows
        Of which those that were measured say something.
    bands
        Of the sparse law, by the key of the flow.
    law
        The sparse law, of whose modes it is asked whether their moduli are right; None for none.
    """
    flows = [flow for flow in flows if flow.is_record]

    def refutation_of(name: str) -> Refutation | None:
        own = law if name == SPARSE else None
        found = _described_better(explanation, name, outcomes[name], flows, bands, own)
        if found is not None:
            return as_misread(found)
        if own is None:
            return None
        beyond = _beyond_the_sweep(own, flows, explanation.expectation)
        return beyond or _with_one_more_mode(own, flows, explanation.expectation)

    held = hold_against(explanation, refutation_of)
    return hold_against_smaller_laws(held, outcomes, flows, law)


def _beyond_the_sweep(
    law: MovedLaw, flows: Sequence[Flow], expectation: Expectation
) -> Refutation | None:
    """Return what refutes a law that only the sweep's error excuses, of what that cannot change."""
    spectrum = law.declared.spectrum
    if spectrum is None or law.terms.inner:
        return None
    fitted = readings_of(law, [flow for flow in flows if flow.kind == "training"])
    every = readings_of(law, flows) if len(fitted) < len(flows) else []
    asked = [beyond_the_sweep(runs, expectation, spectrum.pattern) for runs in (fitted, every)]
    beyond = next((one for one in asked if one is not None), None)
    return None if beyond is None else Refutation(REASON.format(percent_of(beyond.misfit)), ADVICE)


def _with_one_more_mode(
    law: MovedLaw, flows: Sequence[Flow], expectation: Expectation
) -> Refutation | None:
    """Return what refutes a law that a further relaxation mode makes describe the runs better."""
    fitted = [flow for flow in flows if flow.kind == "training"]
    found = clear_further_mode(law, fitted, expectation)
    if found is None:
        return None
    how = one_more_mode(found.time, found.share)
    return Refutation(f"the records follow the law clearly better {how}", OF_MODES)


def as_misread(found: Misread) -> Refutation:
    """Return what refutes a law that describes the records clearly better as read otherwise."""
    advised = advice(found)
    if found.kind == "factor":
        advised += ", or let each run be a loading of its own ([compare] loading)"
    return Refutation(f"the records follow the law clearly better {reads(found)}", advised)


def _described_better(
    explanation: Explanation,
    name: str,
    outcome: LearnerOutcome,
    flows: Sequence[Flow],
    bands: Mapping[str, PredictionBand],
    law: MovedLaw | None,
) -> Misread | None:
    """Return how else the records were read if a law describes them clearly better so."""
    flows = sorted(flows, key=lambda flow: flow.kind != "training")
    # directions of a band hold errors of the moduli too, which here are no free constants
    runs = [] if law is None or law.terms.inner else readings_of(law, flows)
    if not runs:
        told = runs_as_predicted(explanation, name, outcome, flows, bands)
        runs = [_reading(run, law) for run in told]
    if law is not None:
        runs = with_further_modes(runs, law, flows)
    fitted = sum(flow.kind == "training" for flow in flows)
    sets = [runs[:fitted], runs] if fitted < len(runs) else [runs]
    return clear_misreading(sets, explanation.expectation, least_seen(outcome))


def holding_misreading(
    outcomes: Mapping[str, LearnerOutcome],
    bands: Mapping[str, PredictionBand],
    chosen: LearnerOutcome,
    law: MovedLaw,
    flows: Sequence[Flow],
    fitted: Sequence[Reading],
    expectation: Expectation,
) -> tuple[dict[str, LearnerOutcome], dict[str, PredictionBand], tuple[str, ...]]:
    """Return outcomes and bands that hold another reading of the runs too, and what is to be known.

    Of the fitted runs, to first order; where they leave no such reading possible, as it is.

    Parameters
    ----------
    outcomes
        By learner, of which the sparse law's intervals may get wider.
    bands
        Of its law, by the key of the flow.
    chosen
        What the sparse learner found, which explains the runs.
    law
        The same law, with the constants that were fitted along.
    flows
        In which it is simulated.
    fitted
        The fitted runs as it predicts them.
    expectation
        What a complete law may leave.
    """
    as_it_is = dict(outcomes), dict(bands), ()
    if expectation.noise is not None:
        return as_it_is
    found = misread(fitted)
    if found is None or found.probability > POSSIBLE or not len(found.steps):
        return as_it_is
    if found.size <= least_seen(chosen):
        return as_it_is
    if found.excused(expectation) or not np.all(np.isfinite(found.steps)):
        return as_it_is
    values = law.start + found.steps
    fluid = law.fluid(values)
    predictions = {flow.key: predict(fluid, flow) for flow in flows if flow.key in bands}
    wider = intervals_of_either(outcomes, values[len(law.names) :])
    return wider, bands_of_either(bands, predictions), (not_ruled_out(found),)


def readings_of(law: MovedLaw, flows: Sequence[Flow]) -> list[Reading]:
    """Return runs as a law predicts them, one column for each of its constants.

    None where it does not follow them all.
    """
    told = [_of_law(law, flow) for flow in flows]
    runs = [run for run in told if run is not None]
    return runs if len(runs) == len(told) else []


def with_further_modes(
    runs: Sequence[Reading], law: MovedLaw, flows: Sequence[Flow]
) -> list[Reading]:
    """Return readings that may also be asked whether the spectrum lacks a mode.

    One of a time between half the shortest interval of the samples and twice the longest run.

    Parameters
    ----------
    runs
        Readings of the flows, in their order.
    law
        The law of every mode.
    flows
        Where one is not at a given rate, nothing is asked.
    """
    if len(runs) != len(flows) or any(flow.protocol.control != "rate" for flow in flows):
        return list(runs)
    shortest = min(float(np.min(np.diff(flow.times))) for flow in flows)
    times = np.geomspace(0.5 * shortest, 2.0 * max(flow.times[-1] for flow in flows), _MODES_ASKED)
    found = []
    for run, flow in zip(runs, flows, strict=True):
        told = law.of_further_modes(flow, times)
        if told is None or len(told[0]) != len(flow.times):
            return list(runs)
        kept = np.isin(np.asarray(flow.times, dtype=float), run.times)
        found.append(replace(run, further=(told[:, kept], times)))
    return found


def _of_law(law: MovedLaw, flow: Flow) -> Reading | None:
    """Return a run as a law predicts it, one column for each constant; None if not."""
    told = law.derivatives(flow)
    measured = flow.measured if flow.kind == "training" else flow.reference.get("sigma12")
    if told is None or measured is None:
        return None
    predicted, slopes = told
    record = np.asarray(measured, dtype=float)
    residual, even = predicted[:, 0] - record, flow.even(record)
    kept = ~stray(even * residual, even * record)
    times = np.asarray(flow.times, dtype=float)
    rows = (times[kept], predicted[kept, 0], residual[kept], slopes[:, kept, 0], even[kept])
    return _reading(AsPredicted(flow, *rows, np.flatnonzero(kept)), law)


def _reading(run: AsPredicted, law: MovedLaw | None) -> Reading:
    """Return a run for the question how it was read."""
    modes, shared = None, None
    errors = None if law is None else law.declared.modulus_covariance
    if law is not None and (errors is not None or len(law.declared.modulus) > 1):
        known, changes = law.declared, law.of_moduli(run.flow)
        if changes is not None:
            changes = changes[:, run.kept]
            modes = changes[: len(known.modulus)] if len(known.modulus) > 1 else None
        if changes is not None and errors is not None:
            both = np.append(known.modulus, known.solvent_viscosity)[: len(errors), None]
            shared = (root_of(errors) / both).T @ changes[: len(errors)]
    return Reading(
        np.asarray(run.times, dtype=float),
        run.predicted,
        run.residual,
        run.columns,
        run.even,
        control=run.flow.protocol.control,
        modes=modes,
        shared=shared,
    )
