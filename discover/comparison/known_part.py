"""Known part of a comparison: the declared law as fitted, records without the instrument."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import jax.numpy as jnp
import numpy as np

from discover.comparison.flows import (
    MEASURED,
    Flow,
    Stresses,
    comparison_flows,
    with_each_run,
)
from discover.comparison.outcome import LearnerOutcome
from discover.comparison.records import InRecord, absorbed, corrected
from discover.comparison.simulated import simulated
from discover.dataset import Run
from discover.effects import ConstitutiveEffect, KnownEffect
from discover.errors import InputError
from discover.laws.registry import make_law
from discover.loop.from_posterior import Ended
from discover.study.data import StudyData
from discover.study.declared_model import StudyModel

_INSIDE = 1e-3
"""Least share of its interval by which an instant is away from a sample."""


@dataclass(frozen=True)
class Frame:
    """What learners are given, and how what they find appears in the records.

    `made`: the instrument in the stress of a run, by its name.
    """

    model: StudyModel  # the known part, nothing of it left to be fitted
    data: StudyData  # the runs that they learn from, without what the instrument did
    flows: list[Flow]  # the flows in which their laws are simulated
    shown: list[Flow]  # the same flows with the records as they are
    made: Mapping[str, InRecord] = field(default_factory=dict)
    effects: tuple[KnownEffect, ...] = ()  # of the instrument, taken out of the records

    def recorded(self, flow: Flow, stresses: Stresses | None) -> Stresses | None:
        """Return what would be recorded of the stresses in a flow."""
        instrument = self.made.get(flow.name) if flow.kind in MEASURED else None
        if stresses is None or instrument is None:
            return stresses
        return {**stresses, "sigma12": instrument.recorded(stresses["sigma12"])}

    def outcome(self, own: LearnerOutcome) -> LearnerOutcome:
        """Return a learner's outcome with predictions of the records."""
        predictions, bands = dict(own.predictions), dict(own.bands)
        for flow in self.flows if self.made else ():
            predictions[flow.key] = self.recorded(flow, predictions[flow.key])
            limits = bands.get(flow.key)
            if limits is not None:
                low, high = (self.recorded(flow, {q: v[i] for q, v in limits.items()})
                             for i in (0, 1))  # fmt: skip
                assert low is not None
                assert high is not None
                bands[flow.key] = {q: (low[q], high[q]) for q in limits}
        return replace(own, predictions=predictions, bands=bands)

    def alone(self) -> dict[str, Stresses | None]:
        """Return what the known part alone predicts, by the key of the flow."""
        found = simulated(self.model.fluid, self.flows).predictions
        return {flow.key: self.recorded(flow, found[flow.key]) for flow in self.flows}


def known_part(
    declared: StudyModel,
    ended: Ended,
    data: StudyData,
    high_deborah: tuple[float, ...],
    pipkin: Sequence[tuple[float, float]],
) -> Frame:
    """Return the known part with constants and instrument of the likeliest hypothesis.

    What that holds of the instrument is taken out of the records where it can be undone. Raises
    InputError if learners cannot be given a declared effect.
    """
    data = _dated(ended, data)
    model = absorbed(_with_values(declared, ended))
    known = tuple(model.effects)
    found = known if ended.verdict != "effects_added" else (*known, *_found(ended))
    try:
        without, made = corrected(data, found)
    except InputError:  # what was found has a memory, or the runs are of another kind
        found = known
        without, made = corrected(data, known)
    model = replace(model, effects=())
    shown = comparison_flows(data, high_deborah, pipkin)
    if not made:
        return Frame(model, without, shown, shown, effects=found)
    commanded = {run.name: run.protocol for run in data.dataset}
    flows = [
        replace(flow, commanded=commanded[flow.name]) if flow.kind in MEASURED else flow
        for flow in comparison_flows(without, high_deborah, pipkin)
    ]
    return Frame(model, without, flows, shown, made, found)


def _with_values(declared: StudyModel, ended: Ended) -> StudyModel:
    """Return the declared model with numbers for what was to be fitted."""
    model, theta = ended.posterior.problem.model, ended.fit.theta
    parameters = dict(declared.parameters)
    for i, parameter in enumerate(model.declared.free_parameters):
        parameters[parameter.name] = float(theta[2 + i])
    free = [name for name in declared.free if name in parameters]
    modulus, relaxation_time = declared.modulus, declared.relaxation_time
    if "modulus_Pa" in declared.free:
        modulus = modulus * np.exp(theta[0])
    if "relaxation_time_s" in declared.free:
        relaxation_time = relaxation_time * np.exp(theta[1])
    effects = tuple(
        replace(known, values=tuple(map(float, theta[model.positions(known.name)])))
        if known.free
        else known
        for known in declared.effects
    )
    return replace(
        declared, law=make_law(declared.law_name, parameters) if free else declared.law,
        parameters=parameters, modulus=modulus, relaxation_time=relaxation_time, effects=effects,
        free=(),
    )  # fmt: skip


def _found(ended: Ended) -> list[KnownEffect]:
    """Return the effects of the instrument in the likeliest hypothesis, with their values."""
    problem = ended.posterior.problem
    return [
        KnownEffect(effect, tuple(map(float, ended.fit.theta[problem.model.positions(name)])))
        for name in ended.fit.names
        if not isinstance(effect := problem.effects[name], ConstitutiveEffect)
    ]


def _dated(ended: Ended, data: StudyData) -> StudyData:
    """Return data whose rates step when the posterior says."""
    problem = ended.posterior.problem
    theta, first = ended.theta_ahead(ended.fit), problem.model.instants.start
    runs = (*problem.fitted.runs, *(() if problem.predicted is None else problem.predicted.runs))
    steps = {run.source: run.rate_steps for run in runs if run.rate_steps}

    def dated(run: Run) -> Run:
        protocol = run.protocol
        knots, rates = np.asarray(protocol.table_times), np.asarray(protocol.table_rates)
        own = steps.get(run.source, ())
        for step in own:
            share = step.share if step.place is None else float(theta[first + step.place])
            instant = step.at(float(np.clip(share, _INSIDE, 1.0 - _INSIDE)))
            after = int(np.searchsorted(knots, instant))
            levels = rates[after - 1], rates[after]
            knots = np.insert(knots, after, [instant, instant])
            rates = np.insert(rates, after, levels)
        if not own:
            return run
        moved = replace(protocol, table_times=jnp.asarray(knots), table_rates=jnp.asarray(rates))
        return replace(run, protocol=moved, rate_steps=())

    return with_each_run(data, dated) if steps else data
