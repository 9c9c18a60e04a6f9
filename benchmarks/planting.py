"""Data with a known flaw: what a closed loop must find when it is told only the base law.

Effects of the dictionary are planted at a drawn size; so are mechanisms that no dictionary entry
describes, for which the honest verdict is that something is unexplained. Everything drawn comes
from one seeded generator.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from discover.dataset import Dataset, Run
from discover.effects import named_effects
from discover.errors import InputError
from discover.forward import AugmentedModel, Batch, DeclaredModel, data_scales, make_batch
from discover.protocols import FlowProtocol, oscillatory_shear, start_up

MODULUS, RELAXATION_TIME = 100.0, 1.0
"""Of the base laws, in Pa and s."""

BASE_LAWS: Mapping[str, Mapping[str, float]] = {
    "ucm": {},
    "giesekus": {"alpha": 0.2},
    "ptt_linear": {"epsilon": 0.2},
}
"""Base laws with their parameters."""

FIT_FLOWS: Mapping[str, FlowProtocol] = {
    "start_slow": start_up(0.3),
    "start_middle": start_up(1.0),
    "start_fast": start_up(2.5),
    "laos_slow": oscillatory_shear(1.0, 0.5),
    "laos_large": oscillatory_shear(2.0, 1.0),
    "laos_fast": oscillatory_shear(1.5, 3.0),
}
HELD_OUT_FLOWS: Mapping[str, FlowProtocol] = {
    "start_held_out": start_up(1.8),
    "laos_held_out": oscillatory_shear(1.8, 0.8),
}
_START_UP_TIMES = np.geomspace(0.03, 10.0, 60)
_OSCILLATION_TIMES = np.linspace(0.2, 12.0, 60)

# finer than the loop's own steps, so that the loop does not meet its own errors in the data
_STRAIN_STEP = 0.05
_HALVINGS = 30


@dataclass(frozen=True)
class Noise:
    """Noise of the record: relative size, and correlation of neighbouring samples (AR(1))."""

    size: float = 0.01
    correlation: float = 0.0

    def draw(self, shape: tuple[int, ...], generator: np.random.Generator) -> np.ndarray:
        """Return noise with this standard deviation, correlated along the last axis."""
        innovations = generator.standard_normal(shape)
        noise = np.empty(shape)
        noise[..., 0] = innovations[..., 0]
        share = np.sqrt(1.0 - self.correlation**2)
        for i in range(1, shape[-1]):
            noise[..., i] = self.correlation * noise[..., i - 1] + share * innovations[..., i]
        return self.size * noise


@dataclass(frozen=True)
class PlantedCase:
    """Data with a flaw, and what the flaw is.

    Attributes
    ----------
    dataset
        All runs; the loop may see these, `declared` and `held_out`.
    declared
        The base law that the loop is told.
    held_out
        Names of the runs that only judge.
    effects
        Planted effects of the dictionary and their parameters.
    outside
        Planted mechanism that is in no dictionary; empty if none.
    changes
        Relative change of the stress by each planted flaw alone, mean over the fitted runs.
    noise
        Noise of the record.
    """

    dataset: Dataset
    declared: DeclaredModel
    held_out: tuple[str, ...]
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    outside: str = ""
    changes: Mapping[str, float] = field(default_factory=dict)
    noise: Noise = field(default_factory=Noise)


Flaw = Callable[[Batch, Callable[[Batch], np.ndarray], float], np.ndarray]
"""From runs, a prediction for runs, and a size: the flawed stresses."""


def _sticking_rate(batch, predict, size):
    # the motor cannot exceed a rate; at size 0 the limit is at the fastest flow of all
    limit = float(jnp.max(jnp.abs(batch.transients.commanded_rate))) * (1.0 - min(size, 0.95))
    clipped = jnp.clip(batch.transients.commanded_rate, -limit, limit)
    return predict(eqx.tree_at(lambda b: b.transients.commanded_rate, batch, clipped))


def _clipped_transducer(batch, predict, size):
    stress = predict(batch)
    limit = np.max(np.abs(stress)) * (1.0 - min(size, 0.95))
    return np.clip(stress, -limit, limit)


def _quantised_torque(batch, predict, size):
    stress = predict(batch)
    step = size * np.max(np.abs(stress))
    return step * np.round(stress / step) if step > 0 else stress


def _hum(batch, predict, size):
    stress = predict(batch)
    times = _sample_times(batch)
    # 0.9 Hz, which these samples resolve, as a hum of the mains is when sampled fast enough
    return stress + size * np.sqrt(np.mean(stress**2)) * np.sin(2.0 * np.pi * 0.9 * times)


def _shear_banding(batch, predict, size):
    # beyond a rate the stress falls by a share of what is beyond it: no smooth function of stress
    rate = np.take_along_axis(
        np.asarray(batch.transients.commanded_rate)[:, ::2],
        np.asarray(batch.transients.sample_index),
        axis=1,
    )
    return predict(batch) * np.where(np.abs(rate) > 1.2, 1.0 - min(size, 0.95), 1.0)


OUTSIDE: Mapping[str, Flaw] = {
    "sticking_rate": _sticking_rate,
    "clipped_transducer": _clipped_transducer,
    "quantised_torque": _quantised_torque,
    "hum": _hum,
    "torque_loss_above_a_rate": _shear_banding,
}
"""Mechanisms that no effect of the dictionary describes."""


class Planter:
    """Makes cases for one base law; what it compiles serves all of them.

    Parameters
    ----------
    base_law
        One of `BASE_LAWS`.
    """

    def __init__(self, base_law: str = "ucm"):
        if base_law not in BASE_LAWS:
            raise InputError(
                f"Unknown base law {base_law!r}; choose one of {', '.join(BASE_LAWS)}."
            )
        self.declared = DeclaredModel.named(base_law, BASE_LAWS[base_law], MODULUS, RELAXATION_TIME)
        flows = {**FIT_FLOWS, **HELD_OUT_FLOWS}
        self._runs = [_empty_run(name, flow) for name, flow in flows.items()]
        self._batch = make_batch(self._runs, strain_step=_STRAIN_STEP)
        self._fitted = np.arange(len(flows)) < len(FIT_FLOWS)
        self._effects = named_effects()
        unscaled = AugmentedModel(self.declared, list(self._effects.values()))
        self.clean = unscaled.predict(unscaled.zero(), self._batch)
        scales = data_scales(self._with(self.clean)[: len(FIT_FLOWS)])
        self._model = AugmentedModel(self.declared, list(self._effects.values()), scales)

    def plant(
        self,
        effects: Mapping[str, float] | Sequence[str] = (),
        outside: str = "",
        size: float = 0.1,
        noise: Noise | None = None,
        seed: int = 0,
        told: DeclaredModel | None = None,
    ) -> PlantedCase:
        """Return a case.

        Parameters
        ----------
        effects
            Effects of the dictionary to plant, with the relative change of σ12 that each is to
            make; or their names alone, for `size`.
        outside
            Mechanism of `OUTSIDE` to plant.
        size
            Relative change of σ12.
        noise
            Noise of the record; 1 %, white, by default.
        seed
            Seed of inner parameters, signs and noise.
        told
            The declared model, where it is to be another than the base law.

        Raises
        ------
        InputError
            If a name is unknown or no admissible amplitude makes the change asked for.
        """
        generator = np.random.default_rng(seed)
        sizes = dict(effects) if isinstance(effects, Mapping) else dict.fromkeys(effects, size)
        unknown = [n for n in sizes if n not in self._effects] + (
            [outside] if outside and outside not in OUTSIDE else []
        )
        if unknown:
            raise InputError(
                f"Unknown flaw {unknown[0]!r}; plant one of {', '.join(self._effects)}, or, from "
                f"outside the dictionary, {', '.join(OUTSIDE)}."
            )
        theta, planted, changes = self._model.zero(), {}, {}
        for name, wanted in sizes.items():
            values = self._draw(name, wanted, generator)
            at = self._model.positions(name)
            theta[at] = values
            alone = self._model.zero()
            alone[at] = values
            changes[name] = self._change(self._model.predict(alone, self._batch))
            parameters = self._effects[name].parameters
            planted[name] = {p.name: float(v) for p, v in zip(parameters, values, strict=True)}

        def predict(batch):
            return self._model.predict(theta, batch)

        stress = predict(self._batch)
        if outside:
            flaw = OUTSIDE[outside]

            def flawed(amount):
                return flaw(self._batch, predict, amount)

            amount = _bisect(lambda a: self._change(flawed(a), stress), size, 0.95, outside)
            changes[outside] = self._change(flawed(amount), stress)
            stress = flawed(amount)
        noise = noise or Noise()
        level = np.sqrt(np.mean(stress**2, axis=1, keepdims=True))
        stress = stress + level * noise.draw(stress.shape, generator)
        return PlantedCase(
            dataset=Dataset("planted", tuple(self._with(stress))),
            declared=told or self.declared,
            held_out=tuple(HELD_OUT_FLOWS),
            effects=planted,
            outside=outside,
            changes=changes,
            noise=noise,
        )

    def _with(self, stress) -> list[Run]:
        return [
            Run(run.name, run.time, run.protocol, run.rate, row[: len(run)])
            for run, row in zip(self._runs, stress, strict=True)
        ]

    def _change(self, stress, reference=None) -> float:
        """Return the relative change of the stress, mean over the fitted runs."""
        reference = self.clean if reference is None else reference
        if not np.all(np.isfinite(stress)):
            return float("inf")
        difference = np.sqrt(np.mean((stress - reference) ** 2, axis=1))
        return float(np.mean((difference / np.sqrt(np.mean(reference**2, axis=1)))[self._fitted]))

    def _draw(self, name: str, wanted: float, generator) -> Float[np.ndarray, " p"]:
        """Return parameters of an effect that change the stress as much as is wanted."""
        at = self._model.positions(name)
        theta = self._model.zero()
        for position in at[1:]:
            drawn = theta[position] * 2.0 ** generator.uniform(-1.0, 1.0)
            theta[position] = np.clip(drawn, self._model.low[position], self._model.high[position])
        first, high = at[0], min(self._model.high[at[0]], 1e4 * self._model.first_trial[at[0]])
        sign = 1.0
        # an amplitude that may have either sign gets one by lot
        if self._model.low[first] < 0.0 and generator.random() < 0.5:
            sign, high = -1.0, min(-self._model.low[first], 1e4 * self._model.first_trial[first])

        def change(amplitude):
            trial = theta.copy()
            trial[first] = sign * amplitude
            return self._change(self._model.predict(trial, self._batch))

        theta[first] = sign * _bisect(change, wanted, high, name)
        return theta[at]


def _bisect(change: Callable[[float], float], wanted: float, high: float, name: str) -> float:
    """Return the smallest amplitude found at which the change is the one wanted."""
    low = 0.0
    # from below, since far above an effect may saturate or run away
    upper = 1e-4 * high
    while change(upper) < wanted:
        low, upper = upper, 3.0 * upper
        if low >= high:
            raise InputError(
                f"No admissible amplitude of {name!r} changes the stress by {100 * wanted:.3g} %; "
                "ask for less."
            )
        upper = min(upper, high * 1.0000001)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + upper)
        low, upper = (middle, upper) if change(middle) < wanted else (low, middle)
        if upper - low < 1e-3 * upper:
            break
    return 0.5 * (low + upper)


def _empty_run(name: str, flow: FlowProtocol) -> Run:
    times = _START_UP_TIMES if name.startswith("start") else _OSCILLATION_TIMES
    rate = np.array([float(flow.rate(jnp.asarray(t))) for t in times])
    return Run(name, times, flow, rate, np.ones(len(times)))


def _sample_times(batch: Batch) -> np.ndarray:
    return np.take_along_axis(
        np.asarray(batch.transients.times)[:, ::2],
        np.asarray(batch.transients.sample_index),
        axis=1,
    )
