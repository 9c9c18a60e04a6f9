"""Laws as sums of terms: one term with its coefficient, and the sum over a library."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, TypeVar

import numpy as np
from jaxtyping import Float

from tensor_library.closed_forms import CLOSED_FORMS
from tensor_library.library import TermLibrary
from tensor_library.terms import parse_term

Interval = tuple[float, float]
_Term = TypeVar("_Term", bound="LawTerm")


@dataclass(frozen=True)
class LawTerm:
    """One term c·term of the extra term h of a law; ValueError where none can be read so.

    Attributes
    ----------
    term, inner
        Canonical spelling, and inner parameters of a closed form by name; by default its own.
    coefficient, ci95
        c, dimensionless, and its 95 % interval; None where declared or not computed.

    Examples
    --------
    >>> LawTerm("(exp(epsilon*tr(sigma))-1)*sigma", 1.0, {"epsilon": 0.3}).inner
    {'epsilon': 0.3}
    """

    term: str
    coefficient: float
    inner: Mapping[str, float] = field(default_factory=dict)
    ci95: Interval | None = None

    def __post_init__(self):
        # what nobody could write out again is refused here
        parsed = parse_term(self.term)
        form = parsed.form
        values = {} if form is None else {form.inner_name: form.inner_default}
        unknown = [name for name in self.inner if name not in values]
        if unknown:
            raise ValueError(
                f"The term {self.term!r} has no inner parameter {unknown[0]!r}; it has "
                f"{', '.join(values) or 'none'}."
            )
        object.__setattr__(self, "term", parsed.name)
        object.__setattr__(self, "inner", values | dict(self.inner))

    def to_json(self) -> dict[str, Any]:
        """Return the term as JSON-able values; an interval only where there is one."""
        told = {} if self.ci95 is None else {"ci95": list(self.ci95)}
        own = {"term": self.term, "coefficient": self.coefficient, "inner": dict(self.inner)}
        return own | told

    @classmethod
    def from_json(cls: type[_Term], content: Mapping[str, Any]) -> _Term:
        """Return the term that `to_json` wrote; keys beside are passed over."""
        known = [one.name for one in fields(cls) if one.name in content]
        return cls(**{name: _tuples(content[name]) for name in known})


@dataclass(frozen=True)
class LawTerms:
    """Sum of terms as a library holds it: `coefficients` by spelling, one value of each `inner`.

    Examples
    --------
    >>> LawTerms.of([LawTerm("sigma.sigma", 0.2)])
    LawTerms(coefficients={'sigma.sigma': 0.2}, inner={})
    """

    coefficients: Mapping[str, float] = field(default_factory=dict)
    inner: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, terms: Iterable[LawTerm]) -> "LawTerms":
        """Return the sum of these terms.

        Raises ValueError if a term stands there twice, or an inner parameter has two values.
        """
        coefficients: dict[str, float] = {}
        inner: dict[str, float] = {}
        for term in terms:
            if term.term in coefficients:
                raise ValueError(f"The term {term.term!r} stands there twice.")
            coefficients[term.term] = term.coefficient
            for name, value in term.inner.items():
                if inner.setdefault(name, value) != value:
                    raise ValueError(f"{name} has two values, {inner[name]:g} and {value:g}.")
        # in the order of a library's, which covariances of a fit follow
        order = [form.inner_name for form in CLOSED_FORMS.values() if form.inner_name in inner]
        return cls(coefficients, {name: inner[name] for name in order})

    @property
    def terms(self) -> tuple[LawTerm, ...]:
        """The terms one by one."""
        return tuple(
            LawTerm(name, value, {n: self.inner[n] for n in own if n in self.inner})
            for name, value in self.coefficients.items()
            for own in [parse_term(name).inner_names]
        )

    def over(self, library: TermLibrary) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " m"]]:
        """Return coefficients over a library that holds the terms, and its inner parameters."""
        coefficients = np.zeros(len(library))
        for name, value in self.coefficients.items():
            coefficients[library.names.index(name)] = value
        defaults = zip(library.inner_names, library.inner_default, strict=True)
        inner = [self.inner.get(name, default) for name, default in defaults]
        return coefficients, np.asarray(inner, dtype=float)


def _tuples(value: Any) -> Any:
    """Return what JSON holds with tuples for lists."""
    if isinstance(value, Mapping):
        return {name: _tuples(item) for name, item in value.items()}
    return tuple(map(_tuples, value)) if isinstance(value, list | tuple) else value


def spell(coefficients: Mapping[str, float | int]) -> str:
    """Return a sum of terms as text, such as ``tr(sigma)*sigma − 2 gammadot``."""
    text = ""
    for name, value in coefficients.items():
        size = f"{abs(value):.4g}"
        sign = "−" if value < 0 else "+"
        tensor = f"({name})" if "+" in name and "*" not in name else name
        text += f" {sign} " if text else ("−" if value < 0 else "")
        text += tensor if size == "1" else f"{size} {tensor}"
    return text or "0"
