"""One way from a term to any notation: LaTeX, MathML, Python, SymPy.

What a term is made of, in which order, and where a sum needs brackets is decided here once. A
notation only says how it writes a tensor, a product or a bracket.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Generic, TypeVar

from tensor_library.integrity_basis import TENSOR_NAMES
from tensor_library.invariants import INVARIANT_NAMES

if TYPE_CHECKING:
    from tensor_library.terms import CandidateTerm

T = TypeVar("T")


class Notation(ABC, Generic[T]):
    """How one format writes the parts of a term."""

    @abstractmethod
    def tensor(self, name: str) -> T:
        """Return the tensor ``I``, ``sigma`` or ``gammadot``."""

    @abstractmethod
    def contraction(self, tensors: Sequence[T]) -> T:
        """Return the tensors contracted in this order, a·b·c."""

    @abstractmethod
    def sum(self, summands: Sequence[T]) -> T:
        """Return a sum that may stand as a factor: in text, with its brackets."""

    @abstractmethod
    def trace(self, tensor: T) -> T:
        """Return the trace of a contraction."""

    @abstractmethod
    def power(self, scalar: T, exponent: int) -> T:
        """Return a trace raised to a power of 2 or more."""

    @abstractmethod
    def number(self, value: float) -> T:
        """Return a number that may stand as a factor: in text, bracketed if it is negative."""

    @abstractmethod
    def letter(self, name: str) -> T:
        """Return the letter of an inner parameter."""

    @abstractmethod
    def exponential(self, rate: T, trace: T) -> T:
        """Return exp(rate · trace) − 1, as a factor."""

    @abstractmethod
    def saturating(self, level: T, trace: T) -> T:
        """Return trace/(1 + level |trace|), as a factor."""

    @abstractmethod
    def product(self, factors: Sequence[T]) -> T:
        """Return scalars times one tensor, in this order."""


def spell(
    term: "CandidateTerm",
    notation: Notation[T],
    coefficient: float | None = None,
    inner: Mapping[str, float] | None = None,
) -> T:
    """Return a term in a notation, as a factor: a sum of tensors is bracketed.

    Parameters
    ----------
    term
        The term.
    notation
        How to write it.
    coefficient
        Number in front; none if None.
    inner
        Inner parameters by name; one that is missing stays a letter.
    """
    factors = [] if coefficient is None else [notation.number(coefficient)]
    if term.form is not None:
        name = term.form.inner_name
        known = name in (inner or {})
        parameter = notation.number((inner or {})[name]) if known else notation.letter(name)
        forms = {"exp": notation.exponential, "saturating": notation.saturating}
        if term.closed_form not in forms:
            raise ValueError(f"The closed form {term.closed_form!r} cannot be written out.")
        trace = notation.trace(notation.tensor("sigma"))
        factors.append(forms[term.closed_form](parameter, trace))
    for name, power in zip(INVARIANT_NAMES, term.powers, strict=True):
        if power:
            trace = notation.trace(_contraction(name[len("tr(") : -1], notation))
            factors.append(trace if power == 1 else notation.power(trace, power))
    summands = [_contraction(name, notation) for name in TENSOR_NAMES[term.tensor].split("+")]
    factors.append(summands[0] if len(summands) == 1 else notation.sum(summands))
    return notation.product(factors)


def _contraction(name: str, notation: Notation[T]) -> T:
    return notation.contraction([notation.tensor(one) for one in name.split(".")])
