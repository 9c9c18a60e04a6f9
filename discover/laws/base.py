"""The interface of every constitutive law."""

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from discover.plain_numbers import as_numbers
from tensor_library.algebra import (
    Symmetric,
    VelocityGradient,
    identity_like,
    rate_of_deformation,
    trace,
    upper_convected_production,
)
from tensor_library.isotropic_function import IsotropicFunction
from tensor_library.law_terms import LawTerm

State = Symmetric | Float[Array, " s"]
"""σ, (3, 3) or four components; of a law with structure variables these behind the components."""


class AbstractConstitutiveLaw(eqx.Module):
    """Maxwell-type law, dσ/dt = γ̇ + L·σ + σ·Lᵀ − σ − h(σ, γ̇), stress over modulus, time over λ.

    Attributes
    ----------
    linear_relaxation
        Whether the −σ is known; False where it too is left to a learner.

    Examples
    --------
    >>> import discover as dc
    >>> import jax.numpy as jnp
    >>> law = dc.make_law("giesekus", {"alpha": 0.3})
    >>> isinstance(law, dc.AbstractConstitutiveLaw)
    True
    >>> law.stress_rate(jnp.zeros(4), jnp.asarray(2.0)).tolist()  # at rest, then γ̇ = 2
    [0.0, 0.0, 0.0, 2.0]
    """

    linear_relaxation: eqx.AbstractVar[bool]

    variables: ClassVar[int] = 0
    """Number of structure variables behind the four components of σ in the state, zero at rest.

    They relax by −1 as σ does, and `extra_term` says what they do beside. A law with some is no
    function of (3, 3) tensors."""
    tensors: ClassVar[int] = 0
    """Number of tensors that stand first among the variables, four components each: conformations
    without I, which the flow carries along as it does σ."""

    def rest(self) -> Float[Array, " s"]:
        """Return the state at rest: the four components of σ, and the variables."""
        return jnp.zeros(4 + self.variables)

    retracts: ClassVar[bool] = False
    """Whether chains retract faster than they turn, so that h relaxes the trace of σ first."""

    @abstractmethod
    def extra_term(self, stress: State, rate: Symmetric) -> State:
        """Return h(σ, γ̇), in the storage of `stress`, with the variables where there are some."""

    def as_terms(self) -> tuple[LawTerm, ...] | None:
        """Return h as a sum of library terms; None, or InputError saying why, if it is none."""
        return None

    def split(self) -> tuple["AbstractConstitutiveLaw", tuple[LawTerm, ...]]:
        """Return the law below, and the library terms that are added to its h."""
        return self, ()

    def trace_relaxation(self, stress: State) -> Float[Array, ""]:
        """Rate over 1/λ at which h relaxes the trace beside −σ, (1/3) ∂ tr h/∂I without flow.

        Where `retracts`, integrators treat it implicitly at rest; the solution does not depend on
        it.
        """
        still = jnp.zeros_like(stress_in(stress))
        unit = as_state(identity_like(still), stress)
        along = jax.jvp(lambda s: self.extra_term(s, still), (stress,), (unit,))[1]
        return trace(stress_in(along)) / 3.0

    def relaxations(self) -> Float[Array, "t 2"]:
        """Rates over 1/λ beside −1 at which σ and each tensor relax at rest, for integrators.

        First of the whole tensor, then by how much its trace is faster.
        """
        trace_alone = self.trace_relaxation(self.rest())[None]
        return jnp.stack([jnp.zeros_like(trace_alone), trace_alone], axis=1)

    def shares(self) -> Float[Array, " tensors"]:
        """Return the share of each further tensor in σ, which is their sum but for added terms."""
        return jnp.zeros(self.tensors)

    def conformation(self, stress: Symmetric) -> Symmetric:
        """Return the tensor that stays positive definite as long as there are chains: I + σ."""
        return identity_like(stress) + stress

    def stress_rate(self, stress: State, velocity_gradient: VelocityGradient) -> State:
        """Return dσ/dt, and that of the variables.

        `stress`: dimensionless, (3, 3), or 11, 22, 33, 12 with the variables behind.
        `velocity_gradient`: dimensionless L, (3, 3) for a full stress; four components or the
        scalar shear rate for four.
        """
        rate = rate_of_deformation(velocity_gradient)
        own = stress_in(stress)
        change = as_state(rate + upper_convected_production(own, velocity_gradient), stress)
        if self.tensors:
            end = 4 + 4 * self.tensors
            carried = jax.vmap(upper_convected_production, in_axes=(0, None))(
                stress[4:end].reshape(-1, 4), velocity_gradient
            )
            change = change.at[4:end].set((rate + carried).ravel())
        if self.linear_relaxation:
            change = change - stress
        return change - self.extra_term(stress, rate)


class AbstractExtendedLaw(AbstractConstitutiveLaw):
    """A law that adds to h of another, whose states it carries along."""

    base: eqx.AbstractVar[AbstractConstitutiveLaw | None]  # the other law, or None

    @property
    def variables(self) -> int:
        """Those of the base law."""
        return 0 if self.base is None else self.base.variables

    @property
    def tensors(self) -> int:
        """Those of the base law."""
        return 0 if self.base is None else self.base.tensors

    @property
    def retracts(self) -> bool:
        """Whether the chains of the base law retract."""
        return self.base is not None and self.base.retracts

    def conformation(self, stress: Symmetric) -> Symmetric:
        """Return that of the base law."""
        base = self.base
        return super().conformation(stress) if base is None else base.conformation(stress)

    def relaxations(self) -> Float[Array, "t 2"]:
        """Return those of the base law where it has tensors beside σ."""
        if self.base is not None and self.base.tensors:
            return self.base.relaxations()
        return super().relaxations()

    def shares(self) -> Float[Array, " tensors"]:
        """Return those of the base law."""
        return jnp.zeros(0) if self.base is None else self.base.shares()

    def own_term(self, stress: Symmetric, rate: Symmetric) -> Symmetric:
        """Return what is added to h of the base law."""
        raise NotImplementedError

    def own_terms(self) -> tuple[LawTerm, ...]:
        """Return the same as a sum of library terms; InputError if it is none."""
        raise NotImplementedError

    def extra_term(self, stress: State, rate: Symmetric) -> State:
        """Return h of the base law and what is added to it."""
        extra = as_state(self.own_term(stress_in(stress), rate), stress)
        return extra if self.base is None else extra + self.base.extra_term(stress, rate)

    def as_terms(self) -> tuple[LawTerm, ...] | None:
        """Return the terms of the base law, then those added; None if that is no sum."""
        below = () if self.base is None else self.base.as_terms()
        return None if below is None else below + self.own_terms()

    def split(self) -> tuple[AbstractConstitutiveLaw, tuple[LawTerm, ...]]:
        """Return what the base law is, and the terms added to it."""
        if self.base is None:
            return self, ()
        core, terms = self.base.split()
        return core, terms + self.own_terms()


def stress_in(state: State) -> Symmetric:
    """Return σ of a state, which has variables behind its four components where a law has some."""
    return state[:4] if state.ndim == 1 and len(state) > 4 else state


def as_state(stress: Symmetric, like: State) -> State:
    """Return four components with zeros behind them, as many numbers as another state has."""
    return stress if stress.shape == like.shape else jnp.pad(stress, (0, len(like) - 4))


def as_parameter(value: ArrayLike) -> Float[Array, ""]:
    """Return a law's parameter as an array, so that gradients and `vmap` reach it."""
    if not isinstance(value, jax.Array):  # what is traced is one
        value = as_numbers("A parameter of a law or a fluid", value, finite=False)
    return jnp.asarray(value, dtype=jnp.result_type(float))


@dataclass(frozen=True, eq=False)
class NamedLaw:
    """Law that can be asked for by name.

    `build`: makes the law from its parameters in the order of `parameters`: names and physical
    ranges, dimensionless. `range_sources`: literature or argument for each. `written`: returns h
    with its constants as letters; None if nobody said. `is_one_mode`: whether at small strain the
    law is one Maxwell mode; otherwise ``"any"`` leaves it out.
    """

    title: str  # name as a rheologist writes it
    build: Callable[..., AbstractConstitutiveLaw]
    parameters: Mapping[str, tuple[float, float]]
    range_sources: Mapping[str, str] = field(default_factory=dict)
    source: str = ""  # literature on the law
    written: Callable[[], IsotropicFunction] | None = None
    is_one_mode: bool = True

    def described(self, values: Mapping[str, float]) -> str:
        """Return the title with the values of the parameters, by their names in study files."""
        text = ", ".join(f"{key} = {value:g}" for key, value in values.items())
        return f"{self.title} ({text})" if text else self.title
