"""Laws that a study asks for beside the classical ones, each fitted to the same runs."""

from collections.abc import Callable, Sequence

import numpy as np

from discover.comparison.fitting.classical import CLASSICAL, FLOOR, ClassicalFit
from discover.comparison.outcomes.flows import (
    Flow,
    Stresses,
    of_recorded,
    predict,
    relative_errors,
)
from discover.dataset import Run
from discover.forward import AugmentedModel, DeclaredModel, data_scales, make_batch
from discover.inference.least_squares import best_of, fit_batch
from discover.laws.multimode import Fluid
from discover.laws.registry import LAWS, make_law, starting_values
from discover.learners.tensor_sindy.selection import extended_bic
from discover.study.declared_model import DeclaredModel as KnownModel

_SPREAD = 3.0
"""A second start has every constant so many times as large: a law of two times may have two
minima."""


def fit_further_laws(
    names: Sequence[str],
    model: KnownModel,
    runs: Sequence[Run],
    flows: Sequence[Flow],
    recorded: Callable[[Flow, Stresses | None], Stresses | None],
    independent: float | None = None,
) -> list[ClassicalFit]:
    """Fit named laws to σ12 of the training runs, with the modes and the solvent that are known.

    All constants of a law are fitted, by least squares from two starts.

    Parameters
    ----------
    names
        Keys of `LAWS`.
    model
        The known part, of which modes and solvent are taken.
    runs
        The training runs, without what a known instrument did.
    flows
        The flows of the page, as the laws are simulated in them.
    recorded
        Of a flow and its stresses, what is recorded.
    independent
        As in `fit_classical_laws`.
    """
    batch, scales = make_batch(runs), data_scales(runs)
    sizes = np.array([len(run) for run in runs])
    samples = int(np.sum(sizes))
    fits = []
    for name in names:
        values = starting_values(name)
        modes = model.modulus, model.relaxation_time
        options = {"free": [*values], "solvent_viscosity": model.solvent_viscosity}
        forward = AugmentedModel(DeclaredModel.named(name, values, *modes, **options), [], scales)
        start = forward.zero()
        further = np.clip(_SPREAD * start, forward.low, forward.high) if values else start
        starts = [start, further][: 1 + bool(values)]
        found = fit_batch(forward, batch, starts, [forward.free_positions] * len(starts))
        best = best_of(found)
        parameters, misfit, criterion, fluid = {}, None, None, None
        if best is not None:
            constants = zip(values, best.theta[2 : 2 + len(values)], strict=True)
            ends = LAWS[name].parameters
            parameters = {key: float(np.clip(value, *ends[key])) for key, value in constants}
            squares = np.sum(best.residual**2, axis=1)
            misfit = float(np.sqrt(np.sum(sizes * squares) / samples))
            criterion = extended_bic(
                max(misfit, FLOOR),
                independent or samples,
                min(len(values), 1),
                max(len(values) - 1, 0),
                len(CLASSICAL) + len(names),
            )
            fluid = Fluid(make_law(name, parameters), *modes, model.solvent_viscosity)
        errors = {}
        for flow in flows:
            if flow.kind in ("held_out", "test"):
                seen = None if fluid is None else recorded(flow, predict(fluid, flow))
                errors[flow.name] = of_recorded(relative_errors(seen, flow.reference), flow)
        fits.append(ClassicalFit(name, parameters, misfit, criterion, errors))
    return fits
