"""Scalar functions of the invariants that no polynomial of low degree replaces.

Each has one inner parameter, which enters nonlinearly and so is fitted apart from the
coefficients. All vanish at zero stress, so that a term keeps the small-strain limit of the law
it is added to.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import jax.numpy as jnp
from jaxtyping import Array, Float


@dataclass(frozen=True)
class ClosedForm:
    """A scalar function of tr σ with one inner parameter.

    Attributes
    ----------
    name
        Key under which a library description asks for it.
    spelling
        Canonical text, used in reports and JSON.
    inner_name, inner_default, inner_bounds
        The inner parameter, the value a fit starts from, and where it is admissible.
    function
        ``f(trace_of_stress, inner)``.
    complexity
        Number of operations, as a measure of how much the form costs in model selection.
    source
        Where the form comes from.
    """

    name: str
    spelling: str
    inner_name: str
    inner_default: float
    inner_bounds: tuple[float, float]
    function: Callable[[Float[Array, ""], Float[Array, ""]], Float[Array, ""]]
    complexity: int
    source: str


def _exponential(trace_of_stress: Float[Array, ""], inner: Float[Array, ""]) -> Float[Array, ""]:
    # Beyond exp(60) a trial law is absurd in any flow; the cap keeps its integration finite, so
    # that the trial is rejected for its misfit and not for an overflow.
    return jnp.expm1(jnp.minimum(inner * trace_of_stress, 60.0))


def _saturating(trace_of_stress: Float[Array, ""], inner: Float[Array, ""]) -> Float[Array, ""]:
    return trace_of_stress / (1.0 + inner * jnp.abs(trace_of_stress))


CLOSED_FORMS: Mapping[str, ClosedForm] = {
    form.name: form
    for form in (
        ClosedForm(
            "exp",
            "(exp(epsilon*tr(sigma))-1)",
            "epsilon",
            0.25,
            (1e-4, 2.0),
            _exponential,
            3,
            "Phan-Thien 1978, J. Rheol. 22, 259",
        ),
        ClosedForm(
            "saturating",
            "(tr(sigma)/(1+kappa*abs(tr(sigma))))",
            "kappa",
            0.1,
            (1e-4, 10.0),
            _saturating,
            4,
            "first Padé form of a coefficient that levels off",
        ),
    )
}
