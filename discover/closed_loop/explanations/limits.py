"""Effects of which the records show only a limit, which has another name too."""

from collections.abc import Sequence

import numpy as np
from scipy.stats import chi2

from discover.dataset import Run
from discover.effects import ConstitutiveEffect
from discover.forward import AugmentedModel, Batch
from discover.inference.least_squares import Fit
from discover.inference.problem import FitProblem

DAMPING = "strain_damping"
"""An effect; among the aliases of others, that a damping function of the strain does as well."""


def names_of_limits(
    model: AugmentedModel, batch: Batch, runs: Sequence[Run], fit: Fit, names: Sequence[str]
) -> dict[str, str]:
    """Return what effects cannot be told from, by name of the effect.

    A structure that builds up in a time that no run lasts is seen to break only: what it does is a
    damping by the strain since it was at rest, and that it ever builds up, which the effect's name
    says, is not determined. Nor is what the name of an effect says of a constant that may be zero,
    at 95 %.
    And in relaxation after steps of strain an effect that only multiplies each run by a number, to
    within what is left, is any damping function that has these values: stress relaxation whose time
    and strain separate tells no mechanism   [Wagner 1976, Rheol. Acta 15, 136].
    """
    at_rest = all(run.protocol.control == "rate" and not np.any(run.rate) for run in runs)
    found = {}
    for effect in model.effects:
        if effect.name not in names:
            continue
        for parameter, at in zip(effect.parameters, model.positions(effect.name), strict=True):
            if parameter.endless and fit.theta[at] >= batch.longest > 0.0:
                found[effect.name] = parameter.endless
            if parameter.absent and _may_be(parameter.low, at, FitProblem(model, batch), fit):
                found[effect.name] = parameter.absent
        if at_rest and isinstance(effect, ConstitutiveEffect) and effect.name != DAMPING:
            theta, _ = FitProblem(model, batch).without(fit, effect.name)
            if _only_factors(model, batch, fit, theta):
                found[effect.name] = DAMPING
    return found


def _may_be(value: float, at: int, problem: FitProblem, fit: Fit) -> bool:
    """Return whether the fit with a parameter at a value is within 95 % of the best."""
    theta = fit.theta.copy()
    theta[at] = value
    other = problem.fit(theta, [p for p in fit.free if p != at])
    if not other.usable:
        return False
    worse = problem.independent_samples(fit) * np.log(problem.cost(other) / problem.cost(fit))
    return bool(worse <= chi2.ppf(0.95, 1))


def _only_factors(model: AugmentedModel, batch: Batch, fit: Fit, without: np.ndarray) -> bool:
    """Return whether two predictions of each run differ by a number, but for what a fit leaves."""
    weight, recorded = np.asarray(batch.weight), np.asarray(batch.recorded) * batch.weight
    both = np.asarray(model.residuals([fit.theta, without], batch)) + np.where(weight, recorded, 0)
    if not np.all(np.isfinite(both)):
        return False
    own, other = both
    power = np.maximum(np.sum(other**2, axis=1), np.finfo(float).tiny)
    factor = np.sum(own * other, axis=1) / power
    apart = np.sqrt(np.sum((own - factor[:, None] * other) ** 2, axis=1))
    return bool(np.all(apart <= np.maximum(fit.run_errors, 1e-6)))
