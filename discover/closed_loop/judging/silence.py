"""Do the records hold a signal of the fluid? Asked of them alone, and of a fit to them."""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from scipy.stats import chi2

from discover.dataset import Run
from discover.effects import ConstitutiveEffect
from discover.forward import AugmentedModel, Batch
from discover.inference.least_squares import Fit
from discover.statistics import holds_signal
from discover.statistics.noise.dead_records import CHANCE
from discover.statistics.residual import judged_cost, judging, summarise

Silence = Literal["records", "fluid"]
"""What holds no signal: the records themselves, or what a fit leaves to the fluid of them."""

_OFF = 1e-30  # factor on the moduli of a fluid that is switched off
_ALIKE = 1.1
"""Misfits without and with a fluid that differ by less are alike: where structure is left, few
samples are independent, and the test alone would not see a fluid that halves the misfit."""


def records_are_silent(runs: Sequence[Run]) -> bool:
    """Return whether records are noise about a constant, whatever rate was imposed.

    A modulus is a stress over a strain: one that is constant is a signal.
    """
    if any(run.protocol.control == "oscillation" for run in runs):
        return False
    return not holds_signal([run.recorded for run in runs], [run.rate for run in runs])


def fluid_is_silent(model: AugmentedModel, batch: Batch, fit: Fit, active: Sequence[str]) -> bool:
    """Return whether a fit explains the records as well without its fluid.

    The fluid is switched off, and what it had lowered the misfit by is held against what as many
    constants as it has would lower noise by   [Wilks 1938, Ann. Math. Stat. 9, 60], on as many
    samples as the residual is worth. So an effect that lets no flow reach the fluid, or no stress
    of it the record, explains nothing, however small the misfit.
    """
    declared = model.declared
    theta, fluid = fit.theta.copy(), max(sum(at < declared.size for at in fit.free), 1)
    on = {*active, *(known.name for known in declared.effects)}
    for effect in model.effects:
        if effect.name in on and isinstance(effect, ConstitutiveEffect):
            at = model.positions(effect.name)
            theta[at[0]] = 0.0
            fluid += len(at)
    off = np.append(_OFF * declared.modulus, 0.0)
    without = model.residuals([theta], batch, moduli=off[None])[0]
    weight = np.asarray(batch.weight)
    rows = judging(weight)
    lost, left = (judged_cost(r, weight) for r in (without, fit.residual))
    if not np.isfinite(lost) or left <= 0.0 or lost > _ALIKE**2 * left:
        return False
    samples = summarise(fit.residual[rows], weight[rows]).effective_samples
    return bool(samples * np.log(lost / left) < chi2.isf(CHANCE, fluid))
