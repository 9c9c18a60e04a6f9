"""Effects: what a model may lack, each with an amplitude that switches it on."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from tensor_library.algebra import Symmetric
from tensor_library.law_terms import LawTerm


@dataclass(frozen=True)
class WrittenState:
    """State as SymPy expressions over `tensor_library.isotropic_function.scalars`.

    The scalars are named as the effect's parameters and levels, ``shear_rate`` (√(½ γ̇:γ̇), in 1/s)
    and ``shear_stress`` (in Pa, of a shear of that rate that does the same work). `modulus_factor`,
    `time_factor`: on stress and relaxation time of every mode.
    """

    rates: tuple[Any, ...]  # of change of each level, in 1/s, in their order
    modulus_factor: Any = 1
    time_factor: Any = 1


Kind = Literal["constitutive", "kinematic", "signal"]
Constants = Float[Array, " p"]
Rates = Float[Array, " n"]
Number = Float[Array, ""]
Levels = Float[Array, "*levels"]

Scale = Literal[
    "one", "sampling_time", "run_time", "inverse_rate", "strain", "stress", "inverse_stress",
    "compliance", "fluidity", "viscosity", "stress_rate", "rate", "inertia", "softening_by_heat",
    "shift_factor",
]  # fmt: skip
"""What sets the natural size of a parameter: a property of the data, or nothing (``one``)."""


POWERS_OF_TIME = {"s": 1, "Pa s": 1, "Pa s^2": 2, "1/s": -1, "1/(Pa s)": -1, "Pa/s": -1}
"""By the unit of a constant, its power of the relaxation times when all of them change."""


@dataclass(frozen=True)
class EffectParameter:
    """Parameter of an effect with its physical range; a fit that ends at the range is no finding.

    `low`, `high`: in `unit`, or in the data property `range_scale`. `range_source`: literature or
    argument. `first_trial`: in `scale`; of an inner parameter its start. `sound`: value of an
    amplitude known in a sound instrument, and its deviation. `endless`, `absent`: what the effect
    is with this constant beyond all records, or at `low`. `meaning`: in words, where the name is
    none.
    """

    name: str  # name in JSON and reports
    symbol: str  # LaTeX
    unit: str = ""  # SI unit; empty for a pure number
    low: float = -jnp.inf
    high: float = jnp.inf
    scale: Scale = "one"  # data property in which `first_trial` is measured
    first_trial: float = 0.1
    range_source: str = field(kw_only=True)
    range_scale: Scale = field(default="one", kw_only=True)
    sound: tuple[float, float] | None = field(default=None, kw_only=True)
    endless: str = field(default="", kw_only=True)
    absent: str = field(default="", kw_only=True)
    meaning: str = field(default="", kw_only=True)


@dataclass(frozen=True)
class AbstractEffect(ABC):
    """Effect. Its first parameter is the amplitude: at zero it changes nothing.

    `visible`: amplitude worth some 5 % of stress. `complexity`: prefers the simpler explanation.
    """

    name: str  # name in studies, JSON and reports
    parameters: tuple[EffectParameter, ...]  # the amplitude first, then any inner parameters
    equation: str  # LaTeX of what the effect adds or changes
    source: str  # literature
    check: str  # what a user should do in the laboratory to confirm it
    visible: str = ""
    complexity: int = 1
    kind: ClassVar[Kind]
    on_request: ClassVar[bool] = False
    """Whether it is a candidate only where it is asked for by name."""
    acts_on_steady_states: ClassVar[bool] = False
    """Of an effect of the instrument or a state: whether it changes what is steady or periodic,
    sample by sample, without regard to time or strain."""
    takes_numpy: ClassVar[bool] = False
    """Of an effect on a rate or a signal: whether it also takes arrays of NumPy, which of many
    vectors and runs have axes of vectors, runs and times; each value those of vectors and ones.
    Said beside the function: a function put in its place may not."""

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if {"felt_rate", "recorded_stress"} & vars(cls).keys():
            cls.takes_numpy = vars(cls).get("takes_numpy", False)


@dataclass(frozen=True)
class ConstitutiveEffect(AbstractEffect):
    """Effect on the fluid: an extra term in the law of every mode, or a stress beside the modes.

    `explicit_rate`: whether the term names the rate of deformation; such laws can lose their
    well-posedness in fast deformation [Leonov 1992, JNNFM 42, 323; Kwon & Leonov 1995, JNNFM 58,
    25].
    """

    explicit_rate: bool = False
    kind: ClassVar[Kind] = "constitutive"
    leaves_second_difference_open: ClassVar[bool] = False
    """Whether laws of the field that it stands for have one σ12 and N1, and differ in N2."""

    @property
    def adds_term(self) -> bool:
        """Whether there is an `extra_term`."""
        return type(self).extra_term is not ConstitutiveEffect.extra_term

    def extra_term(self, values: Constants, stress: Symmetric, rate: Symmetric):
        """Return what is added to h of one mode, dimensionless.

        `values`: parameters in their order. `stress`, `rate`: σ_k/G_k and λ_k γ̇, both (3, 3) or
        (4,).
        """
        del values, rate
        return jnp.zeros_like(stress)

    def as_terms(self, values: Sequence[float]) -> tuple[LawTerm, ...] | None:
        """Return `extra_term` as a sum of library terms; None if it is none, or does not say."""
        del values
        return None if self.adds_term else ()

    def instantaneous_stress(self, values: Constants, shear_rate: Rates) -> Rates:
        """Return the shear stress in Pa that the effect adds beside the modes."""
        del values
        return jnp.zeros_like(shear_rate)


class ModeEffect(ConstitutiveEffect):
    """Relaxation mode beside the declared ones, under the same law."""

    @abstractmethod
    def mode(self, values: Constants) -> tuple[Number, Number]:
        """Return its modulus in Pa and its relaxation time in s."""


class StateEffect(ConstitutiveEffect):
    """State of the fluid, integrated with the modes, that scales their stress or times.

    From `rest`, ds/dt = source − decay · s; of several `levels` each of shape (levels,).
    """

    rest: ClassVar[float] = 0.0
    levels: ClassVar[int] = 1

    @property
    def changes_times(self) -> bool:
        """Whether there is a `time_factor`."""
        return type(self).time_factor is not StateEffect.time_factor

    @abstractmethod
    def source_and_decay(
        self, values: Constants, shear_rate: Number, stress: Number
    ) -> tuple[Levels, Levels]:
        """Return source and decay in 1/s, from `shear_rate` in 1/s and `stress` in Pa."""

    @property
    def level_names(self) -> tuple[str, ...]:
        """A name of each level, by that of the effect."""
        if self.levels == 1:
            return (self.name,)
        return tuple(f"{self.name}_{i + 1}" for i in range(self.levels))

    def written(self) -> WrittenState | None:
        """Return the state as expressions, for exports; None where nobody said."""
        return None

    def modulus_factor(self, values: Constants, state: Levels) -> Number:
        """Return the factor on the stress of all modes."""
        del values, state
        return jnp.ones(())

    def time_factor(self, values: Constants, state: Levels) -> Number:
        """Return the factor on all relaxation times."""
        del values, state
        return jnp.ones(())


Signal = Float[Array | np.ndarray, "... n"]
OfRun = Float[Array | np.ndarray, "..."]
Values = Float[Array | np.ndarray, "p ..."]


@dataclass(frozen=True)
class Record:
    """Signal of one run on increasing times in s, from 0 or from a steady flow before it.

    `strain_before`: of earlier runs, added up without sign. `tool_rate`: of the driven tool, a
    nominal shear rate in 1/s.
    """

    times: Signal
    rate: Signal  # felt by the fluid, in 1/s
    stress: Signal  # shear stress in Pa
    clock_factor: OfRun  # time on the instrument's clock is ``times / clock_factor``
    strain_before: OfRun | float = 0.0
    tool_rate: Signal = None  # type: ignore[assignment]  # set below

    def __post_init__(self):
        if self.tool_rate is None:
            object.__setattr__(self, "tool_rate", self.rate)

    @property
    def instrument_times(self) -> Signal:
        """Times on the instrument's clock, in s."""
        return self.times / self.clock_factor

    @property
    def total_strain(self) -> Signal:
        """Strain since the first run, without sign; a steady flow before t = 0 does not count."""
        of: Any = self.rate.__array_namespace__()
        size = of.abs(self.rate)
        # a flow before t = 0 lasts as long as the simulation needs, not as it did in the experiment
        width = of.diff(of.maximum(self.times, 0.0))
        strain = of.cumsum(0.5 * (size[..., 1:] + size[..., :-1]) * width, axis=-1)
        start = of.zeros_like(strain[..., :1])
        return self.strain_before + of.concatenate([start, strain], axis=-1)


@dataclass(frozen=True)
class KinematicEffect(AbstractEffect):
    """Effect on the deformation that the fluid felt.

    `shapes_command`: it acts between command and tool, so that a measured rate contains it.
    """

    shapes_command: bool = False
    kind: ClassVar[Kind] = "kinematic"

    def felt_rate(self, values: Values, instrument_times: Signal, shear_rate: Signal) -> Signal:
        """Return the shear rate felt in 1/s from the one without this effect, linear between times.

        `instrument_times` in s on the instrument's clock, from the start of the flow.
        """
        del values, instrument_times
        return shear_rate


@dataclass(frozen=True)
class RadialAverage(KinematicEffect):
    """Torque of flows at several radii, of which the fluid at each feels its own share of the rate.

    With amplitude p the shear stress is 1 − p times the rim's and p times a weighted sum. `radii`:
    over the rim's. `of_stress`, `of_modulus`: weights there; those of stresses add up to one.
    """

    radii: tuple[float, ...] = ()
    of_stress: tuple[float, ...] = ()
    of_modulus: tuple[float, ...] = ()
    acts_on_steady_states = True


class SeriesElement(KinematicEffect):
    """Element in series with the fluid, solved with the stress: γ̇_felt = γ̇ − s σ − C dσ/dt."""

    @abstractmethod
    def slip_and_compliance(self, values: Constants) -> tuple[Number, Number]:
        """Return s in 1/(Pa s) and C in 1/Pa."""

    @property
    def slips_by_stress(self) -> bool:
        """Whether there is a `slip_at`."""
        return type(self).slip_at is not SeriesElement.slip_at

    def slip_at(self, values: Constants, stress: Number) -> Number:
        """Return what the slip s in 1/(Pa s) is beyond its constant, at a stress in Pa."""
        del stress
        return jnp.zeros_like(values[0])


class SignalEffect(AbstractEffect):
    """Changes what was recorded of the stress, or `of_force` of a normal or tensile stress.

    `is_zero`: what is read without a stress; added last, as a lag would make it begin with the
    record.
    """

    kind: ClassVar[Kind] = "signal"
    of_force: ClassVar[bool] = False
    is_zero: ClassVar[bool] = False

    @abstractmethod
    def recorded_stress(self, values: Values, record: Record) -> Signal:
        """Return the stress recorded, from the one that would be recorded without this effect."""

    def response(self, values: Constants, frequency: Number) -> Complex[Array, ""] | Number:
        """Return the factor on the stress of a periodic oscillation at `frequency` in rad/s."""
        del frequency
        return jnp.ones_like(values[0])

    def inertia(self, values: Values) -> OfRun:
        """Return I of σ_rec = σ + I dγ̇/dt in Pa s², which a given stress accelerates too."""
        return jnp.zeros_like(values[0])
