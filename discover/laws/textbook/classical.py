"""Laws of one tensor: Maxwell's, and those that add to it or scale its relaxation."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from discover.laws.base import AbstractConstitutiveLaw, NamedLaw, as_parameter
from tensor_library.algebra import Symmetric, anticommutator, identity_like, inner, square, trace
from tensor_library.isotropic_function import IsotropicFunction, scalars
from tensor_library.law_terms import LawTerm


class UpperConvectedMaxwell(AbstractConstitutiveLaw):
    """Upper-convected Maxwell law: h = 0   [Oldroyd 1950, Proc. R. Soc. A 200, 523]."""

    linear_relaxation: bool = eqx.field(static=True, default=True)

    def extra_term(self, stress: Symmetric, rate: Symmetric) -> Symmetric:
        del rate
        return jnp.zeros_like(stress)

    def as_terms(self) -> tuple[LawTerm, ...]:
        return ()


class JohnsonSegalman(AbstractConstitutiveLaw):
    """Johnson–Segalman law: h = (ξ/2)(σ·γ̇ + γ̇·σ)   [Johnson & Segalman 1977, JNNFM 2, 255]."""

    slip_parameter: Float[Array, ""] = eqx.field(converter=as_parameter)  # ξ, 0 to 2
    linear_relaxation: bool = eqx.field(static=True, default=True)

    def extra_term(self, stress: Symmetric, rate: Symmetric) -> Symmetric:
        return 0.5 * self.slip_parameter * anticommutator(stress, rate)

    def as_terms(self) -> tuple[LawTerm, ...]:
        return (LawTerm("sigma.gammadot+gammadot.sigma", 0.5 * float(self.slip_parameter)),)


class Giesekus(AbstractConstitutiveLaw):
    """Giesekus law: h = α σ·σ   [Giesekus 1982, JNNFM 11, 69]."""

    mobility: Float[Array, ""] = eqx.field(converter=as_parameter)  # α, 0 to 1
    linear_relaxation: bool = eqx.field(static=True, default=True)

    def extra_term(self, stress: Symmetric, rate: Symmetric) -> Symmetric:
        del rate  # this law has no explicit rate dependence
        return self.mobility * square(stress)

    def as_terms(self) -> tuple[LawTerm, ...]:
        return (LawTerm("sigma.sigma", float(self.mobility)),)


class LinearPhanThienTanner(AbstractConstitutiveLaw):
    """Linear PTT law: h = ε tr(σ) σ   [Phan-Thien & Tanner 1977, JNNFM 2, 353]."""

    extensibility: Float[Array, ""] = eqx.field(converter=as_parameter)  # ε
    linear_relaxation: bool = eqx.field(static=True, default=True)

    def extra_term(self, stress: Symmetric, rate: Symmetric) -> Symmetric:
        del rate
        return self.extensibility * trace(stress) * stress

    def as_terms(self) -> tuple[LawTerm, ...]:
        return (LawTerm("tr(sigma)*sigma", float(self.extensibility)),)


class ExponentialPhanThienTanner(AbstractConstitutiveLaw):
    """Exponential PTT law: h = (exp(ε tr σ) − 1) σ   [Phan-Thien 1978, J. Rheol. 22, 259]."""

    extensibility: Float[Array, ""] = eqx.field(converter=as_parameter)  # ε
    linear_relaxation: bool = eqx.field(static=True, default=True)

    def extra_term(self, stress: Symmetric, rate: Symmetric) -> Symmetric:
        del rate
        # beyond exp(60) a trial is absurd; the cap keeps it finite, to be rejected for its misfit
        return jnp.expm1(jnp.minimum(self.extensibility * trace(stress), 60.0)) * stress

    def as_terms(self) -> tuple[LawTerm, ...]:
        inner = {"epsilon": float(self.extensibility)}
        return (LawTerm("(exp(epsilon*tr(sigma))-1)*sigma", 1.0, inner),)


def _written_linear() -> IsotropicFunction:
    return IsotropicFunction({"sigma": scalars("epsilon") * scalars("tr(sigma)")})


def _written_exponential() -> IsotropicFunction:
    import sympy

    return IsotropicFunction({"sigma": sympy.exp(scalars("epsilon") * scalars("tr(sigma)")) - 1})


_RANGE = {"epsilon": (0.0, 10.0)}
_RANGE_SOURCE = {
    "epsilon": "Phan-Thien & Tanner 1977: fast extension of linear PTT ends at 2 Gλ/ε, which ten "
    "puts to a fifteenth of Trouton's 3 Gλ; fluids have 0.01 to 1"
}


class FenePeterlin(AbstractConstitutiveLaw):
    """FENE-P law [Bird, Dotson & Johnson 1980, JNNFM 7, 213].

    With σ = f A − I and f = (L² − 3)/(L² − tr A) = 1 + tr(σ)/L², eliminating the conformation A
    gives

        h = (f − 1) σ − (ḟ/f)(σ + I),    ḟ = (tr(σ·γ̇) − f tr σ)/(L² − tr A).

    L² → ∞ is UCM.
    """

    maximum_extension_squared: Float[Array, ""] = eqx.field(converter=as_parameter)  # L², over 3
    linear_relaxation: bool = eqx.field(static=True, default=True)

    def extra_term(self, stress: Symmetric, rate: Symmetric) -> Symmetric:
        limit = self.maximum_extension_squared
        return fene_p(1.0 / limit, (limit - 3.0) / limit, stress, rate)

    def as_terms(self) -> tuple[LawTerm, ...]:
        return fene_p_terms(1.0 / float(self.maximum_extension_squared))


def fene_p(
    inverse: Float[Array, ""], rest: Float[Array, ""], stress: Symmetric, rate: Symmetric
) -> Symmetric:
    """Return h of FENE-P with `inverse` q = 1/L² and `rest` 1 − 3q, which may be small."""
    stretch = trace(stress)
    factor = 1.0 + inverse * stretch
    growth = inverse * (inner(stress, rate) - factor * stretch) / rest
    return inverse * stretch * stress - growth * (stress + identity_like(stress))


def fene_p_terms(inverse: float) -> tuple[LawTerm, ...]:
    """Return the extra term of FENE-P, with q = 1/L², multiplied out."""
    growth = inverse / (1.0 - 3.0 * inverse)
    return (
        LawTerm("tr(sigma)*sigma", inverse + growth),
        LawTerm("tr(sigma)^2*sigma", growth * inverse),
        LawTerm("tr(sigma.gammadot)*sigma", -growth),
        LawTerm("tr(sigma)*I", growth),
        LawTerm("tr(sigma)^2*I", growth * inverse),
        LawTerm("tr(sigma.gammadot)*I", -growth),
    )


def _written_fene_p() -> IsotropicFunction:
    limit, trace, power, f, w = scalars("L2", "tr(sigma)", "tr(sigma.gammadot)", "f", "w")
    # with L² − tr A = (L² − 3)/f
    where = {"f": 1 + trace / limit, "w": (power - f * trace) / (limit - 3)}
    return IsotropicFunction({"sigma": f - 1 - w, "I": -w}, where, {"L2": "L^{2}"})


class NonAffine(AbstractConstitutiveLaw):
    """A law with (ξ/2)(σ·γ̇ + γ̇·σ) added to its h   [Johnson & Segalman 1977, JNNFM 2, 255]."""

    affine: AbstractConstitutiveLaw
    slip_parameter: Float[Array, ""] = eqx.field(converter=as_parameter)  # ξ, 0 to 2
    linear_relaxation: bool = eqx.field(static=True, default=True)

    def extra_term(self, stress: Symmetric, rate: Symmetric) -> Symmetric:
        slip = 0.5 * self.slip_parameter * anticommutator(stress, rate)
        return self.affine.extra_term(stress, rate) + slip

    def as_terms(self) -> tuple[LawTerm, ...] | None:
        slip = LawTerm("sigma.gammadot+gammadot.sigma", 0.5 * float(self.slip_parameter))
        affine = self.affine.as_terms()
        return None if affine is None else (*affine, slip)


class Saramito(AbstractConstitutiveLaw):
    """Elastoviscoplastic law h = −min(1, Y/|σ_d|) σ   [Saramito 2007, JNNFM 145, 1].

    |σ_d|² = ½ σ_d:σ_d of the deviator σ_d; Y is the yield stress over the modulus.
    """

    yield_strain: Float[Array, ""] = eqx.field(converter=as_parameter)  # Y
    linear_relaxation: bool = eqx.field(static=True, default=True)

    def extra_term(self, stress: Symmetric, rate: Symmetric) -> Symmetric:
        del rate
        deviator = stress - trace(stress) / 3.0 * identity_like(stress)
        squared = 0.5 * inner(deviator, deviator)
        yielded = squared > self.yield_strain**2
        # so that the derivative is finite where nothing flows
        size = jnp.sqrt(jnp.where(yielded, squared, 1.0))
        return -jnp.where(yielded, self.yield_strain / size, 1.0) * stress


def _written_saramito() -> IsotropicFunction:
    import sympy

    yielding, size = scalars("yield_strain", "size")
    squared = scalars("tr(sigma.sigma)") / 2 - scalars("tr(sigma)") ** 2 / 6
    # bounded, so that the derivative is finite where nothing flows
    where = {"size": sympy.sqrt(sympy.Max(squared, 1e-24))}
    letters = {"yield_strain": "Y", "size": r"\left|\sigma_\mathrm{d}\right|"}
    return IsotropicFunction({"sigma": -yielding / sympy.Max(yielding, size)}, where, letters)


class WhiteMetzner(AbstractConstitutiveLaw):
    """h = [(1 + (kγ̇)²)^{(1−n)/2} − 1] σ [White & Metzner, J. Appl. Polym. Sci. 7, 1867, 1963]."""

    onset: Float[Array, ""] = eqx.field(converter=as_parameter)  # k, over λ
    exponent: Float[Array, ""] = eqx.field(converter=as_parameter)  # n
    linear_relaxation: bool = eqx.field(static=True, default=True)

    def extra_term(self, stress: Symmetric, rate: Symmetric) -> Symmetric:
        squared = self.onset**2 * 0.5 * inner(rate, rate)
        return ((1.0 + squared) ** (0.5 * (1.0 - self.exponent)) - 1.0) * stress


def _written_white_metzner() -> IsotropicFunction:
    k, n, squared = scalars("k", "n", "tr(gammadot.gammadot)")
    return IsotropicFunction({"sigma": (1 + k**2 * squared / 2) ** ((1 - n) / 2) - 1})


NAMED = {
    "ucm": NamedLaw(
        "upper-convected Maxwell",
        UpperConvectedMaxwell,
        {},
        source="Oldroyd 1950, Proc. R. Soc. London A 200, 523",
        written=lambda: IsotropicFunction({}),
    ),
    "johnson_segalman": NamedLaw(
        "Johnson–Segalman",
        JohnsonSegalman,
        {"xi": (0.0, 2.0)},
        {"xi": "Johnson & Segalman 1977: from the upper (0) to the lower (2) convected derivative"},
        source="Johnson & Segalman 1977, J. Non-Newtonian Fluid Mech. 2, 255",
        written=lambda: IsotropicFunction({"sigma.gammadot+gammadot.sigma": scalars("xi") / 2}),
    ),
    "giesekus": NamedLaw(
        "Giesekus",
        Giesekus,
        {"alpha": (0.0, 1.0)},
        {"alpha": "Giesekus 1982: a mobility that no stress can make negative"},
        source="Giesekus 1982, J. Non-Newtonian Fluid Mech. 11, 69",
        written=lambda: IsotropicFunction({"sigma.sigma": scalars("alpha")}),
    ),
    "ptt_linear": NamedLaw(
        "linear PTT",
        LinearPhanThienTanner,
        _RANGE,
        _RANGE_SOURCE,
        source="Phan-Thien & Tanner 1977, J. Non-Newtonian Fluid Mech. 2, 353",
        written=_written_linear,
    ),
    "ptt_exponential": NamedLaw(
        "exponential PTT",
        ExponentialPhanThienTanner,
        _RANGE,
        _RANGE_SOURCE,
        source="Phan-Thien 1978, J. Rheol. 22, 259",
        written=_written_exponential,
    ),
    "fene_p": NamedLaw(
        "FENE-P",
        FenePeterlin,
        {"L2": (3.0 + 1e-6, 1e6)},
        {
            "L2": "Bird, Dotson & Johnson 1980: a chain at rest has L² = 3 already; at a million, "
            "longer than of any polymer, the springs are Hooke's"
        },
        source="Bird, Dotson & Johnson 1980, J. Non-Newtonian Fluid Mech. 7, 213",
        written=_written_fene_p,
    ),
    "saramito": NamedLaw(
        "Saramito",
        Saramito,
        {"yield_strain": (0.0, 10.0)},
        {
            "yield_strain": "Saramito 2007: the strain at which the solid yields; gels and foams "
            "yield at a tenth to a few"
        },
        source="Saramito 2007, J. Non-Newtonian Fluid Mech. 145, 1",
        written=_written_saramito,
    ),
    "white_metzner": NamedLaw(
        "White–Metzner",
        WhiteMetzner,
        {"k": (0.0, 100.0), "n": (0.0, 1.0)},
        {
            "k": "a law whose thinning begins at a hundredth of the rate 1/λ has another λ",
            "n": "Bird, Armstrong & Hassager 1987, ch. 4: from a stress that rises with rate as a "
            "Newtonian fluid's (1) to one that does not rise (0)",
        },
        source="White & Metzner 1963, J. Appl. Polym. Sci. 7, 1867",
        written=_written_white_metzner,
    ),
}


def _with_slip(named: NamedLaw) -> NamedLaw:
    slip = NAMED["johnson_segalman"]

    def build(constant, xi) -> NonAffine:
        return NonAffine(affine=named.build(constant), slip_parameter=xi)

    def written() -> IsotropicFunction:
        assert named.written is not None
        assert slip.written is not None
        affine, slipping = named.written(), slip.written()
        return IsotropicFunction({**affine.coefficients, **slipping.coefficients}, affine.where)

    return NamedLaw(
        f"{named.title} with slip",
        build,
        {**named.parameters, **slip.parameters},
        {**named.range_sources, **slip.range_sources},
        source=f"{named.source}; {slip.source}",
        written=written,
    )


NAMED |= {
    f"{name}_non_affine": _with_slip(NAMED[name])
    for name in ("giesekus", "ptt_linear", "ptt_exponential")
}
