"""Laws of this package as sums of library terms, where they are one."""

from functools import singledispatch

import numpy as np

from discover.effects.base import ConstitutiveEffect
from discover.effects.constitutive.finite_extensibility import shares_of_fene_p
from discover.equations.term import EquationTerm
from discover.errors import InputError
from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.expansion import LibraryExpansion
from discover.laws.fene_p import FenePeterlin
from discover.laws.giesekus import Giesekus
from discover.laws.johnson_segalman import JohnsonSegalman
from discover.laws.maxwell import UpperConvectedMaxwell
from discover.laws.phan_thien_tanner import ExponentialPhanThienTanner, LinearPhanThienTanner
from discover.laws.tensor_basis_network import TensorBasisNetwork
from tensor_library.closed_forms import CLOSED_FORMS
from tensor_library.integrity_basis import TENSOR_NAMES

EXPONENTIAL = f"{CLOSED_FORMS['exp'].spelling}*sigma"


@singledispatch
def law_terms(law: AbstractConstitutiveLaw) -> tuple[EquationTerm, ...]:
    """Return h of a law as a sum of terms.

    Raises
    ------
    InputError
        If the law is no such sum.
    """
    raise InputError(
        f"A law of the kind {type(law).__name__} is no sum of library terms, so it cannot be "
        "written out. Write out a law found by sparse regression instead."
    )


@law_terms.register
def _(law: UpperConvectedMaxwell):
    del law
    return ()


@law_terms.register
def _(law: Giesekus):
    return (EquationTerm("sigma.sigma", float(law.mobility)),)


@law_terms.register
def _(law: JohnsonSegalman):
    return (EquationTerm("sigma.gammadot+gammadot.sigma", 0.5 * float(law.slip_parameter)),)


@law_terms.register
def _(law: LinearPhanThienTanner):
    return (EquationTerm("tr(sigma)*sigma", float(law.extensibility)),)


@law_terms.register
def _(law: ExponentialPhanThienTanner):
    return (EquationTerm(EXPONENTIAL, 1.0, {"epsilon": float(law.extensibility)}),)


@law_terms.register
def _(law: FenePeterlin):
    return finitely_extensible_terms(1.0 / float(law.maximum_extension_squared))


@law_terms.register
def _(law: LibraryExpansion):
    inner = dict(zip(law.library.inner_names, map(float, law.inner), strict=True))
    own = tuple(
        EquationTerm(term.name, float(value), {name: inner[name] for name in term.inner_names})
        for term, value in zip(law.library.terms, law.coefficients, strict=True)
        if float(value) != 0.0
    )
    return own if law.base is None else combined(law_terms(law.base) + own)


@law_terms.register
def _(law: TensorBasisNetwork):
    if np.any(np.asarray(law.network_mask) != 0):
        raise InputError(
            "The network's coefficients vary with the invariants, so it is no sum of terms. Write "
            "out its projection on the library: the terms of its result."
        )
    own = tuple(
        EquationTerm(name, float(value))
        for name, value in zip(TENSOR_NAMES, law.constants, strict=True)
        if float(value) != 0.0
    )
    return own if law.base is None else combined(law_terms(law.base) + own)


def finitely_extensible_terms(inverse: float) -> tuple[EquationTerm, ...]:
    """Return the six terms of FENE-P with q = 1/L²."""
    return tuple(EquationTerm(*share) for share in shares_of_fene_p(inverse))


def effect_terms(effect: ConstitutiveEffect, values: np.ndarray) -> tuple[EquationTerm, ...]:
    """Return what a constitutive effect adds to h as a sum of terms.

    Parameters
    ----------
    effect
        The effect.
    values
        Its parameters in their order, shape (p,).

    Raises
    ------
    InputError
        If what it adds is no such sum.
    """
    shares = effect.as_terms([float(value) for value in values])
    if shares is None:
        raise InputError(
            f"What the effect {effect.name!r} adds is no sum of library terms, so the law cannot "
            "be written out. Its equation and parameters are in loop.json and equations.tex."
        )
    return tuple(EquationTerm(*share) for share in shares)


def combined(terms: tuple[EquationTerm, ...]) -> tuple[EquationTerm, ...]:
    """Return the sum with equal terms added up, in the order of their first appearance."""
    found: dict[tuple, EquationTerm] = {}
    for term in terms:
        key = (term.term, tuple(sorted(term.inner.items())))
        if key in found:
            total = found[key].coefficient + term.coefficient
            found[key] = EquationTerm(term.term, total, term.inner)
        else:
            found[key] = term
    return tuple(found.values())
