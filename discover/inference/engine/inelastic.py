"""Fluids without elasticity as hypotheses: a shear stress that the present shear rate decides.

Newton's law, and that of Carreau & Yasuda 1972, AIChE J. 18, 1068 [Yasuda 1979, MIT thesis],

    σ12 = (η∞ + (η0 − η∞) (1 + (k |γ̇|)^a)^((n − 1)/a)) γ̇,

that of Herschel & Bulkley 1926, Kolloid-Z. 39, 291, whose yield stress sets in at a rate 1/m
[Papanastasiou 1987, J. Rheol. 31, 385],

    σ12 = sign(γ̇) (τ_y (1 − exp(−m |γ̇|)) + K |γ̇|^n),

and the same without a yield stress [Ostwald 1925, Kolloid-Z. 36, 99] are fitted to the same rows
with the same noise as hypotheses that relax, and weighed by the same evidence.
"""

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from discover.dataset import Run
from discover.inference.engine.discrepancy import Discrepancy
from discover.inference.engine.fits import Fit, Fitter
from discover.inference.engine.posterior import NONE, SAME, Posterior
from discover.inference.engine.priors import Prior
from discover.linear_algebra_threads import in_one_thread

NEWTONIAN, CARREAU_YASUDA = "newtonian", "carreau_yasuda"
HERSCHEL_BULKLEY, POWER_LAW = "herschel_bulkley", "power_law"
_NO_FLUID = ""
"""No stress but that of the bench, which is what a viscosity has to beat too."""

_ORDER = 3.0
"""Standard deviation of the logarithm of a viscosity or a time of which little is known."""

_ENDS = 1e-12, 1e12
_ROUNDS = 60
_TIMES = 0.1, 1.0, 10.0
_SHARPNESS = 0.7, 2.0
_YIELDS = 0.3, 2.0
_SHARP = 100.0
"""m times the typical rate: the yield stress is there from a hundredth of it on."""

_AT_REST = 1e-100
"""Rate in 1/s of which a viscosity is finite, and the stress none."""

_NEAR = 6.0
"""Log odds by which a law that relaxes must lead to be needed where it predicts the same."""


def viscosity(
    law: str, constants: Sequence[float] | np.ndarray, rate: Float[np.ndarray, " n"]
) -> Float[np.ndarray, " n"]:
    """Return the viscosity in Pa s at shear rates in 1/s; constants in the order of `priors`.

    A yield stress of which m is not given is there at once.
    """
    if law == NEWTONIAN:
        return np.full(np.shape(rate), constants[0])
    size = np.maximum(np.abs(rate), _AT_REST)
    if law in (POWER_LAW, HERSCHEL_BULKLEY):
        without_yield = (0.0,) if law == POWER_LAW else ()
        yield_stress, consistency, index, *sharpness = (*without_yield, *constants)
        set_in = -np.expm1(-sharpness[0] * size) if sharpness else 1.0
        return (yield_stress * set_in + consistency * size**index) / size
    zero, infinite, time, index, sharpness = constants
    thinned = (1.0 + (time * np.abs(rate)) ** sharpness) ** ((index - 1.0) / sharpness)
    return infinite + (zero - infinite) * thinned


@dataclass(frozen=True)
class Inelastic:
    """A law without elasticity, as the runs show it.

    Attributes
    ----------
    law
        ``newtonian``, ``power_law``, ``carreau_yasuda`` or ``herschel_bulkley``.
    values, ci95
        Constants with their 95 % intervals: the viscosity in Pa s; K in Pa sⁿ and n; η0 and η∞ in
        Pa s, k in s, n and a; or τ_y in Pa, K in Pa sⁿ and n.
    error
        Relative misfit of the runs.
    log_odds
        Against all that relaxes, and against any discrepancy.
    onset
        m in s, by which a yield stress sets in; None without one.
    """

    law: str
    values: tuple[float, ...]
    ci95: tuple[tuple[float, float], ...]
    error: float
    log_odds: float
    onset: float | None = None


class _InelasticFitter(Fitter):
    """Fits of a law without elasticity to the rows of a problem."""

    def __init__(self, fitter: Fitter, law: str):
        problem = copy(fitter.problem)
        problem.candidates, problem.modulus_root = (), None
        super().__init__(problem, fitter.rows)
        self.law = law
        self.rate = np.concatenate([np.asarray(run.rate, float) for run in self.rows.runs])

    def priors(self, names: Sequence[str]) -> Mapping[int, Prior]:
        """Return the priors of the constants, about what the records suggest."""
        del names
        if self.law == _NO_FLUID:
            return {}
        moving = np.abs(self.rate[self.rate != 0.0])
        typical = float(np.exp(np.mean(np.log(moving))))
        size = np.sqrt(np.mean(self.rows.recorded**2) / np.mean(self.rate**2))
        scale = Prior("logarithm", float(size), _ORDER, *(end * size for end in _ENDS))
        if self.law == NEWTONIAN:
            return {0: scale}
        time = Prior("logarithm", 1.0 / typical, _ORDER, *(end / typical for end in _ENDS))
        index = Prior("normal", 0.5, 0.3, 0.0, 1.0)
        if self.law == POWER_LAW:
            return {0: scale, 1: index}
        if self.law == HERSCHEL_BULKLEY:
            stress = float(np.sqrt(np.mean(self.rows.recorded**2)))
            of_yield = Prior("logarithm", 0.3 * stress, _ORDER, *(e * stress for e in _ENDS))
            sharp = Prior("logarithm", _SHARP / typical, _ORDER, *(e / typical for e in _ENDS))
            return {0: of_yield, 1: scale, 2: index, 3: sharp}
        plateau = Prior("logarithm", 0.01 * float(size), _ORDER, *(e * size for e in _ENDS))
        sharpness = Prior("normal", 2.0, 1.0, 0.2, 8.0)
        return {0: scale, 1: plateau, 2: time, 3: index, 4: sharpness}

    def starts(self) -> list[Fit]:
        """Return fits before their first step."""
        middle = [prior.middle for prior in self.priors(()).values()]
        if self.law == HERSCHEL_BULKLEY:
            return [self.start((), np.array([share * middle[0], *middle[1:]])) for share in _YIELDS]
        if self.law != CARREAU_YASUDA:
            return [self.start((), np.array(middle))]
        return [
            self.start((), np.array([*middle[:2], stretch * middle[2], middle[3], sharpness]))
            for stretch in _TIMES
            for sharpness in _SHARPNESS
        ]

    def predict(
        self,
        thetas: Sequence[np.ndarray] | Float[np.ndarray, "trials p"],
        moduli: Float[np.ndarray, "trials c"] | None = None,
    ) -> Float[np.ndarray, "trials rows"]:
        """Return the records of the law, in Pa; it has no moduli."""
        del moduli
        if self.law == _NO_FLUID:
            return np.zeros((len(thetas), len(self.rows)))
        found = [viscosity(self.law, theta, self.rate) * self.rate for theta in thetas]
        return np.array(found).reshape(len(thetas), len(self.rows))


def _has_memory(run: Run) -> bool:
    """Return whether what was recorded is no function of the present shear rate."""
    of_rate = run.protocol.control == "rate" and run.flow == "shear" and run.quantity == "sigma12"
    return not of_rate or not np.any(run.rate)


@in_one_thread
def inelastic(posterior: Posterior) -> Inelastic | None:
    """Return the law without elasticity that the runs show; None where one that relaxes is needed.

    One that predicts the same as the likeliest that relaxes is preferred to it: elasticity that no
    run shows is not claimed.
    """
    search, problem = posterior.search, posterior.problem
    fitter, alive = search.fitter, search.alive()
    runs = fitter.rows.runs
    if any(_has_memory(run) for run in runs) or not np.any(fitter.rows.recorded):
        return None
    laws = _NO_FLUID, NEWTONIAN, POWER_LAW, CARREAU_YASUDA, HERSCHEL_BULKLEY
    own = {law: _InelasticFitter(fitter, law) for law in laws}
    fits = {law: max(one.fit(one.starts(), _ROUNDS), key=lambda f: f.log_evidence)
            for law, one in own.items()}  # fmt: skip
    nothing = fits.pop(_NO_FLUID).log_evidence
    law = max(fits, key=lambda name: fits[name].log_evidence)
    fit, fitted = fits[law], own[law]
    rank = fit.log_evidence + problem.log_odds_of(1.0)
    if not np.isfinite(rank):
        return None
    other = -np.inf
    if alive:
        other = float(np.logaddexp.reduce([search.rank(one) for one in alive]))
        noise = fit.noise.sizes[fitter.rows.run] * fitter.rows.size
        off = (fitter.record(alive[0]) - fitted.record(fit)) / noise
        if np.sqrt(np.mean(off**2)) < SAME:
            other -= _NEAR
    if rank < np.logaddexp(other, nothing):
        return None
    beside = Discrepancy(fitted, fit).log_factor + np.log(NONE / (1.0 - NONE))
    odds = rank - float(np.logaddexp.reduce([other, nothing, rank + beside]))
    if odds < 0.0:
        return None
    # how sharply a yield stress sets in is as much of the instrument as of the fluid
    own, onset = (
        (fit.free[:-1], float(fit.theta[-1])) if law == HERSCHEL_BULKLEY else (fit.free, None)
    )
    values = tuple(float(fit.theta[at]) for at in own)
    return Inelastic(law, values, tuple(map(fit.interval, own)), fitted.misfit(fit), odds, onset)
