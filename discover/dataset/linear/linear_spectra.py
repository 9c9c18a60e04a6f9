"""A spectrum from any linear test, and whether it predicts the others."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Float
from scipy.optimize import nnls
from scipy.special import exprel

from discover.dataset.linear.linear_tests import RELAXATION, SWEEP, LinearTest, Tests
from discover.dataset.linear_viscoelasticity import (
    FLOOR,
    MOST_MODES,
    RelaxationSpectrum,
    relaxation_spectrum,
)
from discover.errors import InputError
from discover.statistics.noise.noise_model import rms

_STIFFEST = 1e3
"""Times the largest modulus that a compliance shows at once, of a compliance that fits without one:
what is faster than its first sample it does not see."""

Values = Float[np.ndarray, " n"]

_MARGINS = (0.0, 0.25, 0.5)
"""Decades by which relaxation times go beyond the samples."""

_TOLERANCE = 1.5
"""How much worse than the best a spectrum may be, as a factor."""

_FASTER = 1e-3
"""Of one over the highest frequency: the time of a mode that stands for a solvent."""


def spectrum_of(test: LinearTest) -> RelaxationSpectrum:
    """Return the modes of a linear test, the fewest that fit nearly as well as any."""
    if test.kind == SWEEP:
        return relaxation_spectrum(test.sweep)
    fit = _from_relaxation if test.kind == RELAXATION else _from_creep
    return _fewest_modes(partial(fit, test), min(MOST_MODES, len(test) // 2))


def _fewest_modes(
    fit: Callable[[int, float], tuple[np.ndarray, np.ndarray, float]], most: int
) -> RelaxationSpectrum:
    """Return the spectrum with the fewest modes of those that fit nearly as well as any."""
    trials = [fit(n, margin) for n in range(1, most + 1) for margin in _MARGINS[: 2 * n]]
    best = min(error for _, _, error in trials)
    errors: dict[int, float] = {}
    for modulus, _, error in trials:
        errors[len(modulus)] = min(error, errors.get(len(modulus), np.inf))
    within = [trial for trial in trials if trial[2] <= max(_TOLERANCE * best, FLOOR)]
    modulus, relaxation_time, error = min(within, key=lambda trial: (len(trial[0]), trial[2]))
    return RelaxationSpectrum(modulus, relaxation_time, error, best, dict(sorted(errors.items())))


def predicted(spectrum: RelaxationSpectrum, kind: str, argument: Values) -> np.ndarray:
    """Return what a spectrum says of a kind of test, shape as the values of one.

    `spectrum`: the modes. `kind`: ``lve``, ``relaxation`` or ``creep``. `argument`: frequencies in
    rad/s or times in s.
    """
    if kind == SWEEP:
        return np.stack(spectrum.moduli(argument))
    of = relaxation_modulus if kind == RELAXATION else creep_compliance
    return of(spectrum, argument)[None]


def relaxation_modulus(spectrum: RelaxationSpectrum, time: Values) -> Values:
    """Return G(t) = Σ G_k exp(−t/λ_k) in Pa at times in s; a solvent has none after t = 0."""
    return np.exp(-time[:, None] / spectrum.relaxation_time) @ spectrum.modulus


def creep_compliance(spectrum: RelaxationSpectrum, time: Values) -> Values:
    """Return J(t) in 1/Pa at times in s: the creep of Maxwell elements side by side.

    Under a unit stress the stresses of the elements obey s_k' = −s_k/λ_k + g_k Σ s_j/λ_j, where
    g_k = G_k/ΣG; scaled by (g_k λ_k)^½ the matrix is symmetric, and its modes are those of
    retardation, one of them steady flow   [Ferry 1980, Viscoelastic Properties of Polymers, ch. 3].
    """
    total = float(np.sum(spectrum.modulus))
    share = np.sqrt(spectrum.modulus / total / spectrum.relaxation_time)
    rates, modes = np.linalg.eigh(np.outer(share, share) - np.diag(1 / spectrum.relaxation_time))
    weights = (share @ modes) ** 2
    # one rate is zero but for rounding
    growth = time[:, None] * exprel(np.minimum(rates, 0.0) * time[:, None])
    return (1.0 + growth @ weights) / total


def modes_of_retardation(
    instant: float, fluidity: float, compliance: Values, retardation_time: Values
) -> tuple[np.ndarray, np.ndarray]:
    """Return moduli in Pa and relaxation times in s of J(t) = J_g + Σ J_k (1 − exp(−t/τ_k)) + t/η.

    At a constant strain the strains of the retarded elements obey e_k' = J_k σ/τ_k − e_k/τ_k, that
    of the dashpot e' = σ/η, and σ is what J_g leaves of the strain; scaled by the roots of J_k/τ_k
    and 1/η the matrix is symmetric, and its modes are those of relaxation   [Ferry 1980,
    Viscoelastic Properties of Polymers, ch. 3; the inverse of `creep_compliance`].

    `instant`: J_g in 1/Pa, positive. `fluidity`: 1/η in 1/(Pa s). `compliance`, `retardation_time`:
    J_k in 1/Pa and τ_k in s.
    """
    there = compliance > 0.0
    rates = 1.0 / retardation_time[there]
    share = np.sqrt(np.append(compliance[there] * rates, [fluidity] if fluidity > 0.0 else []))
    decay = np.append(rates, [0.0] if fluidity > 0.0 else [])
    if not len(share):
        return np.array([1.0 / instant]), np.array([np.inf])
    speeds, modes = np.linalg.eigh(np.diag(decay) + np.outer(share, share) / instant)
    moduli = (share @ modes) ** 2 / instant**2 / speeds
    order = np.argsort(1.0 / speeds)
    return moduli[order], (1.0 / speeds)[order]


def _grid(test: LinearTest, n: int, margin: float) -> np.ndarray:
    shortest, longest = test.argument[0] * 10.0**-margin, test.argument[-1] * 10.0**margin
    return np.geomspace(shortest, longest, n) if n > 1 else np.array([(shortest * longest) ** 0.5])


def _solve(test: LinearTest, design: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the non-negative amplitudes of curves, and their relative misfit."""
    values = test.values[0]
    weight = FLOOR / np.hypot(FLOOR, test.spread)  # averages that scatter count less
    design = weight[:, None] * design / values[:, None]
    scale = np.linalg.norm(design, axis=0)
    found, left = nnls(design / scale, weight, maxiter=100 * len(scale) + 100)
    return found / scale, float(left / np.linalg.norm(weight))


def _from_relaxation(test: LinearTest, n: int, margin: float):
    times = _grid(test, n, margin)
    modulus, error = _solve(test, np.exp(-test.argument[:, None] / times))
    keep = modulus > 0
    return modulus[keep], times[keep], error


def _from_creep(test: LinearTest, n: int, margin: float):
    times, t = _grid(test, n, margin), test.argument[:, None]
    found, error = _solve(test, np.hstack([np.ones_like(t), t, -np.expm1(-t / times)]))
    instant = max(found[0], test.values.min() / _STIFFEST)
    modulus, time = modes_of_retardation(instant, found[1], found[2:], times)
    # of a solid some of the modulus never relaxes, and stays over all times measured
    return modulus, np.minimum(time, 1e6 * test.argument[-1]), error


AGREES = 0.1
"""Root-mean-square relative error up to which two linear tests agree: two loadings and two kinds of
test rarely differ by less than some per cent."""

_FEWEST = 4


@dataclass(frozen=True)
class Agreement:
    """How well the modes of one linear test predict another.

    `source`: the test that the modes come from: ``lve``, ``relaxation`` or ``creep``.
    `test`: the one predicted.
    `celsius`: temperature of both.
    `error`: root-mean-square relative error of the prediction over the times that the source
        reaches.
    `bias`: mean relative error over them: a gain of one of the two shows here.
    `times`: first and last of those times in s, 1/ω for a sweep.
    """

    source: str
    test: str
    celsius: float
    error: float
    bias: float
    times: tuple[float, float]

    @property
    def left(self) -> float:
        """What would be left of the error, were the prediction divided by one factor."""
        return float(np.sqrt(max(self.error**2 - self.bias**2, 0.0)) / (1.0 + self.bias))

    @property
    def agrees(self) -> bool:
        """Whether the error is up to `AGREES`."""
        return self.error <= AGREES


def linear_agreements(tests: Tests) -> list[Agreement]:
    """Return how well each test predicts each other one at its temperature.

    Times that both reach are compared, 1/ω of a frequency: the modes of a test say nothing of
    others.

    `tests`: by kind and temperature in °C, as measured or as moved to one.
    """
    spectra = {}
    found = []
    for source, test in ((a, b) for a in tests for b in tests if a != b):
        for celsius in sorted(set(tests[source]) & set(tests[test])):
            one, other = tests[source][celsius], tests[test][celsius]
            inside = _shared(one, other)
            if np.sum(inside) < _FEWEST:
                continue
            if (source, celsius) not in spectra:
                spectra[source, celsius] = _modes(one)
            spectrum = spectra[source, celsius]
            if spectrum is None:
                continue
            argument = other.argument[inside]
            error = predicted(spectrum, test, argument) / other.values[:, inside] - 1.0
            size, bias = rms(error), float(np.mean(error))
            seen = _times(other)[inside]
            ends = float(seen.min()), float(seen.max())
            found.append(Agreement(source, test, celsius, size, bias, ends))
    return found


def _modes(test: LinearTest):
    try:
        return spectrum_of(test)
    except InputError:  # too few samples, or moduli that no modes have
        return None


def _times(test: LinearTest) -> np.ndarray:
    return 1.0 / test.argument if test.kind == SWEEP else test.argument


def _shared(one: LinearTest, other: LinearTest) -> np.ndarray:
    reached, times = _times(one), _times(other)
    slack = 1.0 + 1e-9  # of 1/ω
    return (times >= reached.min() / slack) & (times <= reached.max() * slack)
