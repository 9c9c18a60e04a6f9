"""What a free function of one variable may depend on, and what it does to records."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from discover.dataset import Run
from discover.inference.engine.rows import Rows

_LATE = (0.0, 0.15, 0.3, 0.45, 0.6, 0.7, 0.8, 0.9, 1.0)
_EARLY = (0.0, 0.02, 0.05, 0.1, 0.18, 0.3, 0.45, 0.65, 0.85)
"""Where the slope changes, over the largest value: what saturates does so at the end of a range,
what settles at its beginning."""

KNOTS = len(_LATE)


@dataclass(frozen=True)
class Variable:
    """What a function depends on, and what it does to a record.

    Attributes
    ----------
    slot, name, unit
        Of the function, as the contract names it: ``recorded_stress``, ``rate``, ``drift`` or
        ``network``.
    values
        At each row; None for the stress, which is that of the fluid as predicted.
    largest
        In the fitted runs.
    is_factor
        Whether the stress is multiplied.
    """

    slot: str
    name: str
    unit: str
    values: Float[np.ndarray, " rows"] | None
    largest: float
    is_factor: bool = False

    @property
    def is_odd(self) -> bool:
        """Whether the function changes its sign with that of its variable."""
        return self.slot in ("recorded_stress", "rate")

    def basis(self, values: Float[np.ndarray, " n"]) -> Float[np.ndarray, "n knots"]:
        """Return what one change of slope at each knot is at some values."""
        x = np.abs(values) / self.largest
        hinges = np.maximum(x[:, None] - np.array(_LATE if self.is_odd else _EARLY), 0.0)
        return hinges * np.sign(values)[:, None] if self.is_odd else hinges

    def columns(self, predicted: Float[np.ndarray, " rows"], size: Float[np.ndarray, " rows"]):
        """Return what one of each does to the records, in Pa."""
        along = predicted if self.values is None else self.values
        scale = predicted if self.is_factor else np.sqrt(np.mean(size**2))
        return self.basis(along) * np.broadcast_to(scale, predicted.shape)[:, None]


def variables(rows: Rows) -> Iterator[Variable]:
    """Return what a function of runs in shear may depend on."""
    runs = rows.runs

    def of(slot: str, name: str, unit: str, values, is_factor: bool = False) -> Variable:
        return Variable(slot, name, unit, values, float(np.max(np.abs(values))), is_factor)

    largest = float(np.max(np.abs(rows.recorded)))
    yield Variable("recorded_stress", "stress", "Pa", None, largest)
    rates, times, strains = (
        np.concatenate([one(run) for run in runs])
        for one in (lambda r: np.asarray(r.rate), lambda r: np.asarray(r.time), _strain)
    )
    if len(np.unique(np.abs(rates))) > KNOTS:
        yield of("rate", "shear rate", "1/s", rates)
    yield of("drift", "time", "s", times)
    yield of("network", "strain", "", strains, True)


def _strain(run: Run) -> Float[np.ndarray, " n"]:
    """Return the strain at each sample, from rest."""
    time, rate = np.asarray(run.time), np.asarray(run.rate)
    steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(time)
    return rate[0] * time[0] + np.concatenate([[0.0], np.cumsum(steps)])


def closed_forms(slot: str, x: Float[np.ndarray, " n"], inner: float) -> dict[str, np.ndarray]:
    """Return closed forms of a slot, x and their inner constant over the largest value."""
    if slot == "recorded_stress":
        return {"clipped": np.maximum(x - inner, 0.0), "cubic": x**3}
    if slot == "slip":
        return {"quadratic": x**2, "cubic": x**3}
    if slot == "rate":
        return {"linear": x, "quadratic": x**2}
    return {"exponential": -np.expm1(-x / max(inner, 1e-3)), "linear": x}
