"""One term of a law that a learner found."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from tensor_library.law_terms import Interval, LawTerm


@dataclass(frozen=True)
class RecoveredTerm(LawTerm):
    """One term of a recovered law: a `LawTerm`, and what the learner knows beyond it.

    Attributes
    ----------
    term, inner, ci95
        As in `LawTerm`.
    coefficient
        Refitted without penalty (debiased).
    coefficient_penalised
        From the penalised or thresholded problem that selected it, or None where there was none.
    latex
        The term as LaTeX, without its coefficient.
    inner_ci95
        95 % intervals of the inner parameters.
    inner_at_one
        For a closed form whose coefficient may be one, as in the law that it is named after:
        each inner parameter with its 95 % interval (value, low, high) if the coefficient is one.
    ci95_given_equal_modes
        That of one coefficient for all modes, where `ci95` holds coefficients that differ from mode
        to mode; else None.
    ci95_given_declared
        That with the declared modulus and relaxation time, where `ci95` holds the coefficient with
        those that a linear term amounts to as well; else None.
    """

    coefficient_penalised: float | None = field(default=None, kw_only=True)
    latex: str = field(default="", kw_only=True)
    inner_ci95: Mapping[str, Interval] = field(default_factory=dict, kw_only=True)
    inner_at_one: Mapping[str, tuple[float, float, float]] = field(
        default_factory=dict, kw_only=True
    )
    ci95_given_equal_modes: Interval | None = field(default=None, kw_only=True)
    ci95_given_declared: Interval | None = field(default=None, kw_only=True)

    @property
    def is_told_from_zero(self) -> bool:
        """Whether its interval says that it is there; not so without one."""
        return self.ci95 is not None and not self.ci95[0] <= 0.0 <= self.ci95[1]

    @property
    def in_law(self) -> LawTerm:
        """The term as an equation holds it."""
        return LawTerm(self.term, self.coefficient, self.inner, self.ci95)

    def to_json(self) -> dict[str, Any]:
        """Return everything as JSON-able values; `from_json` undoes it."""
        first = dict.fromkeys(("term", "coefficient", "coefficient_penalised", "ci95"))
        return first | {one.name: getattr(self, one.name) for one in fields(self)}
