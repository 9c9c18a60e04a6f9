"""Directions in the space of coefficients that data see little or nothing of."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from discover.identify.exact.relations import spell_briefly
from discover.words import percent_of

EXACT = 1e-13
"""Singular value, relative to the largest of unit columns, that counts as zero.

Linear identities commute with Runge–Kutta steps, so exact directions come out at rounding error,
1e-16, and the weakest others well above."""

_ENTRY = 1e-7

_WEAKEST = 5
"""Directions that are not exact, of which no more are told."""


@dataclass(frozen=True)
class Direction:
    """A change of the law's coefficients, its largest entry one.

    `noise_for_tenth`: relative noise of the data at which the standard error along the direction is
        0.1, zero for an exact one: with less noise the data determine it better.
    `changes`: relative change of σ12, N1 and N2 per unit of the direction; N2's relative to N1.
    `at_any_size`: whether a finite step along the direction leaves σ12 as it is too; None where not
        decided. Where it does not, the invisible changes of the law lie on a curve (as the twins of
        Johnson–Segalman do) that has this direction as its tangent.
    """

    coefficients: Mapping[str, float]  # term → entry
    exact: bool  # whether the observed stresses do not change at all, to first order
    noise_for_tenth: float
    changes: Mapping[str, float]
    at_any_size: bool | None = None

    @property
    def text(self) -> str:
        """One sentence for a reader."""
        what = spell_briefly(self.coefficients)
        seen = [
            f"{name} ({self.changes[name]:.2g})"
            for name in ("N1", "N2")
            if self.changes[name] > 1e-6
        ]
        touched = f"it changes {' and '.join(seen)}" if seen else "it changes neither N1 nor N2"
        if self.exact:
            return f"The data see nothing of {what}; {touched}."
        return (
            f"{what} is known to 0.1 only with noise below "
            f"{percent_of(self.noise_for_tenth)}; {touched}."
        )

    def to_json(self) -> dict[str, Any]:
        """Return the direction as JSON-able values."""
        return {**asdict(self), "text": self.text}


def weak_directions(
    names: Sequence[str],
    observed: Float[np.ndarray, "rows n"],
    quantities: Mapping[str, Float[np.ndarray, "_ n"]],
    n_observations: int,
) -> tuple[list[Direction], list[Direction]]:
    """Return the exact null directions and the weakest of the others.

    `names`: of the coefficients. `observed`: sensitivities of what is observed, weighted so that
    the norm of a column is the relative root-mean-square change per unit of the coefficient.
    `quantities`: sensitivities of each quantity, weighted alike. `n_observations`: number of values
    observed, each with independent noise.
    """
    norms = np.linalg.norm(observed, axis=0)
    scale = np.where(norms > EXACT * np.max(norms, initial=1.0), norms, 1.0)
    _, values, right = np.linalg.svd(observed / scale, full_matrices=True)
    values = np.concatenate([values, np.zeros(right.shape[0] - values.size)])
    null = values <= EXACT * max(values[0], 1e-300)
    exact = [
        _direction(names, vector, observed, quantities, n_observations, True)
        for vector in _sparse_basis(right[null] / scale)
        if np.any(vector)  # of fewer samples than terms, elimination may use a direction up
    ]
    near = [
        _direction(names, vector / scale, observed, quantities, n_observations, False)
        for vector in right[~null][::-1][:_WEAKEST]
    ]
    return exact, near


def _direction(names, vector, observed, quantities, n_observations, exact) -> Direction:
    vector = vector / vector[np.argmax(np.abs(vector))]
    signal = float(np.linalg.norm(observed @ vector))
    return Direction(
        {
            names[i]: float(np.round(vector[i], 12))
            for i in np.flatnonzero(np.abs(vector) > (_ENTRY if exact else 0.02))
        },
        exact,
        # the standard error of a unit step is noise / (√n · signal)
        0.0 if exact else 0.1 * float(np.sqrt(n_observations)) * signal,
        {key: float(np.linalg.norm(block @ vector)) for key, block in quantities.items()},
    )


def _sparse_basis(rows: Float[np.ndarray, "k n"]) -> Float[np.ndarray, "k n"]:
    """Return a basis of the same space by elimination, later terms first, with many zeros.

    A library lists simple terms first, so each vector expresses one complex term by simpler ones.
    """
    rows = rows / np.max(np.abs(rows), axis=1, keepdims=True, initial=1e-300)
    done: list[int] = []
    for column in range(rows.shape[1] - 1, -1, -1):
        left = [i for i in range(rows.shape[0]) if i not in done]
        if not left:
            break
        pivot = max(left, key=lambda i: abs(rows[i, column]))
        if abs(rows[pivot, column]) < _ENTRY:
            continue
        rows[pivot] = rows[pivot] / rows[pivot, column]
        for i in range(rows.shape[0]):
            if i != pivot:
                rows[i] = rows[i] - rows[i, column] * rows[pivot]
        done.append(pivot)
    rows[np.abs(rows) < _ENTRY] = 0.0
    return rows
