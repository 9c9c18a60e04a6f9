"""One term of a law that a learner found."""

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class RecoveredTerm:
    """One term of a recovered law.

    Attributes
    ----------
    term
        Canonical spelling.
    coefficient
        Refitted without penalty (debiased).
    coefficient_penalised
        From the penalised or thresholded problem that selected it, or None where there was none.
    ci95
        95 % interval of `coefficient`, or None where not computed.
    ci95_given_equal_modes
        That of one coefficient for all modes, where `ci95` holds coefficients that differ from mode
        to mode; else None.
    ci95_given_declared
        That with the declared modulus and relaxation time, where `ci95` holds the coefficient with
        those that a linear term amounts to as well; else None.
    inner
        Inner parameters by name.
    latex
        The term as LaTeX, without its coefficient.
    inner_ci95
        95 % intervals of the inner parameters.
    inner_at_one
        For a closed form whose coefficient may be one, as in the law that it is named after:
        each inner parameter with its 95 % interval (value, low, high) if the coefficient is one.
    """

    term: str
    coefficient: float
    coefficient_penalised: float | None = None
    ci95: tuple[float, float] | None = None
    inner: Mapping[str, float] = field(default_factory=dict)
    latex: str = ""
    inner_ci95: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    inner_at_one: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    ci95_given_equal_modes: tuple[float, float] | None = field(default=None, kw_only=True)
    ci95_given_declared: tuple[float, float] | None = field(default=None, kw_only=True)

    @property
    def is_told_from_zero(self) -> bool:
        """Whether its interval says that it is there; not so without one."""
        return self.ci95 is not None and not self.ci95[0] <= 0.0 <= self.ci95[1]
