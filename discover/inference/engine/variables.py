"""What a free function of one variable may depend on, and what it does to records."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from discover.effects import EffectParameter, SeriesElement
from discover.inference.engine.closed_forms import integrated_rate
from discover.inference.engine.rows import Rows

_LATE = (0.0, 0.15, 0.3, 0.45, 0.6, 0.7, 0.8, 0.9, 1.0)
_EARLY = (0.0, 0.02, 0.05, 0.1, 0.18, 0.3, 0.45, 0.65, 0.85)
"""Where the slope changes, over the largest value: what saturates does so at the end of a range,
what settles at its beginning."""

KNOTS = len(_LATE)

_LAGS = 32
"""Samples over which a transducer may respond."""

_DECAY = 0.25
"""Of these, within which its response decays."""


@dataclass(frozen=True)
class Variable:
    """What a function depends on, and what it does to a record.

    `slot`, `name`, `unit`: of the function, as the contract names it: ``recorded_stress``,
    ``rate``, ``drift`` or ``network``. `values`: at each row; None for the stress, which is that of
    the fluid as predicted. `largest`: in the fitted runs. `is_factor`: whether the stress is
    multiplied.
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

    def grid(self, predicted: Float[np.ndarray, " rows"], points: int) -> Float[np.ndarray, " n"]:
        """Return values at which to show the function."""
        along = np.abs(predicted if self.values is None else self.values)
        low = 0.0 if self.is_odd else float(np.min(along))
        return np.linspace(low, float(np.max(along)), points)

    def columns(self, predicted: Float[np.ndarray, " rows"], size: Float[np.ndarray, " rows"]):
        """Return what one of each does to the records, in Pa."""
        along = predicted if self.values is None else self.values
        scale = predicted if self.is_factor else np.sqrt(np.mean(size**2))
        return self.basis(along) * np.broadcast_to(scale, predicted.shape)[:, None]

    def change(
        self,
        slopes: Float[np.ndarray, "rows m"],
        predicted: Float[np.ndarray, " rows"],
        size: Float[np.ndarray, " rows"],
        sizes: Float[np.ndarray, " knots"],
    ) -> Float[np.ndarray, "rows m"]:
        """Return what becomes of derivatives of the stress, behind those of the stress itself."""
        if self.values is not None and not self.is_factor:
            return np.zeros_like(slopes)
        step = 1e-6
        moved = self.columns(predicted * (1.0 + step), size) - self.columns(predicted, size)
        change = moved @ sizes / np.where(predicted == 0.0, np.inf, step * predicted)
        return change[:, None] * slopes


@dataclass(frozen=True)
class Response(Variable):
    """The response of a transducer: a record holds the stress of some time ago.

    Weights of lags decay with the lag and change smoothly on the way, as those of a stable linear
    system do   [Chen, Ohlsson & Ljung 2012, Automatica 48, 1525: the TC kernel].

    `before`, `after`: at each row and lag: the rows before and after that time in the same run; -1
    is at rest. `share`: how far that time lies on the way to the next row. `root`: what one of each
    coefficient adds to the weight of each lag.
    """

    before: Int[np.ndarray, "rows lags"] = None  # type: ignore[assignment]  # `of` sets them
    after: Int[np.ndarray, "rows lags"] = None  # type: ignore[assignment]
    share: Float[np.ndarray, "rows lags"] = None  # type: ignore[assignment]
    root: Float[np.ndarray, "lags knots"] = None  # type: ignore[assignment]

    @classmethod
    def of(cls, rows: Rows) -> "Response":
        """Return the response over some samples, of runs that begin at rest."""
        times = [np.asarray(run.time) / run.clock_factor for run in rows.runs]
        step = float(np.median(np.concatenate([np.diff(own) for own in times])))
        lags = step * np.arange(1, _LAGS + 1)
        before, after, share, first = [], [], [], 0
        for own in times:
            asked = own[:, None] - lags
            known = np.append(0.0, own)  # at rest, and at the samples
            at = np.clip(np.searchsorted(known, asked, "right") - 1, 0, len(own) - 1)
            width = known[at + 1] - known[at]
            width[width == 0.0] = np.inf  # where the first sample is at rest itself
            share.append(np.clip((asked - known[at]) / width, 0.0, 1.0))
            before.append(np.where(at > 0, first + at - 1, -1))
            after.append(first + at)
            first += len(own)
        decay = np.exp(-np.maximum.outer(lags, lags) / (_DECAY * lags[-1]))
        values, directions = np.linalg.eigh(decay)
        root = (directions * np.sqrt(np.maximum(values, 0.0)))[:, : -KNOTS - 1 : -1]
        return cls(
            "response", "time before", "s", None, float(lags[-1]), True,
            np.concatenate(before), np.concatenate(after), np.concatenate(share), root,
        )  # fmt: skip

    def basis(self, values: Float[np.ndarray, " n"]) -> Float[np.ndarray, "n knots"]:
        """Return the weight of lags in s, over a second, of one of each coefficient."""
        lags = self.largest * np.arange(1, _LAGS + 1) / _LAGS
        return np.array([np.interp(values, lags, one) for one in self.root.T]).T / lags[0]

    def grid(self, predicted: Float[np.ndarray, " rows"], points: int) -> Float[np.ndarray, " n"]:
        """Return lags in s."""
        del predicted
        return np.linspace(self.largest / _LAGS, self.largest, points)

    def _lagged(self, values: Float[np.ndarray, "rows m"]) -> Float[np.ndarray, "rows lags m"]:
        """Return values of some time ago, less those of now."""
        share = self.share[..., None]
        earlier = np.where(self.before[..., None] < 0, 0.0, values[self.before])
        return earlier * (1.0 - share) + values[self.after] * share - values[:, None]

    def columns(self, predicted: Float[np.ndarray, " rows"], size: Float[np.ndarray, " rows"]):
        """Return what one of each does to the records, in Pa."""
        del size
        return self._lagged(predicted[:, None])[..., 0] @ self.root

    def change(self, slopes, predicted, size, sizes):
        """Return what becomes of derivatives of the stress, behind those of the stress itself."""
        del predicted, size
        return np.einsum("rlm,l->rm", self._lagged(slopes), self.root @ sizes)


def variables(rows: Rows) -> Iterator[Variable]:
    """Return what a function of runs in shear may depend on."""
    runs = rows.runs

    def of(slot: str, name: str, unit: str, values, is_factor: bool = False) -> Variable:
        return Variable(slot, name, unit, values, float(np.max(np.abs(values))), is_factor)

    largest = float(np.max(np.abs(rows.recorded)))
    yield Variable("recorded_stress", "stress", "Pa", None, largest)
    rates, times, strains = (
        np.concatenate([one(run) for run in runs])
        for one in (lambda r: np.asarray(r.rate), lambda r: np.asarray(r.time), integrated_rate)
    )
    if len(np.unique(np.abs(rates))) > KNOTS:
        yield of("rate", "shear rate", "1/s", rates)
    yield of("drift", "time", "s", times)
    yield of("network", "strain", "", strains, True)
    if len(rows) > len(runs) and all(float(run.protocol.begins) == 0.0 for run in runs):
        yield Response.of(rows)


def closed_forms(slot: str, x: Float[np.ndarray, " n"], inner: float) -> dict[str, np.ndarray]:
    """Return closed forms of a slot, x and their inner constant over the largest value."""
    if slot == "recorded_stress":
        return {"clipped": np.maximum(x - inner, 0.0), "cubic": x**3}
    if slot == "response":
        return {"exponential": np.exp(-x / max(inner, 1e-3))}
    if slot == "slip":
        return {"quadratic": x**2, "cubic": x**3}
    if slot == "rate":
        return {"linear": x, "quadratic": x**2}
    return {"exponential": -np.expm1(-x / max(inner, 1e-3)), "linear": x}


class SlipCurve(SeriesElement):
    """Slip s(σ), straight lines between some stresses; at stress zero there is none.

    It stands for any law of slip that is not in proportion to the stress: that of melts goes with
    its second or third power [Hatzikiriakos 2012, Prog. Polym. Sci. 37, 624].
    """

    bends: ClassVar[tuple[float, ...]] = (0.0, 0.8, 1.6)
    """Where the slope changes, over the typical stress."""

    def basis(
        self, stress: Float[np.ndarray, " n"], typical: float
    ) -> Float[np.ndarray, "n bends"]:
        """Return what slip takes at stresses in Pa, of one of each change of slope."""
        size = np.abs(stress)[:, None] / typical
        return stress[:, None] * np.maximum(size - np.array(self.bends), 0.0)

    def slip_and_compliance(self, values):
        """Return 0 and 0: all of it depends on the stress."""
        return jnp.zeros_like(values[0]), jnp.zeros_like(values[0])

    def slip_at(self, values, stress):
        """Return s at a stress in Pa."""
        size = jnp.abs(stress) / values[-1]
        changes = zip(values[:-1], self.bends, strict=True)
        return sum(change * jnp.maximum(size - at, 0.0) for change, at in changes)


def _slope(number: int) -> EffectParameter:
    return EffectParameter(
        f"slope_{number}", f"s_{number}", "1/(Pa s)", scale="fluidity", first_trial=0.0,
        range_source="a change of slope may have either sign",
    )  # fmt: skip


SLIP_CURVE = SlipCurve(
    name="slip_curve",
    parameters=(
        *map(_slope, range(1, len(SlipCurve.bends) + 1)),
        EffectParameter(
            "typical_stress", r"\sigma_0", "Pa", low=0.0, scale="stress", first_trial=1.0,
            range_source="the size of the records",
        ),
    ),
    equation=r"\dot\gamma_\mathrm{felt} = \dot\gamma - s(\sigma)\,\sigma",
    source="Yoshimura & Prud'homme 1988, J. Rheol. 32, 53",
    check="Repeat with another gap H: slip goes as 1/H; roughen the plates.",
)  # fmt: skip
