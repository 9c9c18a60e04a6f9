"""What a free function of one variable may depend on, and what it does to records."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from discover.dataset import Run
from discover.effects import EffectParameter, SeriesElement
from discover.inference.closed_forms import integrated_rate
from discover.inference.rows import Rows

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
    the fluid as predicted. `largest`: in the fitted runs. `scale`: root mean square of the fitted
    records in Pa, in which a function is told that is no factor. `is_factor`: whether the stress
    is multiplied.
    """

    slot: str
    name: str
    unit: str
    values: Float[np.ndarray, " rows"] | None
    largest: float
    scale: float
    is_factor: bool = False

    count: ClassVar[int] = KNOTS
    """Of changes of slope, or of what else a function is a sum of."""

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

    def at(self, rows: Rows) -> "Variable":
        """Return the same variable, in its own scales, at other rows."""
        return self if self.values is None else replace(self, values=_VALUES[self.slot](rows))

    def columns(self, predicted: Float[np.ndarray, " rows"]) -> Float[np.ndarray, "rows knots"]:
        """Return what one of each does to the records, in Pa."""
        along = predicted if self.values is None else self.values
        scale = predicted if self.is_factor else self.scale
        return self.basis(along) * np.broadcast_to(scale, predicted.shape)[:, None]

    def change(
        self,
        slopes: Float[np.ndarray, "rows m"],
        predicted: Float[np.ndarray, " rows"],
        sizes: Float[np.ndarray, " knots"],
    ) -> Float[np.ndarray, "rows m"]:
        """Return what becomes of derivatives of the stress, behind those of the stress itself."""
        if self.values is not None and not self.is_factor:
            return np.zeros_like(slopes)
        step = 1e-6
        moved = self.columns(predicted * (1.0 + step)) - self.columns(predicted)
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
    def of(cls, rows: Rows, step: float | None = None) -> "Response":
        """Return the response over some samples, of runs that begin at rest.

        `step`: between lags, in s; by default the usual one between samples.
        """
        times = [np.asarray(run.time) / run.clock_factor for run in rows.runs]
        if step is None:
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
            "response", "time before", "s", None, float(lags[-1]), 1.0, True,
            np.concatenate(before), np.concatenate(after), np.concatenate(share), root,
        )  # fmt: skip

    def at(self, rows: Rows) -> "Response":
        """Return the same response at other rows."""
        return Response.of(rows, self.largest / _LAGS)

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

    def columns(self, predicted: Float[np.ndarray, " rows"]) -> Float[np.ndarray, "rows knots"]:
        """Return what one of each does to the records, in Pa."""
        return self._lagged(predicted[:, None])[..., 0] @ self.root

    def change(self, slopes, predicted, sizes):
        """Return what becomes of derivatives of the stress, behind those of the stress itself."""
        del predicted
        return np.einsum("rlm,l->rm", self._lagged(slopes), self.root @ sizes)


@dataclass(frozen=True)
class ClosedFormVariable(Variable):
    """A function of known form: so much of it, and its inner constant to first order.

    `form`, `inner`: one of `closed_forms`, and its inner constant over the largest value.
    """

    form: str = ""
    inner: float = 1.0
    count: ClassVar[int] = 2

    @classmethod
    def of(cls, variable: Variable, form: str, inner: float) -> "ClosedFormVariable":
        """Return a form of what a variable is."""
        return cls(**vars(variable), form=form, inner=inner)

    def basis(self, values: Float[np.ndarray, " n"]) -> Float[np.ndarray, "n 2"]:
        """Return how much one of the form is, and what a change of its inner constant does."""
        x, step = np.abs(values) / self.largest, 1e-4
        here, low, high = (
            closed_forms(self.slot, x, self.inner + off)[self.form] for off in (0.0, -step, step)
        )
        found = np.column_stack([here, (high - low) / (2.0 * step)])
        return found * np.sign(values)[:, None] if self.is_odd else found

    def moved(self, sizes: Float[np.ndarray, " 2"]) -> "ClosedFormVariable":
        """Return the form with the inner constant that sizes tell of."""
        with np.errstate(divide="ignore", invalid="ignore"):
            inner = self.inner + np.nan_to_num(sizes[1] / sizes[0], posinf=0.0, neginf=0.0)
        return replace(self, inner=float(np.clip(inner, *INNER)))


def _of_runs(of: Callable[[Run], np.ndarray]) -> Callable[[Rows], np.ndarray]:
    return lambda rows: np.concatenate([np.asarray(of(run), float) for run in rows.runs])


_VALUES = {
    "rate": _of_runs(lambda run: run.rate),
    "drift": _of_runs(lambda run: run.time),
    "network": _of_runs(integrated_rate),
}
"""What is known of each row, by slot."""


def variables(rows: Rows) -> Iterator[Variable]:
    """Return what a function of runs in shear may depend on."""
    runs, scale = rows.runs, float(np.sqrt(np.mean(rows.size**2)))

    def of(slot: str, name: str, unit: str, is_factor: bool = False) -> Variable:
        values = _VALUES[slot](rows)
        return Variable(slot, name, unit, values, float(np.max(np.abs(values))), scale, is_factor)

    largest = float(np.max(np.abs(rows.recorded)))
    yield Variable("recorded_stress", "stress", "Pa", None, largest, scale)
    if len(np.unique(np.abs(_VALUES["rate"](rows)))) > KNOTS:
        yield of("rate", "shear rate", "1/s")
    yield of("drift", "time", "s")
    yield of("network", "strain", "", is_factor=True)
    if len(rows) > len(runs) and all(float(run.protocol.begins) == 0.0 for run in runs):
        yield Response.of(rows)


INNER = (0.02, 1.2)
"""Range of the inner constant of a closed form, over the largest value."""


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
