"""Fluids: one law in each of several relaxation modes, with units."""

import warnings
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from discover.errors import InputError
from discover.laws.base import AbstractConstitutiveLaw, as_parameter
from discover.laws.each_mode import require_modes
from discover.laws.textbook.classical import UpperConvectedMaxwell
from discover.plain_numbers import as_numbers
from discover.words import counted
from tensor_library.algebra import VelocityGradient, rate_of_deformation


def _as_modes(value: ArrayLike | Sequence[float]) -> Float[Array, " k"]:
    parts = value if isinstance(value, list | tuple) else [value]
    if any(isinstance(one, Tracer) for one in parts):
        return jnp.atleast_1d(jnp.asarray(value, dtype=jnp.result_type(float)))
    # with NumPy, without a program for each shape
    modes = np.atleast_1d(as_numbers("The modes of a fluid, in Pa and s,", value, finite=False))
    return jnp.asarray(modes, dtype=jnp.result_type(float))


def _as_covariance(value: ArrayLike | None) -> Float[Array, "c c"] | None:
    if value is None or isinstance(value, Array):
        return value
    numbers = as_numbers("The covariance of moduli", value, finite=False)
    return jnp.asarray(numbers, dtype=jnp.result_type(float))


class Fluid(eqx.Module):
    """Sum of modes that share one dimensionless law, plus a Newtonian solvent.

    With s = σ_k/G_k mode k obeys λ_k ds/dt = γ̇λ_k + ... − s − h(s, γ̇λ_k); σ = Σ G_k s_k + η_s γ̇.

    Attributes
    ----------
    law
        Dimensionless; by default upper-convected Maxwell.
    modulus, relaxation_time
        G_k in Pa and λ_k in s, shape (k,).
    solvent_viscosity
        η_s, in Pa s.
    modulus_covariance
        Of moduli from a noisy sweep in Pa², shape (k, k), or (k + 1, k + 1) with the solvent last;
        learners widen their intervals by it.

    Examples
    --------
    >>> import discover as dc
    >>> dc.Fluid(dc.make_law("ucm"), modulus=[100.0, 10.0], relaxation_time=[0.1, 1.0]).n_modes
    2
    """

    law: AbstractConstitutiveLaw = eqx.field(default_factory=UpperConvectedMaxwell)
    modulus: Float[Array, " k"] = eqx.field(converter=_as_modes, default=1.0)
    relaxation_time: Float[Array, " k"] = eqx.field(converter=_as_modes, default=1.0)
    solvent_viscosity: Float[Array, ""] = eqx.field(converter=as_parameter, default=0.0)
    modulus_covariance: Float[Array, "c c"] | None = eqx.field(
        converter=_as_covariance, default=None
    )

    def __check_init__(self):
        if not isinstance(self.law, AbstractConstitutiveLaw):
            raise InputError(
                "The law of a fluid must be a law, such as make_law('ucm'), and no name or class; "
                f"got {self.law!r}."
            )
        shape = self.relaxation_time.shape
        if self.solvent_viscosity.ndim:
            raise InputError(
                "A fluid needs one solvent viscosity; got the shape "
                f"{self.solvent_viscosity.shape}."
            )
        if self.modulus.shape != shape or len(shape) != 1 or not shape[0]:
            raise InputError(
                "modulus and relaxation_time of a fluid must have one value for each mode; got the "
                f"shapes {self.modulus.shape} and {shape}."
            )
        require_modes(self.law, *shape)
        for label, values, least in (
            ("modulus", self.modulus, np.nextafter(0.0, 1.0)),
            ("relaxation_time", self.relaxation_time, np.nextafter(0.0, 1.0)),
            ("solvent_viscosity", self.solvent_viscosity, 0.0),
        ):
            if isinstance(values, Tracer):
                continue  # known only when the program runs
            numbers = np.asarray(values)
            if not np.all((numbers >= least) & np.isfinite(numbers)):
                wanted = "positive and finite" if least else "finite and not negative"
                raise InputError(f"{label} of a fluid must be {wanted}; got {numbers.tolist()}.")
        self._check_covariance()

    def _check_covariance(self) -> None:
        covariance, modes = self.modulus_covariance, self.n_modes
        if covariance is None:
            return
        usable = covariance.shape in ((modes,) * 2, (modes + 1,) * 2)
        if usable and not isinstance(covariance, Tracer):
            values = np.asarray(covariance)
            usable = np.all(np.isfinite(values)) and np.allclose(values, values.T)
        if not usable:
            raise InputError(
                "modulus_covariance must be a symmetric matrix in Pa² with one row for each mode, "
                f"and one for a solvent or none; got the shape {covariance.shape} for {modes} "
                "modes."
            )

    def __repr__(self) -> str:
        modes = counted(self.n_modes, "mode")
        if not isinstance(self.relaxation_time, Tracer) and self.n_modes:
            times = np.asarray(self.relaxation_time)
            low, high = f"{times.min():.3g}", f"{times.max():.3g}"
            modes += f" of {low} s" if low == high else f" from {low} to {high} s"
        return f"<Fluid: {type(self.law).__name__}, {modes}>"

    def _repr_html_(self) -> str:
        """Return law, constants and modes as a notebook shows them."""
        import pandas as pd

        from discover.laws.registry import LAWS, name_of
        from discover.summary_view import as_html

        named = name_of(self.law)
        law = type(self.law).__name__ if named is None else LAWS[named[0]].described(named[1])
        modulus, time = np.asarray(self.modulus), np.asarray(self.relaxation_time)
        viscosity = float(np.sum(modulus * time) + self.solvent_viscosity)
        said = f"{law}. {counted(self.n_modes, 'mode')}, zero-shear viscosity {viscosity:.4g} Pa s"
        if self.solvent_viscosity > 0.0:
            said += f", of which solvent {float(self.solvent_viscosity):.4g} Pa s"
        modes = {"modulus_Pa": modulus, "relaxation_time_s": time, "viscosity_Pa_s": modulus * time}
        return as_html(f"{said}.") + as_html(pd.DataFrame(modes))

    @classmethod
    def dimensionless(cls, law: AbstractConstitutiveLaw) -> "Fluid":
        """Return the single mode with unit modulus and unit relaxation time."""
        return cls(law, 1.0, 1.0)

    @classmethod
    def from_sweep(
        cls, sweep: Any, law: AbstractConstitutiveLaw | None = None, **options: Any
    ) -> "Fluid":
        """Fluid with the modes and solvent of a sweep; InputError if there is none, or too short.

        An elastic constant is its slowest mode, of the shortest time indistinguishable from a
        constant.

        Parameters
        ----------
        sweep, law
            Small-amplitude data, such as `Dataset.linear_sweep`; by default upper-convected
            Maxwell.
        **options
            `modes`, `solvent_viscosity`, `elastic_modulus`, as of
            `discover.dataset.relaxation_spectrum`.
        """
        if sweep is None:
            raise InputError(
                "There is no linear sweep to take the modes from: the data set has no lve.csv. "
                "Give the modes: Fluid(law, modulus, relaxation_time), in Pa and s."
            )
        if not hasattr(sweep, "relaxation_spectrum"):
            raise InputError(
                "The modes come from a linear sweep, such as data.linear_sweep; got a "
                f"{type(sweep).__name__}."
            )
        spectrum = sweep.relaxation_spectrum(**options)
        if solid := getattr(spectrum, "solid", ""):
            warnings.warn(f"Linear sweep: {solid}", stacklevel=2)
        return cls(
            UpperConvectedMaxwell() if law is None else law,
            spectrum.modulus,
            spectrum.relaxation_time,
            getattr(spectrum, "solvent_viscosity", 0.0),
            getattr(spectrum, "modulus_covariance", None),
        )

    @property
    def n_modes(self) -> int:
        """Number of relaxation modes."""
        return self.relaxation_time.shape[0]

    @property
    def settling_time(self) -> float | None:
        """Longest relaxation time in s; None where the law itself has no linear relaxation."""
        return (
            float(np.max(np.asarray(self.relaxation_time))) if self.law.linear_relaxation else None
        )

    def stress(
        self, state: Float[Array, "k s"], velocity_gradient: VelocityGradient
    ) -> Float[Array, "4"]:
        """Return the total extra stress (11, 22, 33, 12) in Pa."""
        polymer = jnp.tensordot(self.modulus, state[:, :4], axes=1)
        return polymer + self.solvent_viscosity * rate_of_deformation(velocity_gradient)
