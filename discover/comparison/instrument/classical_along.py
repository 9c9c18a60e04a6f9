"""The classical laws with the constants that the learners have fitted along."""

from collections.abc import Sequence

import jax
import numpy as np

from discover.comparison.fitting.classical import (
    CLASSICAL,
    FLOOR,
    ClassicalFit,
    contender,
    parameter_of,
)
from discover.comparison.instrument.before_learning import CLASSICAL_EFFECTS
from discover.comparison.instrument.fitted_along import FittedAlong
from discover.comparison.instrument.frame import Frame
from discover.comparison.outcomes.flows import Flow, of_recorded, predict, relative_errors
from discover.identify.side_by_side.many_laws import fluid_of
from discover.laws.multimode import Fluid
from discover.laws.textbook.maxwell import UpperConvectedMaxwell
from discover.learners.tensor_sindy.selection import extended_bic


def classical_along(
    along: FittedAlong,
    frames: Sequence[Frame],
    flows: Sequence[Flow],
    independent: float | None,
) -> list[ClassicalFit]:
    """Return the classical laws, each with the constants that fit it best.

    The criterion leaves out the price of these constants, which every law pays alike.

    Parameters
    ----------
    along
        The constants.
    frames
        For each law of `CLASSICAL` what it is simulated in, as its constants have it.
    flows
        Those of the page; errors are told where no fit saw them.
    independent
        As in `fit_classical_laws`.
    """
    laws = []
    for name in CLASSICAL:
        fit = along.before.classical[name]
        value = None
        if name in CLASSICAL_EFFECTS:
            value = float(fit.theta[along.model.positions(CLASSICAL_EFFECTS[name])[0]])
        laws.append(contender(name, value, True))
    samples = sum(len(run) for run in along.runs)
    sizes = np.array([len(run) for run in along.runs])
    fits = []
    for i, (name, frame) in enumerate(zip(CLASSICAL, frames, strict=True)):
        model = frame.model
        base = Fluid(
            UpperConvectedMaxwell(),
            model.modulus,
            model.relaxation_time,
            float(model.solvent_viscosity),
        )
        # the terms of all laws, those of the others at zero: one program for all
        fluid = jax.tree.map(lambda leaf, i=i: leaf[i], fluid_of(laws, base))
        fit = along.before.classical[name]
        squares = np.sum(fit.residual**2, axis=1)
        misfit = float(np.sqrt(np.sum(sizes * squares) / samples))
        parameters = {}
        if name in CLASSICAL_EFFECTS:
            at = along.model.positions(CLASSICAL_EFFECTS[name])[0]
            parameters = {parameter_of(name): float(fit.theta[at])}
        errors = {}
        own_flows = {flow.key: flow for flow in frame.flows}
        for flow in flows:
            if flow.kind not in ("held_out", "test"):
                continue
            seen = frame.recorded(flow, predict(fluid, own_flows[flow.key]))
            errors[flow.name] = of_recorded(relative_errors(seen, flow.reference), flow)
        counted = independent or samples
        criterion = extended_bic(max(misfit, FLOOR), counted, len(parameters), 0, len(CLASSICAL))
        constants = {
            c: along.constants.value_of(c, raw) for c, raw in along.constants.raw(fit.theta).items()
        }
        fits.append(ClassicalFit(name, parameters, misfit, criterion, errors, constants))
    return fits
