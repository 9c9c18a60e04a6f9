"""What an effect is: something that a model may lack, with an amplitude that switches it on."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from tensor_library.algebra import Symmetric
from tensor_library.law_terms import LawTerm


@dataclass(frozen=True)
class WrittenState:
    """A state as SymPy expressions over `tensor_library.isotropic_function.scalars`.

    The scalars are the names of the effect's parameters and of its levels, ``shear_rate`` and
    ``shear_stress``: the size of the rate √(½ γ̇:γ̇) in 1/s, and the stress in Pa of a shear of that
    size that does the same work.

    `modulus_factor`, `time_factor`: on the stress and on the relaxation time of every mode.
    """

    rates: tuple[Any, ...]  # of change of each level, in 1/s, in their order
    modulus_factor: Any = 1
    time_factor: Any = 1


Kind = Literal["constitutive", "kinematic", "signal"]

Scale = Literal[
    "one",
    "sampling_time",
    "run_time",
    "inverse_rate",
    "strain",
    "stress",
    "inverse_stress",
    "fluidity",
    "viscosity",
    "stress_rate",
    "rate",
    "inertia",
]
"""What sets the natural size of a parameter: a property of the data, or nothing (``one``)."""


@dataclass(frozen=True)
class EffectParameter:
    """A parameter of an effect, with the range that it can have in a laboratory.

    A value outside of the range is not fitted, and one that a fit drives to the end of it is no
    finding: what the data ask for is then another effect.

    `low`, `high`: physical range, in the unit or, where `range_scale` names one, in a property of
        the data.
    `range_source`: where the range comes from: literature, or the argument in a sentence.
    `range_scale`: data property in which `low` and `high` are measured; ``one`` where they are in
        `unit`.
    `ends`: those of `low` and `high` that something real can have, such as no recovery at all.
    `first_trial`: size of the first trial value, in that scale; for an inner parameter its starting
        value.
    `endless`: of a time: what the effect cannot be told from where no record lasts as long; empty
        if its name says nothing of that time.
    `absent`: of a constant that may be `low`: what the effect is there, where its name says
        otherwise.
    `meaning`: in a few words; by default the name in words. Of a share: of what it is one.
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
    ends: tuple[Literal["low", "high"], ...] = field(default=(), kw_only=True)
    endless: str = field(default="", kw_only=True)
    absent: str = field(default="", kw_only=True)
    meaning: str = field(default="", kw_only=True)


@dataclass(frozen=True)
class AbstractEffect(ABC):
    """An effect. Its first parameter is the amplitude: at zero it changes nothing.

    `visible`: size from which it shows, in words: the amplitude that changes the stress by about 5
        % in a flow that it affects.
    `complexity`: used to prefer the simpler of two explanations that the data cannot separate.
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


@dataclass(frozen=True)
class ConstitutiveEffect(AbstractEffect):
    """Changes the fluid: an extra term in the law of every mode, or a stress beside the modes.

    `explicit_rate`: whether the term names the rate of deformation. Such laws can lose their
        well-posedness in fast deformation, which laws with an upper convected derivative and a term
        in the stress alone keep [Leonov 1992, JNNFM 42, 323; Kwon & Leonov 1995, JNNFM 58, 25].
    """

    explicit_rate: bool = False
    kind: ClassVar[Kind] = "constitutive"

    @property
    def adds_term(self) -> bool:
        """Whether there is an `extra_term`."""
        return type(self).extra_term is not ConstitutiveEffect.extra_term

    def extra_term(self, values: Float[Array, " p"], stress: Symmetric, rate: Symmetric):
        """Return what the effect adds to h, dimensionless, for one mode.

        `values`: parameters in their order. `stress`, `rate`: σ_k/G_k and λ_k γ̇, both (3, 3) or
        both (4,).
        """
        del values, rate
        return jnp.zeros_like(stress)

    def as_terms(self, values: Sequence[float]) -> tuple[LawTerm, ...] | None:
        """Return `extra_term` as a sum of library terms, so that the law can be written out.

        None if it is no such sum, which is also what an effect that does not say is taken to be.
        """
        del values
        return None if self.adds_term else ()

    def instantaneous_stress(
        self, values: Float[Array, " p"], shear_rate: Float[Array, " n"]
    ) -> Float[Array, " n"]:
        """Return the shear stress in Pa that the effect adds beside the modes."""
        del values
        return jnp.zeros_like(shear_rate)


class ModeEffect(ConstitutiveEffect):
    """A relaxation mode beside the declared ones, which obeys the same law."""

    @abstractmethod
    def mode(self, values: Float[Array, " p"]) -> tuple[Float[Array, ""], Float[Array, ""]]:
        """Return its modulus in Pa and its relaxation time in s."""


class StateEffect(ConstitutiveEffect):
    """A state of the fluid, integrated with the modes, that changes their stress or time.

    The state starts at `rest` and obeys ds/dt = source − decay · s, both of which may depend on
    the flow. With all factors one the law is unchanged. An effect may have several such `levels`:
    state, source and decay then have the shape (levels,).
    """

    rest: ClassVar[float] = 0.0
    levels: ClassVar[int] = 1

    @property
    def changes_times(self) -> bool:
        """Whether there is a `time_factor`."""
        return type(self).time_factor is not StateEffect.time_factor

    @abstractmethod
    def source_and_decay(
        self, values: Float[Array, " p"], shear_rate: Float[Array, ""], stress: Float[Array, ""]
    ) -> tuple[Float[Array, "*levels"], Float[Array, "*levels"]]:
        """Return source and decay in 1/s.

        `values`: parameters in their order. `shear_rate`, `stress` in 1/s and Pa.
        """

    @property
    def level_names(self) -> tuple[str, ...]:
        """A name of each level, by that of the effect."""
        if self.levels == 1:
            return (self.name,)
        return tuple(f"{self.name}_{i + 1}" for i in range(self.levels))

    def written(self) -> WrittenState | None:
        """Return the state as expressions, for exports; None where nobody said."""
        return None

    def modulus_factor(
        self, values: Float[Array, " p"], state: Float[Array, "*levels"]
    ) -> Float[Array, ""]:
        """Return the factor on the stress of all modes."""
        del values, state
        return jnp.ones(())

    def time_factor(
        self, values: Float[Array, " p"], state: Float[Array, "*levels"]
    ) -> Float[Array, ""]:
        """Return the factor on all relaxation times."""
        del values, state
        return jnp.ones(())


@dataclass(frozen=True)
class Record:
    """A signal of one run on a grid of times.

    `times` in s, shape (n,), increasing; from 0, or from before where a steady flow came before.
    `strain_before`: strain, added up without regard to its sign, that the sample had seen in
        earlier runs.
    `tool_rate`: of the driven tool, as a nominal shear rate in 1/s, shape (n,); by default that of
        the fluid. The two differ where the fluid slips, where something between them gives way, and
        where the gap is not what the nominal rate is computed with.
    """

    times: Float[Array, " n"]
    rate: Float[Array, " n"]  # felt by the fluid, in 1/s, shape (n,)
    stress: Float[Array, " n"]  # shear stress in Pa, shape (n,)
    clock_factor: Float[Array, ""]  # time on the instrument's clock is ``times / clock_factor``
    strain_before: Float[Array, ""] | float = 0.0
    tool_rate: Float[Array, " n"] = None  # type: ignore[assignment]  # set below

    def __post_init__(self):
        if self.tool_rate is None:
            object.__setattr__(self, "tool_rate", self.rate)

    @property
    def instrument_times(self) -> Float[Array, " n"]:
        """Times on the instrument's clock, in s."""
        return self.times / self.clock_factor

    @property
    def total_strain(self) -> Float[Array, " n"]:
        """Strain of the sample, added up without regard to its sign, at each time.

        From the start of its first run on; a steady flow before t = 0 does not count.
        """
        size = jnp.abs(self.rate)
        # a flow before t = 0 lasts as long as the simulation needs, not as it did in the experiment
        steps = 0.5 * (size[1:] + size[:-1]) * jnp.diff(jnp.maximum(self.times, 0.0))
        return self.strain_before + jnp.concatenate([jnp.zeros(1), jnp.cumsum(steps)])


@dataclass(frozen=True)
class KinematicEffect(AbstractEffect):
    """Changes the deformation that the fluid really felt.

    `shapes_command`: whether it acts on the way from the command to the tool. A rate that was
        measured at the tool contains it already, so it is then no candidate; what lies between the
        tool and the fluid, such as slip or a wrong gap, still is. The tool's own rate, which its
        inertia and friction follow, is the command with these effects and without the others.
    """

    shapes_command: bool = False
    kind: ClassVar[Kind] = "kinematic"

    def felt_rate(
        self,
        values: Float[Array, " p"],
        instrument_times: Float[Array, " n"],
        shear_rate: Float[Array, " n"],
    ) -> Float[Array, " n"]:
        """Return the shear rate felt, from the one that would be felt without this effect.

        `values`: parameters in their order. `instrument_times` in s on the instrument's clock,
        increasing from the start of the flow; the fluid was at rest before. `shear_rate` in 1/s,
        taken to be linear between times.
        """
        del values, instrument_times
        return shear_rate


class SeriesElement(KinematicEffect):
    """Something that gives way in series with the fluid and so feels its stress.

    Of the commanded deformation it takes C σ (a spring) and ∫ s σ dt (a dashpot):
    γ̇_felt = γ̇ − s σ − C dσ/dt. The integrator solves this with the stress.
    """

    @abstractmethod
    def slip_and_compliance(
        self, values: Float[Array, " p"]
    ) -> tuple[Float[Array, ""], Float[Array, ""]]:
        """Return s in 1/(Pa s) and C in 1/Pa."""

    @property
    def slips_by_stress(self) -> bool:
        """Whether there is a `slip_at`."""
        return type(self).slip_at is not SeriesElement.slip_at

    def slip_at(self, values: Float[Array, " p"], stress: Float[Array, ""]) -> Float[Array, ""]:
        """Return what the slip s in 1/(Pa s) is beyond its constant, at a stress in Pa."""
        del stress
        return jnp.zeros_like(values[0])


class SignalEffect(AbstractEffect):
    """Changes what was recorded of the stress."""

    kind: ClassVar[Kind] = "signal"

    @abstractmethod
    def recorded_stress(self, values: Float[Array, " p"], record: Record) -> Float[Array, " n"]:
        """Return the stress recorded, from the one that would be recorded without this effect."""

    def response(
        self, values: Float[Array, " p"], frequency: Float[Array, ""]
    ) -> Complex[Array, ""] | Float[Array, ""]:
        """Return by what the stress of an oscillation that has gone on is multiplied.

        `values`: parameters in their order. `frequency` in rad/s.
        """
        del frequency
        return jnp.ones_like(values[0])

    def inertia(self, values: Float[Array, " p"]) -> Float[Array, ""]:
        """Return I of σ_rec = σ + I dγ̇/dt in Pa s², which a given stress accelerates too."""
        return jnp.zeros_like(values[0])
