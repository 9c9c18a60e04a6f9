"""Residuals and their derivatives by differences, of vectors side by side."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from discover.forward.batches import Batch

_WIDTH = 1e-5
"""Of a parameter, or of its first trial, by which it is moved."""

_BEYOND = 1e-3
"""By how much a move may lengthen the residuals, whose length is an error over the record."""


class Linearised(NamedTuple):
    """Weighted residuals at one vector, not finite where it diverges, and derivatives.

    The derivatives are by the parameters at `positions`, in their units; behind them stand the
    changes with each move of the moduli.
    """

    residual: Float[np.ndarray, "runs n"]
    jacobian: Float[np.ndarray, "columns runs n"]
    positions: tuple[int, ...]  # in the vector


class Point(NamedTuple):
    """A vector, the parameters to differentiate by, and its residuals where they are known.

    `limit`: sum of squares beyond which the vector is of no use; see `AugmentedModel.residuals`.
    """

    theta: Float[np.ndarray, " p"]
    positions: Sequence[int] = ()
    residual: Float[np.ndarray, "runs n"] | None = None
    limit: float = np.inf

    @property
    def size(self) -> int:
        """How many vectors are predicted for it."""
        return len(self.positions) + (self.residual is None)


def widths_of(
    model: Any, theta: Float[np.ndarray, " p"], positions: Sequence[int]
) -> Float[np.ndarray, " positions"]:
    """Return by how much parameters are moved for a derivative, away from an upper bound."""
    at = list(positions)
    width = _WIDTH * np.maximum(np.abs(theta[at]), model.first_trial[at])
    return np.where(theta[at] + width > model.high[at], -width, width)


def linearised(model: Any, points: Sequence[Point], batch: Batch) -> list[Linearised]:
    """Return residuals and derivatives at several vectors, from one call of an `AugmentedModel`."""
    vectors, limits, widths = [], [], []
    for point in points:
        widths.append(widths_of(model, point.theta, point.positions))
        if point.residual is None:
            vectors.append(point.theta)
        for position, width in zip(point.positions, widths[-1], strict=True):
            moved = point.theta.copy()
            moved[position] += width
            vectors.append(moved)
        limits += [(np.sqrt(point.limit) + _BEYOND) ** 2] * point.size
        if point.residual is None:
            limits[-point.size] = point.limit
    if not vectors:
        none = (np.zeros((0, *np.asarray(point.residual).shape)) for point in points)
        return [_of(*one) for one in zip(points, none, widths, strict=True)]
    known = np.array(limits)
    ended = () if np.all(np.isinf(known)) else (known,)
    found = model.residuals(np.array(vectors), batch, *ended)
    ends = np.cumsum([point.size for point in points])[:-1]
    each = zip(points, np.split(found, ends), widths, strict=True)
    return [_of(point, rows, width) for point, rows, width in each]


def _of(point: Point, rows: np.ndarray, widths: np.ndarray) -> Linearised:
    base, moved = (rows[0], rows[1:]) if point.residual is None else (point.residual, rows)
    with np.errstate(invalid="ignore", over="ignore"):  # what ran away
        jacobian = (moved - base) / widths[:, None, None]
    return Linearised(base, jacobian, tuple(point.positions))
