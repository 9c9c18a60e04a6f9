"""One term of a law as it leaves this package."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

from tensor_library.terms import parse_term

Interval = tuple[float, float]


@runtime_checkable
class TermLike(Protocol):
    """What a term of a law has, whether a learner found it or a file gave it."""

    @property
    def term(self) -> str:
        """Canonical spelling."""
        ...

    @property
    def coefficient(self) -> float:
        """Its coefficient in h."""
        ...

    @property
    def inner(self) -> Mapping[str, float]:
        """Inner parameters by name."""
        ...


@dataclass(frozen=True)
class EquationTerm:
    """One term c·term of h.

    Attributes
    ----------
    term
        Canonical spelling, as `tensor_library.parse_term` reads it.
    coefficient
        c, dimensionless.
    inner
        Inner parameters by name; the form's default is put in where one is missing, so that every
        format writes the same number.
    ci95
        95 % interval of c, or None where c was declared or the interval not computed.

    Raises
    ------
    ValueError
        If the spelling is not canonical, or the term has no such inner parameter.
    """

    term: str
    coefficient: float
    inner: Mapping[str, float] = field(default_factory=dict)
    ci95: Interval | None = None

    @classmethod
    def of(cls, terms: Iterable[Any]) -> tuple["EquationTerm", ...]:
        """Return terms that have all that these have, such as a learner's, as these."""
        return tuple(cls(t.term, t.coefficient, t.inner, t.ci95) for t in terms)

    def __post_init__(self):
        # what nobody could write out again is refused here
        form = parse_term(self.term).form
        values = {} if form is None else {form.inner_name: form.inner_default}
        unknown = [name for name in self.inner if name not in values]
        if unknown:
            raise ValueError(
                f"The term {self.term!r} has no inner parameter {unknown[0]!r}; it has "
                f"{', '.join(values) or 'none'}."
            )
        object.__setattr__(self, "inner", values | dict(self.inner))
