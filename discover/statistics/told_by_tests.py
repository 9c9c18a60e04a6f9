"""How well tests of each kind determine constants and predictions, alone and together."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from scipy.stats import t as student

from discover.statistics.noise.covariance import least_squares_covariance


@dataclass(frozen=True)
class Told:
    """Half of the 95 % interval of one number over its size, by the tests that were fitted.

    `name`: what the number is.
    `together`: by all tests.
    `alone`: by the tests of each kind, if there had been no others.
    `without`: by all others than those of each kind.
    """

    name: str
    together: float
    alone: Mapping[str, float]
    without: Mapping[str, float]

    @classmethod
    def from_json(cls, row: Mapping[str, Any]) -> "Told":
        """Return what JSON holds, in which None stands for an infinite half-width."""

        def halves(of: Mapping[str, float | None]) -> dict[str, float]:
            return {kind: _number(half) for kind, half in of.items()}

        return cls(
            row["name"], _number(row["together"]), halves(row["alone"]), halves(row["without"])
        )


@dataclass(frozen=True)
class Sized:
    """Numbers that follow from the parameters, to first order.

    `name`: what they are.
    `slopes`: their derivatives in each parameter over their root-mean-square, shape (n, p).
    """

    name: str
    slopes: Float[np.ndarray, "n p"]


def told_by_tests(
    columns: Float[np.ndarray, "rows p"],
    residual: Float[np.ndarray, " rows"],
    sequences: Sequence[Int[np.ndarray, " _"]],
    kinds: Sequence[str],
    numbers: Sequence[Sized],
    shared: Float[np.ndarray, "rows k"] | None,
    sizes: Sequence[float] | None = None,
) -> tuple[Told, ...]:
    """Return what tests of each kind tell, at the fit to all; nothing where all are of one kind.

    The law and its linearisation are those of the fit to all tests; the noise is that which the
    records of each kind show. So a half-width says what the tests of a kind would leave of a law
    that is known to be this one.

    `columns`, `residual`, `sequences`, `shared`, `sizes`: as `least_squares_covariance` takes them.
    `kinds`: the kind of test of each sequence. `numbers`: constants and predictions to judge.
    """
    different = list(dict.fromkeys(kinds))
    if len(different) < 2 or not columns.shape[1]:
        return ()

    def halves(wanted: Sequence[str]) -> list[float]:
        kept = [i for i, kind in enumerate(kinds) if kind in wanted]
        rows = [sequences[i] for i in kept]
        at = np.concatenate(rows)
        ends = np.cumsum([len(own) for own in rows])
        places = np.split(np.arange(len(at)), ends[:-1])
        own = None if shared is None else shared[at]
        of_noise = None if sizes is None else [sizes[i] for i in kept]
        covariance, _, noise = least_squares_covariance(
            columns[at], residual[at], places, own, of_noise
        )
        free = noise.effective_samples - columns.shape[1]
        if free < 1.0 or not np.all(np.isfinite(covariance)):
            return [np.inf] * len(numbers)
        quantile = float(student.ppf(0.975, free))
        found = []
        for one in numbers:
            variance = np.einsum("np,pq,nq->n", one.slopes, covariance, one.slopes)
            half = quantile * float(np.sqrt(np.mean(np.clip(variance, 0.0, None))))
            found.append(half if half < 1.0 else np.inf)
        return found

    together = halves(different)
    alone = {kind: halves([kind]) for kind in different}
    without = {kind: halves([other for other in different if other != kind]) for kind in different}
    return tuple(
        Told(
            one.name,
            together[i],
            {kind: of[i] for kind, of in alone.items()},
            {kind: of[i] for kind, of in without.items()},
        )
        for i, one in enumerate(numbers)
    )


def _number(half: float | None) -> float:
    return np.inf if half is None else half
