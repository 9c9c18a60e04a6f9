"""Vectors of parameters of the forward model, and sweeps, that many tests ask for."""

import numpy as np

from discover.dataset import Run
from discover.protocols import oscillations


def vector_of(model, *tried, **values):
    """Return a vector in which some effects have what a search tries first, and some these values.

    Of several parameters the first ones, as many as there are values.
    """
    theta = model.zero()
    for name in tried:
        theta[model.positions(name)] = model.first_trial[model.positions(name)]
    for name, value in values.items():
        theta[model.positions(name)[: np.size(value)]] = value
    return theta


def vectors_of_each(model, names):
    """Return the vector without any effect, and one with each of some."""
    return np.array([model.zero(), *(vector_of(model, name) for name in names)])


def sweep_of(strain, frequency):
    """Return a sweep whose moduli are 1 Pa."""
    ones = np.ones(len(strain))
    return Run(
        "sweep", np.cumsum(ones), oscillations(strain, frequency), strain * frequency, ones,
        strain=strain, storage_modulus=ones, loss_modulus=ones,
    )  # fmt: skip
