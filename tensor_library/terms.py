"""Candidate terms: tensor × invariant multipliers × closed-form scalar."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
from jaxtyping import Array, Float

from tensor_library.algebra import (
    INVARIANT_NAMES,
    INVARIANT_ORDERS,
    TENSOR_NAMES,
    TENSOR_ORDERS,
    Symmetric,
    integrity_basis,
    scalar_invariants,
)
from tensor_library.closed_forms import CLOSED_FORMS, ClosedForm
from tensor_library.notation import LatexNotation, Notation

_NO_POWERS = (0,) * len(INVARIANT_NAMES)


@dataclass(frozen=True)
class CandidateTerm:
    """One term that a constitutive law may hold.

    Attributes
    ----------
    tensor, powers, closed_form
        Index into `TENSOR_NAMES`, exponents of `INVARIANT_NAMES`, key of `CLOSED_FORMS` or None.

    Examples
    --------
    >>> CandidateTerm(tensor=1, powers=(1, 0, 0, 0, 0, 0, 0, 0)).name
    'tr(sigma)*sigma'
    """

    tensor: int
    powers: tuple[int, ...] = _NO_POWERS
    closed_form: str | None = None

    def __post_init__(self):
        if not 0 <= self.tensor < len(TENSOR_NAMES):
            raise ValueError(f"tensor must be 0 to {len(TENSOR_NAMES) - 1}; got {self.tensor}.")
        if len(self.powers) != len(INVARIANT_NAMES) or min(self.powers) < 0:
            raise ValueError(
                f"powers must be {len(INVARIANT_NAMES)} non-negative integers; got {self.powers}."
            )
        if self.closed_form is not None and self.closed_form not in CLOSED_FORMS:
            raise ValueError(
                f"Unknown closed form {self.closed_form!r}; known are {', '.join(CLOSED_FORMS)}."
            )

    @property
    def form(self) -> ClosedForm | None:
        """The closed form itself, or None."""
        return None if self.closed_form is None else CLOSED_FORMS[self.closed_form]

    @property
    def digest_beside_fields(self) -> tuple:
        """What a compiled program depends on beside the fields: a name is not its function."""
        return () if self.form is None else (self.form.function,)

    @property
    def degree(self) -> int:
        """Total degree in the invariants."""
        return sum(self.powers)

    @property
    def name(self) -> str:
        """Canonical spelling, multipliers first: ``tr(sigma)*sigma``."""
        factors = [] if self.form is None else [self.form.spelling]
        for invariant, power in zip(INVARIANT_NAMES, self.powers, strict=True):
            if power:
                factors.append(invariant if power == 1 else f"{invariant}^{power}")
        tensor = TENSOR_NAMES[self.tensor]
        if factors and "+" in tensor:
            tensor = f"({tensor})"
        return "*".join([*factors, tensor])

    @property
    def complexity(self) -> int:
        """Number of tensors multiplied, plus the cost of the closed form."""
        invariants = sum(p * o for p, o in zip(self.powers, INVARIANT_ORDERS, strict=True))
        form = 0 if self.form is None else self.form.complexity
        return 1 + TENSOR_ORDERS[self.tensor] + invariants + form

    @property
    def inner_names(self) -> tuple[str, ...]:
        """Names of the inner parameters, none or one."""
        return () if self.form is None else (self.form.inner_name,)

    def evaluate(
        self,
        stress: Symmetric,
        rate: Symmetric,
        inner: Mapping[str, Float[Array, ""]] | None = None,
    ) -> Symmetric:
        """Return the value of the term at one state.

        Parameters
        ----------
        stress, rate, inner
            Dimensionless: both of shape (3, 3) or (4,); inner parameters by name, of shape ().
        """
        invariants = scalar_invariants(stress, rate)
        value = integrity_basis(stress, rate)[self.tensor]
        for index, power in enumerate(self.powers):
            if power:
                value = invariants[index] ** power * value
        if self.form is not None:
            parameter = (inner or {}).get(self.form.inner_name, self.form.inner_default)
            value = self.form.function(invariants[0], jnp.asarray(parameter)) * value
        return value

    def spell(
        self,
        notation: Notation,
        coefficient: float | None = None,
        inner: Mapping[str, float] | None = None,
    ) -> Any:
        """Return the term in a notation, as a factor: a sum of tensors is bracketed.

        Parameters
        ----------
        notation, coefficient, inner
            How to write it; number in front, if any; inner parameters by name, letters where
            missing.
        """
        factors = [] if coefficient is None else [notation.number(coefficient)]
        if self.form is not None:
            name = self.form.inner_name
            known = name in (inner or {})
            parameter = notation.number((inner or {})[name]) if known else notation.letter(name)
            trace = notation.spelled("tr(sigma)")
            if self.form.expression is not None:
                factors.append(notation.function(self.form.expression, trace, parameter))
            else:
                built_in = {"exp": notation.exponential, "saturating": notation.saturating}
                factors.append(built_in[self.form.name](parameter, trace))
        for name, power in zip(INVARIANT_NAMES, self.powers, strict=True):
            if power:
                trace = notation.spelled(name)
                factors.append(trace if power == 1 else notation.power(trace, power))
        return notation.product([*factors, notation.spelled(TENSOR_NAMES[self.tensor])])

    def latex(self) -> str:
        """Return the term as LaTeX, ready for a coefficient in front: a sum has its brackets."""
        return self.spell(LatexNotation())


def parse_term(name: str) -> CandidateTerm:
    """Return the term with this canonical spelling, which is matched, never evaluated.

    Raises ValueError if the text is none.

    Examples
    --------
    >>> parse_term("tr(sigma)*sigma").complexity
    3
    """
    rest = name.replace(" ", "")
    closed_form = None
    for key, form in CLOSED_FORMS.items():
        if rest.startswith(form.spelling + "*"):
            closed_form, rest = key, rest[len(form.spelling) + 1 :]
    powers: list[int] = list(_NO_POWERS)
    while match := re.match(r"(tr\([a-z.]+\))(?:\^(\d{1,2}))?\*", rest):
        if match[1] not in INVARIANT_NAMES:
            break
        powers[INVARIANT_NAMES.index(match[1])] += int(match[2] or 1)
        rest = rest[match.end() :]
    tensor = rest[1:-1] if rest.startswith("(") and rest.endswith(")") else rest
    if tensor not in TENSOR_NAMES:
        raise ValueError(
            f"Cannot read the term {name!r}: {tensor!r} is not one of the tensors "
            f"{', '.join(TENSOR_NAMES)}. Write invariant multipliers first, such as "
            "'tr(sigma)*sigma'."
        )
    return CandidateTerm(TENSOR_NAMES.index(tensor), tuple(powers), closed_form)
