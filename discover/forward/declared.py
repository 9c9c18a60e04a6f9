"""The model that the user declares, before any effect is added."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from discover.effects import (
    AbstractEffect,
    ConstitutiveEffect,
    KnownEffect,
    built_in_effects,
    make_effect,
)
from discover.errors import InputError
from discover.laws import LAWS, AbstractConstitutiveLaw, UpperConvectedMaxwell, make_law

DEGREE = 2
"""Highest degree of the polynomial in log λ."""

LARGEST = 10.0
"""Largest coefficient, and largest deviation of one mode, on the link's scale: e^10 either way."""


def decades(
    modulus: Float[Array, " k"],
    relaxation_time: Float[Array, " k"],
    of: Float[Array, " m"] | None = None,
) -> Float[Array, " m"]:
    """Return log10(λ/λ̄), with λ̄ the geometric mean of the times by viscosity.

    `of`: times in s, by default the declared ones. Beyond these the end counts, for a polynomial
    says nothing there.
    """
    own = jnp.log10(relaxation_time)
    viscosity = modulus * relaxation_time
    asked = own if of is None else jnp.clip(jnp.log10(of), jnp.min(own), jnp.max(own))
    return asked - jnp.sum(viscosity * own) / jnp.sum(viscosity)


def constants_of_modes(
    mean: Float[Array, ""],
    low: float,
    high: float,
    coefficients: Float[Array, " degree"],
    deviations: Float[Array, " k"],
    places: Float[Array, " k"],
) -> Float[Array, " k"]:
    """Return the constant of each mode: that at λ̄, its link moved by a polynomial.

    The link is the logarithm of (c − low)/(high − c), or of c − low without an upper bound, so
    every mode stays in its range, and has the very constant of the mean where all coefficients are
    zero.
    """
    powers = jnp.stack([places ** (i + 1) for i in range(DEGREE)])
    change = coefficients @ powers + deviations
    if not np.isfinite(low):
        # mirrored where only the upper bound is one, and no link where neither is
        return mean + change if not np.isfinite(high) else high - (high - mean) * jnp.exp(-change)
    if not np.isfinite(high):
        return low + (mean - low) * jnp.exp(change)
    share, odds = (mean - low) / (high - low), jnp.exp(change)
    return low + (high - low) * share * odds / (1.0 - share + share * odds)


MODULUS, RELAXATION_TIME = "modulus_Pa", "relaxation_time_s"
"""Names of the two common factors that may be fitted."""


@dataclass(frozen=True)
class FreeParameter:
    """A parameter of the declared law that is to be fitted, with its range."""

    name: str
    start: float
    low: float
    high: float


@dataclass(frozen=True)
class DeclaredModel:
    """A law, its modes, and which of them are still to be fitted.

    `fit_modulus`, `fit_relaxation_time`: whether one factor on all moduli, or times, is fitted.
    `law_name`, `parameters`: of a named law; needed only if some are free.
    `linear_error`: relative error with which the modes describe the linear data they come from.
    `modulus_covariance`: of the moduli in Pa² (the solvent's last), shape (k, k) or (k + 1, k + 1).
    `step_instants`: how many instants of steps of the rate are fitted; see `Run.rate_steps`.
    `by_mode`: parameters of the law, and effects by their amplitude, that may differ by mode.

    Raises InputError if modes are none, or a constant by mode cannot be one, or has one mode alone.
    """

    law: AbstractConstitutiveLaw
    modulus: Float[np.ndarray, " k"]  # G_k in Pa, shape (k,)
    relaxation_time: Float[np.ndarray, " k"]  # λ_k in s, shape (k,)
    solvent_viscosity: float = 0.0  # in Pa s
    fit_modulus: bool = False
    fit_relaxation_time: bool = False
    law_name: str = ""
    parameters: tuple[tuple[str, float], ...] = ()
    free_parameters: tuple[FreeParameter, ...] = ()  # parameters of the law to fit
    linear_error: float = 0.0
    effects: tuple[KnownEffect, ...] = ()
    by_mode: tuple[str, ...] = ()
    modulus_covariance: Float[np.ndarray, "c c"] | None = None
    step_instants: int = 0

    def __post_init__(self):
        for name in ("modulus", "relaxation_time"):
            values = np.atleast_1d(np.asarray(getattr(self, name), dtype=float))
            if values.ndim != 1 or not np.all(np.isfinite(values)) or np.any(values <= 0):
                raise InputError(f"{name} must be positive numbers; got {values}.")
            object.__setattr__(self, name, values)
        if self.modulus.shape != self.relaxation_time.shape:
            raise InputError(
                f"A model needs as many moduli as relaxation times; got {len(self.modulus)} and "
                f"{len(self.relaxation_time)}."
            )
        for name in self.by_mode:
            self._require_by_mode(name)
        if self.by_mode and self.n_modes < 2:
            raise InputError(
                "by_mode lets constants differ from one relaxation mode to the next, and the "
                'declared model has one mode. Give several (modes = "lve"), or leave by_mode out.'
            )
        if len(set(self.by_mode)) < len(self.by_mode):
            raise InputError(f"by_mode names a constant twice: {', '.join(self.by_mode)}.")

    def _require_by_mode(self, name: str) -> None:
        """Refuse what is no parameter of the law to be fitted, and no term of an effect."""
        if name in (free := [parameter.name for parameter in self.free_parameters]):
            return
        known = next((one for one in self.effects if one.name == name), None)
        try:
            effect = make_effect(name) if known is None else known.effect
        except InputError:
            raise InputError(
                f"by_mode names {name!r}, which is no parameter of the law that is fitted (these "
                f"are: {', '.join(free) or 'none'}), and no effect. Write parameters = {{ {name} = "
                f'"fit" }}, or from Python free=["{name}"], or take it out of by_mode.'
            ) from None
        amplitude = effect.parameters[0]
        if not may_differ_by_mode(effect):
            raise InputError(
                f"by_mode names the effect {name}, which adds no term to the law of each mode. "
                "Name effects that do, such as giesekus_mobility, or parameters of the law."
            )
        if known is not None and amplitude.name not in known.free:
            raise InputError(
                f"by_mode names the effect {name}, whose {amplitude.name} has a value. Write "
                f'{amplitude.name} = "fit", or take it out of by_mode.'
            )

    @classmethod
    def maxwell(cls, modulus, relaxation_time, **options) -> "DeclaredModel":
        """Return the upper-convected Maxwell law with these modes."""
        return cls(
            UpperConvectedMaxwell(),
            np.atleast_1d(modulus),
            np.atleast_1d(relaxation_time),
            **options,
        )

    @classmethod
    def named(
        cls,
        law_name: str,
        parameters: Mapping[str, float],
        modulus,
        relaxation_time,
        free: Sequence[str] = (),
        **options,
    ) -> "DeclaredModel":
        """Return a named law with these modes, in Pa and s.

        `free`: what to fit: parameters of the law, ``modulus_Pa``, ``relaxation_time_s``.
        """
        law = make_law(law_name, parameters)
        ranges = LAWS[law_name].parameters
        unknown = [n for n in free if n not in ranges and n not in (MODULUS, RELAXATION_TIME)]
        if unknown:
            raise InputError(f"{unknown[0]!r} cannot be fitted: the law {law_name!r} has it not.")
        return cls(
            law,
            np.atleast_1d(modulus),
            np.atleast_1d(relaxation_time),
            fit_modulus=MODULUS in free,
            fit_relaxation_time=RELAXATION_TIME in free,
            law_name=law_name,
            parameters=tuple((name, float(parameters[name])) for name in ranges),
            free_parameters=tuple(
                FreeParameter(name, float(parameters[name]), *ranges[name])
                for name in ranges
                if name in free
            ),
            **options,
        )

    @property
    def free_constants(self) -> int:
        """How many constants are fitted, those of known effects included."""
        return len(self.free_positions) + sum(len(known.free) for known in self.effects)

    def law_with(self, values) -> AbstractConstitutiveLaw:
        """Return the law with these values of its free parameters, which may be traced."""
        if not self.free_parameters:
            return self.law
        known = dict(self.parameters)
        for parameter, value in zip(self.free_parameters, values, strict=True):
            known[parameter.name] = value
        return LAWS[self.law_name].build(*known.values())

    @property
    def n_modes(self) -> int:
        """How many modes are declared."""
        return len(self.modulus)

    @property
    def by_mode_slices(self) -> dict[str, slice]:
        """Where each constant by mode has its polynomial, then the deviations of the modes."""
        start, each = 2 + len(self.free_parameters), DEGREE + self.n_modes
        return {
            name: slice(start + i * each, start + (i + 1) * each)
            for i, name in enumerate(self.by_mode)
        }

    @property
    def size(self) -> int:
        """How many places of the parameter vector are the declared law's."""
        return 2 + len(self.free_parameters) + len(self.by_mode) * (DEGREE + self.n_modes)

    @property
    def free_positions(self) -> list[int]:
        """Positions of what is fitted, in the vector that starts with the declared parameters."""
        factors = [self.fit_modulus, self.fit_relaxation_time]
        return [i for i, wanted in enumerate(factors) if wanted] + [
            2 + i for i in range(len(self.free_parameters))
        ]


def may_differ_by_mode(effect: AbstractEffect) -> bool:
    """Return whether an effect scales a term of each mode's law by a dimensionless amplitude."""
    adds = isinstance(effect, ConstitutiveEffect) and effect.adds_term
    return adds and effect.parameters[0].range_scale == "one"


class Numbers(eqx.Module):
    """What of a declared model is data to the compiled program."""

    law: AbstractConstitutiveLaw
    modulus: Float[Array, " k"]
    relaxation_time: Float[Array, " k"]
    solvent_viscosity: Float[Array, ""]


class Structure(NamedTuple):
    """What decides which program is compiled; models that share it share the program."""

    effects: tuple[AbstractEffect, ...]
    free_parameters: tuple[str, ...]
    law_name: str
    parameters: tuple[tuple[str, float], ...]
    fit_modulus: bool
    by_mode: tuple[tuple[str, int, int], ...] = ()
    """Constants that may differ from mode to mode, and where what varies them begins and ends."""
    step_instants: int = 0
    """How many instants of steps of the rate are fitted, each as a share of its interval."""
    law_numbers: int = 0
    """How many numbers of the law stand in the vector, where it is no law with a name."""

    def with_every_effect(self) -> "Structure":
        """Return the structure that all sets share: built-in effects, then a user's, by name."""
        asked = {effect.name: effect for effect in self.effects}
        every = {name: asked.pop(name, effect) for name, effect in built_in_effects().items()}
        every |= {name: asked[name] for name in sorted(asked)}
        return self._replace(effects=tuple(every.values()), fit_modulus=True)

    def without_constants(self) -> "Structure":
        """Return the structure of the effects alone: constants of a law are data to its code."""
        of_effects = (name for name, *_ in self.by_mode if name not in self.free_parameters)
        return Structure(self.effects, (), "", (), True, tuple((name, 0, 0) for name in of_effects))
