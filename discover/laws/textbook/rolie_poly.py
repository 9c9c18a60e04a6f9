"""Rolie–Poly law of entangled linear chains, with stretch, without end or with one."""

from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from discover.laws.base import AbstractConstitutiveLaw, NamedLaw, State, as_parameter
from tensor_library.algebra import Symmetric, identity_like, inner, trace
from tensor_library.isotropic_function import IsotropicFunction, scalars

_EXPONENT = -0.5  # δ of Likhtman & Graham


class RoliePoly(AbstractConstitutiveLaw):
    """Rolie–Poly law   [Likhtman & Graham 2003, JNNFM 114, 1, eq. 11].

    h = 2 (λ/τ_R)(1 − 1/Λ)(A + β Λ^{2δ} σ), with A = I + σ, Λ = √(tr A/3) and δ = −1/2.
    """

    stretch_time_ratio: Float[Array, ""] = eqx.field(converter=as_parameter)  # τ_R/λ
    constraint_release: Float[Array, ""] = eqx.field(converter=as_parameter)  # β
    linear_relaxation: bool = eqx.field(static=True, default=True)

    retracts: ClassVar[bool] = True

    def extra_term(self, stress: Symmetric, rate: Symmetric) -> Symmetric:
        del rate
        stretch = stretch_of(stress)
        retraction = 2.0 / self.stretch_time_ratio * (1.0 - 1.0 / stretch)
        released = self.constraint_release * stretch ** (2.0 * _EXPONENT)
        return retraction * (identity_like(stress) + (1.0 + released) * stress)


class FiniteRoliePoly(AbstractConstitutiveLaw):
    """Rolie–Poly law of chains that end [Kabanemi & Hétu 2009, JNNFM 160, 113].

    Springs are k(Λ) times as stiff as Hooke's, k being Cohen's function, without bound at Λ_m:

        σ = k (A − I),    A▽ = −(A − I) − r (A + β Λ^{2δ} (A − I)),    r = 2 (λ/τ_R) k (1 − 1/Λ),
        k = (3 − Λ²/m)(1 − 1/m) / [(1 − Λ²/m)(3 − 1/m)],    m = Λ_m².

    Λ² follows from tr σ by a quadratic equation. Λ_m → ∞ is `RoliePoly`.
    """

    stretch_time_ratio: Float[Array, ""] = eqx.field(converter=as_parameter)  # τ_R/λ
    constraint_release: Float[Array, ""] = eqx.field(converter=as_parameter)  # β
    maximum_stretch: Float[Array, ""] = eqx.field(converter=as_parameter)  # Λ_m
    linear_relaxation: bool = eqx.field(static=True, default=True)

    retracts: ClassVar[bool] = True

    def extra_term(self, stress: Symmetric, rate: Symmetric) -> Symmetric:
        """Return h = (1 − k) γ̇ + k r (A + β Λ^{2δ} (A − I)) − (k̇/k) σ."""
        limit = self.maximum_stretch**2
        third = jnp.maximum(trace(stress) / 3.0, -1.0 + 1e-12)
        squared = self._squared_stretch(third, limit)
        stretch = jnp.sqrt(squared)
        factor = _stiffening(squared, limit)
        conformation = identity_like(stress) + stress / factor
        retraction = 2.0 / self.stretch_time_ratio * factor * (1.0 - 1.0 / stretch)
        released = self.constraint_release * stretch ** (2.0 * _EXPONENT)
        retracting = retraction * (conformation + released * stress / factor)
        growth = inner(conformation, rate) - trace(stress) / factor - trace(retracting)
        # d ln k/d Λ²
        slope = 2.0 / (limit * (3.0 - squared / limit) * (1.0 - squared / limit))
        stiffening = slope * growth / 3.0
        return (1.0 - factor) * rate + factor * retracting - stiffening * stress

    def conformation(self, stress: Symmetric) -> Symmetric:
        """Return A = I + σ/k, which may be one where I + σ is none."""
        limit = self.maximum_stretch**2
        squared = self._squared_stretch(trace(stress) / 3.0, limit)
        return identity_like(stress) + stress / _stiffening(squared, limit)

    def _squared_stretch(self, third, limit):
        """Return Λ² from tr σ/3 = k (Λ² − 1), the root between 0 and m."""
        share = (1.0 - 1.0 / limit) / (3.0 - 1.0 / limit)
        linear = share * (3.0 + 1.0 / limit) + third / limit
        constant = 3.0 * share + third
        # of the two roots the smaller, in the form that loses no digits
        return 2.0 * constant / (linear + jnp.sqrt(linear**2 - 4.0 * share / limit * constant))


def _stiffening(squared, limit):
    share = (1.0 - 1.0 / limit) / (3.0 - 1.0 / limit)
    return share * (3.0 - squared / limit) / (1.0 - squared / limit)


class RoliePolyBlend(AbstractConstitutiveLaw):
    """Rolie–Double–Poly law of two components [Boudara et al. 2019, J. Rheol. 63, 71].

    A_ij is the conformation of component i along its entanglements with j; A_i = Σ_j φ_j A_ij, Λ_i
    = √(tr A_i/3), σ = Σ_i φ_i (A_i − I), r_i = (2/τ_s,i)(1 − 1/Λ_i), δ = −1/2:

        A_ij▽ = −½ (1/τ_i + 1/τ_j)(A_ij − I) − r_i A_ij − β r_j Λ_i^{2δ} (A_ij − I).

    The long chains' τ is λ. The four A_ij − I stand behind σ in the state, long before short.
    """

    long_fraction: Float[Array, ""] = eqx.field(converter=as_parameter)  # φ of the long chains
    short_time_ratio: Float[Array, ""] = eqx.field(converter=as_parameter)  # τ/λ of short ones
    stretch_time_ratio: Float[Array, ""] = eqx.field(converter=as_parameter)  # τ_s/τ, long
    short_stretch_time_ratio: Float[Array, ""] = eqx.field(converter=as_parameter)  # τ_s/τ, short
    constraint_release: Float[Array, ""] = eqx.field(converter=as_parameter)  # β
    linear_relaxation: bool = eqx.field(static=True, default=True)

    tensors: ClassVar[int] = 4
    variables: ClassVar[int] = 16
    retracts: ClassVar[bool] = True

    def _times(self) -> tuple[Float[Array, "2"], Float[Array, "2"]]:
        """Return τ_i and τ_s,i over λ."""
        own = jnp.stack([jnp.ones_like(self.short_time_ratio), self.short_time_ratio])
        ratios = jnp.stack([self.stretch_time_ratio, self.short_stretch_time_ratio])
        return own, own * ratios

    def relaxations(self) -> Float[Array, "5 2"]:
        """Return the rates beside −1 at which σ and each tensor relax at rest, and their traces."""
        times, stretching = self._times()
        lost = 0.5 * (1.0 / times[:, None] + 1.0 / times[None, :]) - 1.0
        faster = jnp.broadcast_to(1.0 / stretching[:, None], (2, 2))
        of_pairs = jnp.stack([lost.ravel(), faster.ravel()], axis=1)
        return jnp.concatenate([jnp.zeros((1, 2)), of_pairs])

    def shares(self) -> Float[Array, "4"]:
        share = jnp.stack([self.long_fraction, 1.0 - self.long_fraction])
        return (share[:, None] * share[None, :]).ravel()

    def extra_term(self, stress: State, rate: Symmetric) -> State:
        """Return h of σ, and of each A_ij − I what its change is short of −(A_ij − I)."""
        del rate
        pairs = stress[4:].reshape(2, 2, 4)
        share = jnp.stack([self.long_fraction, 1.0 - self.long_fraction])
        times, stretching = self._times()
        stretch = jax.vmap(stretch_of)(jnp.tensordot(share, pairs, axes=(0, 1)))
        retraction = 2.0 / stretching * (1.0 - 1.0 / stretch)
        lost = 0.5 * (1.0 / times[:, None] + 1.0 / times[None, :])
        released = self.constraint_release * stretch[:, None] ** (2.0 * _EXPONENT) * retraction
        whole = (lost - 1.0 + retraction[:, None] + released)[..., None] * pairs
        extra = whole + retraction[:, None, None] * identity_like(stress[:4])
        total = jnp.tensordot(self.shares(), extra.reshape(4, 4), axes=1)
        return jnp.concatenate([total, extra.ravel()])


def stretch_of(stress: Symmetric) -> Float[Array, ""]:
    """Return Λ = √(tr A/3) of A = I + σ, bounded from below for trial steps of integrators."""
    return jnp.sqrt(jnp.maximum(1.0 + trace(stress) / 3.0, 1e-12))


def _written() -> IsotropicFunction:
    import sympy

    ratio, beta, stretch, r = scalars("stretch_time_ratio", "beta", "Lambda", "r")
    where = {"Lambda": sympy.sqrt(1 + scalars("tr(sigma)") / 3), "r": 2 / ratio * (1 - 1 / stretch)}
    return IsotropicFunction({"I": r, "sigma": r * (1 + beta / stretch)}, where, _LETTERS)


def _written_finite() -> IsotropicFunction:
    import sympy

    ratio, beta, limit = scalars("stretch_time_ratio", "beta", "maximum_stretch")
    m, share, linear, constant, squared = scalars("m", "a", "b", "c", "x")
    stretch, stiffening, r, p, w = scalars("Lambda", "f", "r", "p", "w")
    trace, power = scalars("tr(sigma)", "tr(sigma.gammadot)")
    growth = (power - trace) / stiffening - 3 * r - p * trace
    slope = 2 / (m * (3 - squared / m) * (1 - squared / m))
    where = {
        "m": limit**2,
        "a": (1 - 1 / m) / (3 - 1 / m),
        "b": share * (3 + 1 / m) + trace / (3 * m),
        "c": 3 * share + trace / 3,
        "x": 2 * constant / (linear + sympy.sqrt(linear**2 - 4 * share * constant / m)),
        "Lambda": sympy.sqrt(squared),
        "f": share * (3 - squared / m) / (1 - squared / m),
        "r": 2 / ratio * stiffening * (1 - 1 / stretch),
        "p": r * (1 + beta / stretch) / stiffening,
        "w": slope * growth / 3,
    }
    coefficients = {"gammadot": 1 - stiffening, "I": stiffening * r, "sigma": stiffening * p - w}
    return IsotropicFunction(coefficients, where, _LETTERS)


_LETTERS = {"stretch_time_ratio": r"\theta", "maximum_stretch": r"\Lambda_\mathrm{m}"}
_RANGES = {"stretch_time_ratio": (1e-3, 1.0), "beta": (0.0, 1.0)}
_RANGE_SOURCES = {
    "stretch_time_ratio": "Likhtman & Graham 2003: τ_R/τ_d is 1/(3Z) of a chain with Z "
    "entanglements, from one chain that hardly is entangled to some three hundred",
    "beta": "Likhtman & Graham 2003: the share of released constraints that counts, from none to "
    "all",
}

NAMED = {
    "rolie_poly": NamedLaw(
        "Rolie–Poly",
        RoliePoly,
        _RANGES,
        _RANGE_SOURCES,
        source="Likhtman & Graham 2003, J. Non-Newtonian Fluid Mech. 114, 1",
        written=_written,
    ),
    "rolie_poly_fene": NamedLaw(
        "Rolie–Poly with finite extensibility",
        FiniteRoliePoly,
        _RANGES | {"maximum_stretch": (1.5, 100.0)},
        _RANGE_SOURCES
        | {
            "maximum_stretch": "Fang, Kröger & Öttinger 2000, J. Rheol. 44, 1293: the root of the "
            "number of Kuhn steps between entanglements; at 100 springs are Hooke's"
        },
        source="Kabanemi & Hétu 2009, J. Non-Newtonian Fluid Mech. 160, 113",
        written=_written_finite,
    ),
    "rolie_poly_blend": NamedLaw(
        "Rolie–Poly blend of two lengths",
        RoliePolyBlend,
        {
            "long_fraction": (0.0, 1.0),
            "short_time_ratio": (1e-4, 1.0),
            "stretch_time_ratio": _RANGES["stretch_time_ratio"],
            "short_stretch_time_ratio": _RANGES["stretch_time_ratio"],
            "beta": _RANGES["beta"],
        },
        {
            "long_fraction": "a share of the volume",
            "short_time_ratio": "Likhtman & Graham 2003: τ_d grows as the cube of the length; a "
            "blend of lengths that differ twentyfold has 1e-4",
            "stretch_time_ratio": _RANGE_SOURCES["stretch_time_ratio"],
            "short_stretch_time_ratio": _RANGE_SOURCES["stretch_time_ratio"],
            "beta": _RANGE_SOURCES["beta"],
        },
        source="Boudara, Peterson, Leal & Read 2019, J. Rheol. 63, 71",
        is_one_mode=False,
    ),
}
