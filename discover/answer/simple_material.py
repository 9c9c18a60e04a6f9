"""A yield stress, a viscous fluid, a solid: recognised before any search for a viscoelastic law.

Each is fitted to all runs by least squares and held against laws that relax, by Schwarz's criterion
BIC = n ln(S/n) + k ln n   [Schwarz 1978, Ann. Stat. 6, 461]. Flow curves: Newtonian and
Herschel-Bulkley against Carreau with a second plateau. Sweeps and transients: Newtonian and
Kelvin-Voigt against one Maxwell mode with a solvent.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float
from scipy.integrate import cumulative_trapezoid
from scipy.linalg import get_lapack_funcs
from scipy.optimize import least_squares, lsq_linear
from scipy.stats import t as student

from discover.answer.constant import Constant
from discover.dataset import Run
from discover.equations.formats.rheotool import viscous_fluid
from discover.inference.engine.inelastic import viscosity
from discover.protocols.kinematics import MODULI
from discover.statistics.noise.noise_model import rms

Kind = Literal["yield_stress", "viscous", "solid"]

_FEWEST = 6  # Samples from which on a law of three constants can be recognised
# BIC by which it must lead laws that relax: strong evidence [Kass & Raftery 1995, JASA 90, 773]
_AHEAD = 6.0
# Largest relative misfit of a law that is named, by what was imposed
_MISFIT = {"steady": 0.1, "oscillation": 0.05, "rate": 0.05}
_STANDS_OUT = 4.0  # Standard errors by which a yield stress or a modulus must exceed zero
# Share of the smallest stress that a yield stress must be, to be measured and not extrapolated
_SEEN = 0.3
# Relaxation time times the slowest rate, up to which a first Newtonian plateau is in the range
_PLATEAU = 3.0

Values = Float[np.ndarray, " k"]


@dataclass(frozen=True)
class SimpleMaterial:
    """Material without relaxation, as recognised.

    `kind`, `title`, `law`: what it is, the name for readers, and that in results.
    `formula`, `latex`: law typeset, without and with its numbers. `onset`: m in s, with which a
    yield stress sets in as 1 − exp(−m |γ̇|); None where it is there at once.
    """

    kind: Kind
    title: str
    law: str
    constants: tuple[Constant, ...]  # with 95 % intervals
    error: float  # relative misfit of the fitted runs
    formula: str
    latex: str
    onset: float | None = None

    def written(self, comments: Sequence[str], slowest: float, density: float) -> dict[str, str]:
        """Return the law as text by format, with lines of comment in front.

        `slowest`: rate in 1/s below which nothing was measured. `density` in kg/m³.
        """
        numbers = [f"{one.value:.6g}" for one in self.constants]
        found = {
            "python": "".join(f"# {line}\n" for line in comments)
            + f"\n{_PYTHON[self.law](numbers)}",
            "latex": "".join(f"% {line}\n" for line in comments) + f"\\[{self.latex}\\]\n",
        }
        if self.law in _RHEOTOOL:
            kind, names = _RHEOTOOL[self.law]
            entries = {
                name: (quantity, one.value)
                for (name, quantity), one in zip(names.items(), self.constants, strict=True)
            }
            if cap := _CAPS.get(self.law):
                # rheoTool wants a largest viscosity: that of a tenth of the slowest rate
                at = 0.1 * slowest
                largest = float(viscosity(self.law, self._values, np.array([at]))[0])
                entries[cap] = "viscosity", float(f"{largest:.3g}")
                comments = [*comments, f"{cap} caps the viscosity below {at:.3g} 1/s."]
            if self.law == "power_law":
                entries["etaMin"] = "viscosity", 0.0
            found["rheotool"] = viscous_fluid(kind, entries, comments, density)
        return found

    def predict(self, run: Run) -> Float[np.ndarray, " n"] | None:
        """Return what it records in a run; None in a flow that it does not describe."""
        if not _is_simple(run):
            return None
        return _predicted(self.law, self._values, run)

    @property
    def _values(self) -> Values:
        values = [one.value for one in self.constants]
        return np.array(values if self.onset is None else [*values, self.onset])


def recognise(runs: Sequence[Run]) -> SimpleMaterial | None:
    """Return the simple material that runs show; None where a law that relaxes may be needed.

    `runs`: those that are fitted: flow curves, sweeps of both moduli, or shear at a given rate.
    """
    controls = {run.protocol.control for run in runs}
    count = sum(len(run) for run in runs)
    if len(controls) != 1 or not all(map(_is_simple, runs)) or count < _FEWEST:
        return None
    (control,) = controls
    if control == "steady":
        named, others = ("newtonian", "herschel_bulkley"), ("carreau",)
    else:
        named, others = ("newtonian", "kelvin_voigt"), ("maxwell", "two_modes")
    fits = {law: _fit(law, runs) for law in named}
    best = min(named, key=lambda law: fits[law].criterion)
    chosen = fits[best]
    if chosen.error > _MISFIT[control] or not _stands_out(best, chosen, runs):
        return None
    # Newtonian and Kelvin-Voigt are limits of a Maxwell mode, so that a lower criterion is enough
    rival = min(_fit(law, runs).criterion for law in others)
    if chosen.criterion > rival - (_AHEAD if best == "herschel_bulkley" else 0.0):
        return None
    spread = np.exp(np.outer(chosen.quantile * chosen.deviation, (-1.0, 1.0)))
    return material_of(best, chosen.values, chosen.values[:, None] * spread, chosen.error)


def _is_simple(run: Run) -> bool:
    control = run.protocol.control
    if control == "oscillation":
        return run.quantity in MODULI and run.strain is not None
    if run.flow != "shear" or run.quantity != "sigma12":
        return False
    if control == "steady":
        return bool(np.all(run.rate != 0.0) and np.all(run.stress != 0.0))
    return control == "rate" and run.from_rest


# laws ---------------------------------------------------------------------------------------------


def _predicted(law: str, values: Values, run: Run) -> Float[np.ndarray, " n"]:
    """Return what a law records in a run, of constants in their units."""
    if run.protocol.control == "oscillation":
        storage = run.quantity == MODULI[0]
        omega = run.angular_frequency
        if law in ("maxwell", "two_modes"):
            pairs = ((omega * time, g) for g, time in _modes(law, values))
            each = [(x**2 if storage else x) / (1.0 + x**2) * g for x, g in pairs]
            whole = np.sum(each, axis=0)
            return whole if storage or law == "two_modes" else whole + values[2] * omega
        if storage:
            return np.full(len(run), values[0] if law == "kelvin_voigt" else 0.0)
        return values[-1] * omega
    rate = run.rate
    if law in ("newtonian", "power_law", "carreau_yasuda", "herschel_bulkley"):
        return viscosity(law, values, rate) * rate
    if law == "carreau":
        zero, infinite, time, index = values
        # without a first plateau in the range it would be a yield stress by another name
        time = min(time, _PLATEAU / float(np.min(np.abs(rate))))
        thinned = (1.0 + (time * rate) ** 2) ** (0.5 * index - 0.5)
        return (infinite + (zero - infinite) * thinned) * rate
    if law == "kelvin_voigt":
        return values[0] * _strain(run) + values[1] * rate
    whole = np.sum([g * _relaxing(run, time) for g, time in _modes(law, values)], axis=0)
    return whole if law == "two_modes" else whole + values[2] * rate


def _modes(law: str, values: Values) -> list[tuple[float, float]]:
    pairs = [(values[0], values[1]), (values[2], values[3])] if law == "two_modes" else [values[:2]]
    return [(float(modulus), float(time)) for modulus, time in pairs]


def _strain(run: Run) -> Float[np.ndarray, " n"]:
    if run.strain is not None:
        return run.strain
    return np.asarray(cumulative_trapezoid(run.rate, run.time, initial=0.0)) + (
        run.rate[0] * run.time[0]
    )


def _relaxing(run: Run, time: float) -> Float[np.ndarray, " n"]:
    """Return the stress over the modulus of a Maxwell mode, exact for a rate linear in steps."""
    step = np.diff(run.time, prepend=0.0)
    before = np.concatenate([run.rate[:1], run.rate[:-1]])
    kept = np.exp(-step / time)
    gained = 0.5 * (before + run.rate) * time * (-np.expm1(-step / time))
    # each value less what is kept of the one before: two diagonals
    bands = np.stack([np.ones(len(step)), -np.append(kept[1:], 0.0)])
    (solve,) = get_lapack_funcs(("tbtrs",), (bands,))
    stress, _ = solve(bands, gained[:, None], uplo="L")
    return stress[:, 0]


# fits ---------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Fit:
    values: Values
    deviation: Values
    error: float
    criterion: float
    count: int
    quantile: float


def _sizes(run: Run) -> Float[np.ndarray, " n"]:
    """Return in what a misfit is counted: each value of a flow curve, |G*|, the rms of a record."""
    if run.protocol.control == "steady":
        return np.abs(run.stress)
    if run.protocol.control != "oscillation":
        return np.full(len(run), rms(run.stress) or 1.0)
    both = run.storage_modulus, run.loss_modulus
    if both[0] is None or both[1] is None:
        return np.maximum(np.abs(run.recorded), 1e-300)
    return np.maximum(np.hypot(both[0], both[1]), 1e-300)


def _fit(law: str, runs: Sequence[Run]) -> _Fit:
    sizes = np.concatenate([_sizes(run) for run in runs])
    recorded = np.concatenate([run.recorded for run in runs])

    def off(logs: Values) -> np.ndarray:
        with np.errstate(over="ignore", invalid="ignore"):
            values = np.exp(np.clip(logs, -60.0, 60.0))
            found = np.concatenate([_predicted(law, values, run) for run in runs])
        return np.clip(np.nan_to_num((found - recorded) / sizes, nan=1e6), -1e6, 1e6)

    ends = [least_squares(off, start, x_scale=1.0) for start in _starts(law, runs)]
    best = min(ends, key=lambda end: end.cost)
    n, k = len(recorded), len(best.x)
    square = max(2.0 * best.cost / n, 1e-20)
    values = np.exp(np.clip(best.x, -60.0, 60.0))
    inverse = np.linalg.pinv(best.jac.T @ best.jac)
    spread = np.sqrt(np.maximum(np.diag(inverse), 0.0) * square * n / max(n - k, 1))
    criterion = n * np.log(square) + k * np.log(n)
    quantile = float(student.ppf(0.975, max(n - k, 1)))
    return _Fit(values, spread, float(np.sqrt(square)), float(criterion), k, quantile)


def _starts(law: str, runs: Sequence[Run]) -> list[Values]:
    """Return logarithms of constants from which fits start."""
    rate = np.concatenate([np.abs(run.rate) for run in runs])
    if runs[0].protocol.control == "oscillation":
        rate = np.concatenate([run.angular_frequency for run in runs])
    size = np.concatenate([np.abs(run.recorded) for run in runs])
    moving = rate > 0.0
    low, high = float(np.min(rate[moving])), float(np.max(rate[moving]))
    least, most = float(np.min(size[size > 0.0])), float(np.max(size))
    viscosity = float(np.median(size[moving] / rate[moving]))
    if law == "newtonian":
        return [np.log([viscosity])]
    if law == "herschel_bulkley":
        return [
            np.log([share * least, max(most - share * least, 1e-3 * most) / high**n, n])
            for share in (0.01, 0.5, 0.95)
            for n in (0.3, 0.6, 1.0)
        ]
    if law == "carreau":
        return [
            np.log([least / low, share * most / high, time, n])
            for share in (1e-3, 0.5)
            for time in np.geomspace(0.3 / high, 3.0 / low, 4)
            for n in (0.2, 0.6)
        ]
    strain = max(float(np.max(np.abs(_strain(run)))) for run in runs)
    modulus = most if runs[0].protocol.control == "oscillation" else most / max(strain, 1e-12)
    if law == "kelvin_voigt":
        return [np.log([share * modulus, viscosity]) for share in (0.01, 0.5, 1.0)]
    longest = max(float(run.time[-1]) for run in runs)
    times = np.geomspace(0.1 / high, 10.0 / low, 8)
    if runs[0].protocol.control == "rate":
        times = np.geomspace(1e-3 * longest, 1e2 * longest, 8)
    if law == "maxwell":
        return [np.log([modulus, time, 0.1 * viscosity]) for time in times]
    pairs = [(first, second) for first in times[::2] for second in times[1::2] if second > first]
    return [np.log([modulus, first, modulus, second]) for first, second in pairs]


def _stands_out(law: str, fit: _Fit, runs: Sequence[Run]) -> bool:
    """Return whether what gives the material its name is there."""
    if law == "newtonian":
        return True
    first, deviation = fit.values[0], fit.deviation[0]  # of the logarithm
    if deviation * _STANDS_OUT > 1.0:
        return False
    if law == "herschel_bulkley":
        least = min(float(np.min(np.abs(run.stress))) for run in runs)
        return bool(first > _SEEN * least and fit.values[2] < 1.5)
    if runs[0].protocol.control == "oscillation":
        # at one frequency any fluid has a storage modulus
        omega = np.concatenate([run.angular_frequency for run in runs])
        return bool(np.ptp(omega) > 0.01 * np.max(omega))
    count = sum(map(len, runs))
    return bool(count * np.log(_squares_of_fluid(runs) / fit.error**2) > _AHEAD)


def _squares_of_fluid(runs: Sequence[Run]) -> float:
    """Mean square misfit of a Maxwell mode with a solvent whose stress at the start is not known.

    In steady alternation at one frequency it is a solid to the last digit, whatever its time, and
    a record that is taken for one from rest does not say which.
    """
    least = np.inf
    longest = max(float(run.time[-1]) for run in runs)
    recorded = np.concatenate([run.recorded / _sizes(run) for run in runs])
    starts = len(runs)
    for time in np.geomspace(1e-2 * longest, longest, 20):
        columns = np.zeros((len(recorded), 2 + starts))
        first = 0
        for i, run in enumerate(runs):
            rows, size = slice(first, first + len(run)), _sizes(run)
            columns[rows, 0], columns[rows, 1] = _relaxing(run, time) / size, run.rate / size
            columns[rows, 2 + i] = np.exp(-run.time / time)
            first += len(run)
        lowest = np.append(np.zeros(2), np.full(starts, -np.inf))
        found = lsq_linear(columns, recorded, (lowest, np.full(2 + starts, np.inf)))
        least = min(least, 2.0 * found.cost / len(recorded))
    return max(least, 1e-20)


# words --------------------------------------------------------------------------------------------

# What a material is, its name for readers, and its constants with their units
_NAMES: dict[str, tuple[Kind, str, dict[str, str]]] = {
    "newtonian": ("viscous", "viscous fluid (Newtonian)", {"viscosity_Pa_s": "Pa s"}),
    "herschel_bulkley": (
        "yield_stress", "yield-stress fluid (Herschel–Bulkley)",
        {"yield_stress_Pa": "Pa", "consistency_Pa_sn": "Pa sⁿ", "flow_index": "1"},
    ),
    "power_law": (
        "viscous", "viscous fluid (power law)", {"consistency_Pa_sn": "Pa sⁿ", "flow_index": "1"},
    ),
    "carreau_yasuda": (
        "viscous", "viscous fluid (Carreau–Yasuda)",
        {"zero_shear_viscosity_Pa_s": "Pa s", "infinite_shear_viscosity_Pa_s": "Pa s",
         "critical_time_s": "s", "flow_index": "1", "sharpness": "1"},
    ),
    "kelvin_voigt": (
        "solid", "solid (Kelvin–Voigt)", {"elastic_modulus_Pa": "Pa", "viscosity_Pa_s": "Pa s"},
    ),
}  # fmt: skip

_LATEX: dict[str, Callable[[Sequence[str]], str]] = {
    "newtonian": lambda v: rf"\sigma_{{12}} = \eta\,\dot\gamma, \qquad \eta = {v[0]}",
    "herschel_bulkley": lambda v: (
        r"|\sigma_{12}| = \tau_y + K|\dot\gamma|^n\ \mathrm{where}\ |\sigma_{12}| > \tau_y,\quad "
        r"\dot\gamma = 0\ \mathrm{elsewhere}, \qquad "
        rf"\tau_y = {v[0]},\; K = {v[1]},\; n = {v[2]}"
    ),
    "power_law": lambda v: (
        r"\sigma_{12} = K|\dot\gamma|^{n-1}\dot\gamma, \qquad "
        rf"K = {v[0]},\; n = {v[1]}"
    ),
    "carreau_yasuda": lambda v: (
        r"\sigma_{12} = \left(\eta_\infty + (\eta_0 - \eta_\infty)"
        r"(1 + (k|\dot\gamma|)^a)^{(n-1)/a}\right)\dot\gamma, \qquad "
        rf"\eta_0 = {v[0]},\; \eta_\infty = {v[1]},\; k = {v[2]},\; n = {v[3]},\; a = {v[4]}"
    ),
    "kelvin_voigt": lambda v: (
        rf"\sigma_{{12}} = G\gamma + \eta\,\dot\gamma, \qquad G = {v[0]},\; \eta = {v[1]}"
    ),
}

_PYTHON: dict[str, Callable[[Sequence[str]], str]] = {
    "newtonian": lambda v: f"def stress(rate):\n    return {v[0]} * rate\n",
    "herschel_bulkley": lambda v: (
        f"def stress(rate):\n    # of a rate above zero; no flow up to a stress of {v[0]} Pa\n"
        f"    return {v[0]} + {v[1]} * rate ** {v[2]}\n"
    ),
    "power_law": lambda v: (
        f"def stress(rate):\n    return {v[0]} * abs(rate) ** ({v[1]} - 1) * rate\n"
    ),
    "carreau_yasuda": lambda v: (
        "def stress(rate):\n"
        f"    thinned = (1 + ({v[2]} * abs(rate)) ** {v[4]}) ** (({v[3]} - 1) / {v[4]})\n"
        f"    return ({v[1]} + ({v[0]} - {v[1]}) * thinned) * rate\n"
    ),
    "kelvin_voigt": lambda v: (
        f"def stress(strain, rate):\n    return {v[0]} * strain + {v[1]} * rate\n"
    ),
}


# rheoTool's type and entries, in the order of the constants   [tree ``of90``, folder ``GNF``]
_RHEOTOOL: dict[str, tuple[str, dict[str, str]]] = {
    "newtonian": ("Newtonian", {"eta": "viscosity"}),
    # k has the dimensions of a viscosity there, its rate being counted in 1/s
    "herschel_bulkley": ("HerschelBulkley", {"tau0": "stress", "k": "viscosity", "n": "number"}),
    "power_law": ("PowerLaw", {"k": "viscosity", "n": "number"}),
    "carreau_yasuda": (
        "CarreauYasuda",
        {"eta0": "viscosity", "etaInf": "viscosity", "k": "time", "n": "number", "a": "number"},
    ),
}

_CAPS = {"herschel_bulkley": "eta0", "power_law": "etaMax"}  # Entry of a largest viscosity


def material_of(
    law: str,
    values: Sequence[float] | Values,
    ci95: Sequence | np.ndarray,
    error: float,
    onset: float | None = None,
) -> SimpleMaterial:
    """Return a simple material of its constants, with their 95 % intervals and its misfit."""
    kind, title, names = _NAMES[law]
    constants = tuple(
        Constant(name, float(value), (float(low), float(high)), unit)
        for (name, unit), value, (low, high) in zip(names.items(), values, ci95, strict=True)
    )
    latex = _LATEX[law]([f"{value:.6g}" for value in values])
    return SimpleMaterial(
        kind, title, law, constants, error, latex.partition(r", \qquad ")[0], latex, onset
    )
