"""Terms of a library that do to the records what constants to be fitted do."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from discover.comparison.instrument.free_constants import FreeConstants
from discover.effects import AbstractEffect
from discover.errors import InputError
from discover.forward import AugmentedModel, Batch

_TWIN = 0.02
"""Share of a term's signature beyond those of the constants, below which the two are the same."""


def twins_of_constants(
    constants: FreeConstants,
    terms: Sequence[AbstractEffect],
    model: AugmentedModel,
    batch: Batch,
    theta: Float[np.ndarray, " p"],
) -> tuple[str, ...]:
    """Return the names of the terms that the records cannot tell from the constants.

    Parameters
    ----------
    constants
        What is to be fitted.
    terms
        Terms of the library as effects of the model.
    model, batch
        The forward model and the fitted runs.
    theta
        Where signatures are taken.

    Raises
    ------
    InputError
        If these runs cannot tell two of the constants apart.
    """
    at = [model.positions(term.name)[0] for term in terms]
    derivatives = model.linearise(theta, batch, [*constants.free, *at]).jacobian
    rows = derivatives.reshape(len(derivatives), -1)
    count = len(constants.free)
    _require_told_apart(list(constants.positions), rows[:count])
    twins = []
    for term, row in zip(terms, rows[count:], strict=True):
        size = float(np.linalg.norm(row))
        if not np.isfinite(size) or size == 0.0:
            continue
        if np.linalg.norm(_beyond(row, rows[:count])) < _TWIN * size:
            twins.append(term.name)
    return tuple(twins)


def _require_told_apart(names: Sequence[str], constants: Float[np.ndarray, "c rows"]) -> None:
    if len(constants) < 2:
        return
    for i, row in enumerate(constants):
        others = np.delete(constants, i, axis=0)
        if np.linalg.norm(_beyond(row, others)) < _TWIN * np.linalg.norm(row):
            raise InputError(
                f"These runs cannot tell {names[i]} from the other constants that are to be "
                f"fitted ({', '.join(n for n in names if n != names[i])}). Write a number for "
                "one of them in [model]."
            )


def _beyond(
    row: Float[np.ndarray, " rows"], others: Float[np.ndarray, "c rows"]
) -> Float[np.ndarray, " rows"]:
    """Return what a signature has beyond those of others."""
    basis, _ = np.linalg.qr(others.T)
    return row - basis @ (basis.T @ row)
