"""Simple materials as hypotheses: a viscous fluid, a yield stress, an elastic solid.

Each is fitted in closed form to the same rows with the same noise as hypotheses that relax, and
weighed by the same evidence. A viscous fluid may be seen in any shear at a given rate, in flow
curves, in moduli and in creep; a solid in moduli, in shear from rest and in creep.
"""

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from jaxtyping import Float

from discover.dataset import Run
from discover.inference.closed_forms import (
    CARREAU_YASUDA,
    HERSCHEL_BULKLEY,
    KELVIN_VOIGT,
    MAXWELL,
    NEWTONIAN,
    POWER_LAW,
    TWO_MODES,
    recorded,
    strain_of,
)
from discover.inference.discrepancy import DiscrepancyModel
from discover.inference.fits import Fit, Fitter
from discover.inference.indistinguishable import SAME
from discover.inference.posterior import Posterior
from discover.inference.priors import Prior
from discover.inference.problem import LOG_ODDS_OF_NONE
from discover.processor import in_one_thread
from discover.protocols.kinematics import MODULI

_NO_MATERIAL = ""
"""No stress but that of the bench, which is what a material has to beat too."""

_GOING_ON = "maxwell_going_on"
"""A Maxwell mode with a solvent whose stress at the start of each run is not known: in steady
alternation at one frequency it is a solid to the last digit, whatever its time."""

_VISCOUS = NEWTONIAN, POWER_LAW, CARREAU_YASUDA, HERSCHEL_BULKLEY
_LINEAR = NEWTONIAN, KELVIN_VOIGT
_WEIGHED = {"rate": _VISCOUS, "steady": _VISCOUS, "oscillation": _LINEAR, "stress": _LINEAR}
"""Hypotheses by what was imposed; a solid too where strains since rest are known, as in creep."""

_BESIDE_A_TIME = NEWTONIAN, HERSCHEL_BULKLEY
"""What a flow curve shows of a fluid whose relaxation time is known: such a fluid thins too."""

_RELAXING = {"rate": (MAXWELL, _GOING_ON, TWO_MODES), "oscillation": (MAXWELL, TWO_MODES)}
"""Fluids that a solid must differ from: of times within the record, for one that relaxes later is
that solid. In creep those of the search."""

_AHEAD = 3.0
"""Log evidence by which a yield stress or a modulus must lead what has none: that is strong
[Kass & Raftery 1995, J. Am. Stat. Assoc. 90, 773]."""

_ORDER = 3.0
"""Standard deviation of the logarithm of a constant of which little is known."""

_ENDS = 1e-12, 1e12
_ROUNDS = 60
_STRETCHES = 0.1, 1.0, 10.0
_SHARPNESS = 0.7, 2.0
_YIELDS = 0.3, 2.0
_SHARP = 100.0
"""m times the typical rate: the yield stress is there from a hundredth of it on."""

_PLATEAU = 3.0
"""Time of a viscosity that thins over that of the slowest rate, up to which its first plateau is in
the range; without one it is a yield stress by another name."""

_SEEN = 0.3
"""Share of the smallest stress of a flow curve that a yield stress must be, to be measured."""

_NEAR = 6.0
"""Log odds by which a law that relaxes must lead to be needed where it predicts the same."""

_FAR = 40.0
"""Log posterior behind the evidence of a law that relaxes from which on a material is not named:
`_NEAR`, the odds of a hypothesis, and the widths of up to five constants."""


@dataclass(frozen=True)
class SimpleFit:
    """A simple material, as the runs show it.

    Attributes
    ----------
    law
        ``newtonian``, ``power_law``, ``carreau_yasuda``, ``herschel_bulkley`` or ``kelvin_voigt``.
    values, ci95
        Constants with their 95 % intervals: the viscosity in Pa s; K in Pa sⁿ and n; η0 and η∞ in
        Pa s, k in s, n and a; τ_y in Pa, K in Pa sⁿ and n; or G in Pa and η in Pa s.
    error
        Relative misfit of the runs.
    log_odds
        That it is all there is: against what relaxes, and against any discrepancy.
    onset
        m in s, by which a yield stress sets in; None without one.
    """

    law: str
    values: tuple[float, ...]
    ci95: tuple[tuple[float, float], ...]
    error: float
    log_odds: float
    onset: float | None = None


class _ClosedForm(Fitter):
    """Fits of a law in closed form to the rows of a problem."""

    def __init__(self, fitter: Fitter, law: str):
        problem = copy(fitter.problem)
        problem.candidates, problem.modulus_root = (), None
        super().__init__(problem, fitter.rows)
        self.law = law
        runs = self.rows.runs
        control = runs[0].protocol.control
        of_waves, self.is_curve = control == "oscillation", control == "steady"
        rates, stress = [run.rate for run in runs], self.rows.recorded
        if of_waves:
            rates = [run.angular_frequency for run in runs]
        elif control == "stress":  # mean rates, for slopes between samples are noise
            rates = [run.recorded[1:] / run.time[1:] for run in runs]
            stress = np.concatenate([run.stress for run in runs])
        self.rates = np.abs(np.concatenate(rates))
        moving = self.rates[self.rates != 0.0]
        self.slowest, self.typical = np.min(moving), float(np.exp(np.mean(np.log(moving))))
        self.longest = (
            max(float(run.time[-1]) for run in runs) if not of_waves else 1 / self.slowest
        )
        strains = np.ones(1) if of_waves else np.concatenate([strain_of(run) for run in runs])
        self.stress = float(np.sqrt(np.mean(stress**2)))
        self.modulus = self.stress / max(float(np.sqrt(np.mean(strains**2))), 1e-300)

    def priors(self, names: Sequence[str]) -> Mapping[int, Prior]:
        """Return the priors of the constants, about what the records suggest."""
        del names
        size = self.stress / float(np.sqrt(np.mean(self.rates**2)))

        def of(middle: float, high: float = np.inf) -> Prior:
            low, most = (end * middle for end in _ENDS)
            return Prior("logarithm", middle, _ORDER, low, min(high, most))

        viscosity, index = of(size), Prior("normal", 0.5, 0.3, 0.0, 1.0)
        modulus = of(self.modulus)
        time = of(min(1.0 / self.typical, self.longest), self.longest)
        thinning = of(1.0 / self.typical, _PLATEAU / self.slowest)
        start = Prior("normal", 0.0, self.stress)
        # at each rate of a flow curve it has set in: below that it were no yield stress
        onset = () if self.is_curve else (of(_SHARP / self.typical),)
        every = {
            _NO_MATERIAL: (),
            NEWTONIAN: (viscosity,),
            POWER_LAW: (viscosity, index),
            HERSCHEL_BULKLEY: (of(0.3 * self.stress), viscosity, index, *onset),
            CARREAU_YASUDA: (
                viscosity, of(0.01 * size), thinning, index, Prior("normal", 2.0, 1.0, 0.2, 8.0),
            ),
            KELVIN_VOIGT: (modulus, viscosity),
            MAXWELL: (modulus, time, of(0.1 * size)),
            _GOING_ON: (modulus, time, of(0.1 * size), *[start] * len(self.rows.runs)),
            TWO_MODES: (modulus, time, modulus, time),
        }  # fmt: skip
        return dict(enumerate(every[self.law]))

    def starts(self) -> list[Fit]:
        """Return fits before their first step."""
        middle = np.array([prior.middle for prior in self.priors(()).values()])
        times = np.geomspace(0.01, 1.0, 5) * self.longest
        if self.law == HERSCHEL_BULKLEY:
            tried = [np.array([share * middle[0], *middle[1:]]) for share in _YIELDS]
        elif self.law == CARREAU_YASUDA:
            tried = [
                np.array([*middle[:2], stretch * middle[2], middle[3], sharpness])
                for stretch in _STRETCHES
                for sharpness in _SHARPNESS
            ]
        elif self.law == KELVIN_VOIGT:
            tried = [middle, middle[0] * np.array([1.0, times[0]])]
        elif self.law in (MAXWELL, _GOING_ON):
            tried = [np.array([middle[0], time, *middle[2:]]) for time in times]
        elif self.law == TWO_MODES:
            tried = [np.array([middle[0], a, middle[2], b]) for a, b in combinations(times, 2)]
        else:
            tried = [middle]
        return [self.start((), one) for one in tried]

    def predict(
        self,
        thetas: Sequence[np.ndarray] | Float[np.ndarray, "trials p"],
        moduli: Float[np.ndarray, "trials c"] | None = None,
    ) -> Float[np.ndarray, "trials rows"]:
        """Return the records of the law; it has no moduli."""
        del moduli
        found = [np.concatenate(self._of(np.asarray(theta))) for theta in thetas]
        return np.array(found).reshape(len(thetas), len(self.rows))

    def _of(self, theta: np.ndarray) -> list[np.ndarray]:
        runs = self.rows.runs
        if self.law == _NO_MATERIAL:
            return [np.zeros(len(run)) for run in runs]
        if self.law != _GOING_ON:
            return [recorded(self.law, theta, run) for run in runs]
        kept = [np.exp(-run.time / theta[1]) for run in runs]
        return [
            recorded(MAXWELL, theta[:3], run) + start * left
            for run, left, start in zip(runs, kept, theta[3:], strict=True)
        ]


def describes(control: str, run: Run) -> bool:
    """Return whether simple materials say what a run records, where this is what was imposed."""
    if run.protocol.control != control or control not in _WEIGHED:
        return False
    if control == "oscillation":
        return run.quantity in MODULI and run.strain is not None
    if run.flow != "shear" or run.quantity not in ("sigma12", "strain"):
        return False
    if control == "stress":
        return not np.any(run.protocol.cycle)
    moves = run.rate != 0.0
    return bool(np.all(moves & (run.stress != 0.0)) if control == "steady" else np.any(moves))


@in_one_thread
def simple_material(posterior: Posterior) -> SimpleFit | None:
    """Return the simple material that the runs show; None where a law that relaxes is needed.

    One that predicts the same as the likeliest law that relaxes is preferred to it: elasticity that
    no run shows is not claimed.
    """
    search, problem = posterior.search, posterior.problem
    fitter, alive = search.fitter, search.ranked()
    runs = fitter.rows.runs
    control = runs[0].protocol.control
    if not all(describes(control, run) for run in runs) or not np.any(fitter.rows.recorded):
        return None
    from_rest = control == "rate" and all(run.from_rest for run in runs)
    laws = (*_WEIGHED[control], *((KELVIN_VOIGT,) if from_rest else ()))
    # where nothing is left to be explained, only what comes near the likeliest that relaxes counts
    explains = alive and posterior.verdict != "unexplained"
    least = search.rank(alive[0]) - _FAR if explains else -np.inf
    fits = {law: _fitted(fitter, law, least) for law in (_NO_MATERIAL, *laws)}
    nothing = fits.pop(_NO_MATERIAL)[1].log_evidence

    def led(law: str) -> float:
        lead = _AHEAD if law in (HERSCHEL_BULKLEY, KELVIN_VOIGT) else 0.0
        return fits[law][1].log_evidence - lead

    law = max(fits, key=led)
    fitted, fit = fits[law]
    rank = fit.log_evidence + problem.log_odds_of(1.0)
    knows_time = fitted.is_curve and 1 not in problem.declared.free_positions
    if (knows_time and law not in _BESIDE_A_TIME) or not np.isfinite(rank):
        return None
    noise = fit.noise.sizes[fitter.rows.run] * fitter.rows.size

    def is_same(record: Float[np.ndarray, " rows"]) -> bool:
        return bool(np.sqrt(np.mean(((record - fitted.record(fit)) / noise) ** 2)) < SAME)

    if law == KELVIN_VOIGT:
        for own, one in (_fitted(fitter, name) for name in _RELAXING.get(control, ())):
            if one.log_evidence > fit.log_evidence or is_same(own.record(one)):
                return None
    seen = _SEEN * np.min(np.abs(fitter.rows.recorded)) if fitted.is_curve else 0.0
    if law == HERSCHEL_BULKLEY and fit.theta[0] < seen:
        return None
    others = -np.inf
    if alive:
        ranks = [search.rank(one) for one in alive]
        if (left := posterior.left) is not None:
            ranks.append(search.rank(left.fit) + left.log_factor + LOG_ODDS_OF_NONE)
        others = float(np.logaddexp.reduce(ranks))
        if is_same(fitter.record(alive[0])):
            times = problem.declared.relaxation_time * np.exp(alive[0].theta[1])
            later = law == KELVIN_VOIGT and 1 in problem.declared.free_positions
            later &= np.min(times) > fitted.longest
            others -= np.inf if later else _NEAR
    unknown = rank + DiscrepancyModel(fitted, fit).log_factor + LOG_ODDS_OF_NONE
    # one that leaves something is told where all that relaxes leaves something too
    whole = np.logaddexp(rank, unknown) if posterior.verdict == "unexplained" else rank
    if whole < np.logaddexp(others, nothing):
        return None
    odds = rank - float(np.logaddexp.reduce([others, nothing, unknown]))
    # how sharply a yield stress sets in is as much of the instrument as of the fluid
    sets_in = law == HERSCHEL_BULKLEY and not fitted.is_curve
    free, onset = (fit.free[:-1], float(fit.theta[-1])) if sets_in else (fit.free, None)
    values = tuple(float(fit.theta[at]) for at in free)
    ends = list(map(fit.interval, free))
    if law == KELVIN_VOIGT:  # a logarithm never reaches a viscosity of zero
        inviscid = fitted.predict([np.array([values[0], fitted.priors(())[1].low])])[0]
        ends[1] = (0.0 if is_same(inviscid) else ends[1][0], ends[1][1])
    return SimpleFit(law, values, tuple(ends), fitted.misfit(fit), odds, onset)


def _fitted(fitter: Fitter, law: str, least: float = -np.inf) -> tuple[_ClosedForm, Fit]:
    """Return the likeliest fit of a law, and what fitted it; `least`: as of `Fitter.fit`."""
    own = _ClosedForm(fitter, law)
    fits = own.fit(own.starts(), _ROUNDS, least=least)
    return own, max(fits, key=lambda fit: fit.log_evidence)
