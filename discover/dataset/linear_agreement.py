"""Whether a linear sweep predicts relaxation and creep, as one spectrum has to."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float
from scipy.special import exprel

from discover.dataset import units
from discover.dataset.linear_viscoelasticity import (
    LinearSweep,
    RelaxationSpectrum,
    relaxation_spectrum,
)
from discover.dataset.load import TESTS_FILE
from discover.dataset.material_functions import COMPLIANCE, RELAXATION_MODULUS
from discover.dataset.table import read_table

AGREES = 0.1
"""Root-mean-square relative error up to which two linear tests agree: two loadings and two kinds of
test rarely differ by less than some per cent."""

_QUANTITIES = {"relaxation": RELAXATION_MODULUS, "creep": COMPLIANCE}
_FEWEST = 3

Values = Float[np.ndarray, " n"]


@dataclass(frozen=True)
class Agreement:
    """How well the modes of a sweep predict another linear test.

    Attributes
    ----------
    test
        ``relaxation`` or ``creep``.
    celsius
        Temperature of both.
    error
        Root-mean-square relative error of the prediction over the times that the sweep reaches.
    bias
        Mean relative error over them: a gain of one of the two shows here.
    times
        First and last of those times, in s.
    """

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


def relaxation_modulus(spectrum: RelaxationSpectrum, time: Values) -> Values:
    """Return G(t) = Σ G_k exp(−t/λ_k) in Pa at times in s."""
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


def linear_agreements(root: Path, sweeps: Mapping[float, LinearSweep]) -> list[Agreement]:
    """Return how well each sweep predicts the relaxation and creep at its temperature.

    Times from 1/ω of the largest to that of the smallest frequency are compared: the modes of a
    sweep say nothing of others.

    Parameters
    ----------
    root
        Folder whose ``tests.csv`` lists the tests.
    sweeps
        By temperature in °C.

    Raises
    ------
    InputError
        If a file is wrong.
    """
    index = read_table(root / TESTS_FILE)
    degrees = index.numbers("temperature_C")
    found = []
    for row, test in enumerate(index.columns["test"]):
        celsius = float(degrees[row])
        name = index.columns["file"][row]
        if test not in _QUANTITIES or celsius not in sweeps or Path(name).name != name:
            continue
        table = read_table(root / name)
        time, measured = table.required(units.TIME), table.required(_QUANTITIES[test])
        omega = sweeps[celsius].angular_frequency
        inside = (time >= 1.0 / omega[-1]) & (time <= 1.0 / omega[0]) & (measured > 0.0)
        if np.sum(inside) < _FEWEST:
            continue
        spectrum = relaxation_spectrum(sweeps[celsius])
        predict = relaxation_modulus if test == "relaxation" else creep_compliance
        error = predict(spectrum, time[inside]) / measured[inside] - 1.0
        size, bias = float(np.sqrt(np.mean(error**2))), float(np.mean(error))
        ends = float(time[inside].min()), float(time[inside].max())
        found.append(Agreement(test, celsius, size, bias, ends))
    return found
