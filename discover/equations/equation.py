"""Laws as they leave this package: terms, modes, and where they were tested."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from jaxtyping import Real
from numpy.typing import ArrayLike

from discover.effects.registry import Spelled, spelled_distinctly
from discover.equations.markup import (
    SEPARATOR,
    extra_term_expression,
    law_element,
    law_latex,
)
from discover.equations.parts import LawParts, NamedPart, StatePart, law_parts
from discover.errors import InputError
from discover.laws import AbstractConstitutiveLaw, Fluid
from discover.laws.expansion import law_of_terms
from discover.summary_view import NotebookView
from discover.words import percent_of
from tensor_library.law_terms import Interval, LawTerm, LawTerms

if TYPE_CHECKING:
    import sympy


@dataclass(frozen=True)
class Box:
    """Range of flows."""

    weissenberg: Interval  # least and largest Wi = λ̄ max|γ̇|
    deborah: Interval  # of De, λ̄ω in oscillation and λ̄ over the length of the run else

    @property
    def text(self) -> str:
        """Box in words."""
        return f"Wi {_span(self.weissenberg)}, De {_span(self.deborah)}"

    def to_json(self) -> dict[str, list[float]]:
        """Return the ranges by their letters."""
        return {"Wi": [*map(float, self.weissenberg)], "De": [*map(float, self.deborah)]}


@dataclass(frozen=True)
class Tested:
    """Where a law was learned and where it was tested."""

    learned_in: Box  # flows that the fit saw
    judged_in: Box | None = None  # others in which something is known
    worst_errors: Mapping[str, float] = field(default_factory=dict)  # the largest there, relative

    @property
    def boxes(self) -> dict[str, dict[str, list[float]] | None]:
        """Where it was learned and where judged, as JSON."""
        judged = None if self.judged_in is None else self.judged_in.to_json()
        return {"learned_in": self.learned_in.to_json(), "judged_in": judged}

    @property
    def lines(self) -> list[str]:
        """Sentences on where the law was learned and tested."""
        lines = [f"Learned in {self.learned_in.text}."]
        if self.judged_in is None:
            return [*lines, "Tested in no other flow."]
        errors = ", ".join(f"{name} {percent_of(e)}" for name, e in self.worst_errors.items())
        text = f"Tested in {self.judged_in.text}"
        return [*lines, f"{text}; largest error: {errors}." if errors else f"{text}."]


@dataclass(frozen=True)
class Equation(NotebookView):
    """A fluid in words: λ dσ/dt = Gλγ̇ + λ(L·σ + σ·Lᵀ) − σ − G h(σ/G, λγ̇) for every mode.

    Examples
    --------
    >>> Equation((LawTerm("sigma.sigma", 0.2),), (100.0,), (2.0,)).sympy()  # a Giesekus fluid
    0.2*sigma**2
    """

    terms: tuple[LawTerm, ...]  # h as a sum, dimensionless: stress over G, time over λ
    modulus: tuple[float, ...] = (1.0,)  # G_k in Pa, one for each mode
    relaxation_time: tuple[float, ...] = (1.0,)  # λ_k in s, one for each mode
    linear_relaxation: bool = True  # whether the −σ is there beside h
    solvent_viscosity: float = 0.0  # η_s in Pa s
    title: str = ""  # where the law comes from
    notes: tuple[str, ...] = ()  # what its user has to know
    tested: Tested | None = None  # where it was learned and tested; None where unknown
    named: NamedPart | None = None  # no sum of terms, to whose h the terms are added; None for UCM
    states: tuple[StatePart, ...] = ()  # of the whole fluid: they scale stress or relaxation times

    def __post_init__(self):
        numbers = [*self.modulus, *self.relaxation_time]
        if len(self.modulus) != len(self.relaxation_time) or not self.modulus:
            raise ValueError("An equation needs as many moduli as relaxation times, at least one.")
        if not np.all(np.isfinite(numbers)) or min(numbers) <= 0:
            raise ValueError("Moduli and relaxation times must be positive numbers.")
        values = [v for t in self.terms for v in (t.coefficient, *t.inner.values())]
        if not np.all(np.isfinite([*values, self.solvent_viscosity])):
            raise ValueError("Coefficients of an equation must be finite numbers.")
        if self.named and len(self.named.constants) not in (1, len(self.modulus)):
            raise ValueError("An equation needs constants once for all modes, or once for each.")

    @classmethod
    def of_fluid(cls, fluid: Fluid, parts: LawParts | None = None, **stated: Any) -> "Equation":
        """Return the equation of a fluid; InputError if its law has no name and is no sum."""
        named, terms = parts or law_parts(fluid.law)
        return cls(
            terms, tuple(np.asarray(fluid.modulus).tolist()),
            tuple(np.asarray(fluid.relaxation_time).tolist()),
            fluid.law.linear_relaxation, float(fluid.solvent_viscosity), named=named, **stated,
        )  # fmt: skip

    @property
    def mean_relaxation_time(self) -> float:
        """λ̄ = Σ G λ² / Σ G λ in s, the time in Wi and De."""
        return mean_relaxation_time(self.modulus, self.relaxation_time)

    def of_times(self, factor: float) -> "Equation":
        """Fluid whose times are a factor of those here, moduli the same [Ferry 1980, ch. 11]."""
        return replace(
            self,
            relaxation_time=tuple(factor * time for time in self.relaxation_time),
            solvent_viscosity=factor * self.solvent_viscosity,
            states=tuple(part.of_times(factor) for part in self.states),
        )

    def mode(self, number: int) -> "Equation":
        """Return the equation of one mode alone, counted from 0, without the solvent."""
        named = self.named
        return replace(
            self,
            modulus=(self.modulus[number],),
            relaxation_time=(self.relaxation_time[number],),
            solvent_viscosity=0.0,
            named=None if named is None else NamedPart(named.law, (named.of_mode(number),)),
        )

    def law(self) -> AbstractConstitutiveLaw:
        """Return h as a dimensionless law; InputError if modes differ, or it has a state."""
        if self.states:
            raise InputError(
                f"{', '.join(part.effect for part in self.states)} gives the whole fluid a state, "
                "which no law of one mode carries. Export the equation: the text in Python, "
                "SymPy, UFL or LaTeX has that state's equation too."
            )
        law = None if self.named is None else self.named.built()
        if law is not None and not self.terms:
            return law
        # one expansion has one value of each inner parameter; terms that differ stack
        groups: list[tuple[dict[str, float], list[LawTerm]]] = []
        for term in self.terms:
            for inner, members in groups:
                if all(inner.get(key, value) == value for key, value in term.inner.items()):
                    inner.update(term.inner)
                    members.append(term)
                    break
            else:
                groups.append((dict(term.inner), [term]))
        for _, members in groups or [({}, [])]:
            law = law_of_terms(LawTerms.of(members), self.linear_relaxation, law)
        assert law is not None
        return law

    def fluid(self) -> Fluid:
        """Return the fluid, with units; raises InputError if constants differ from mode to mode."""
        return Fluid(self.law(), self.modulus, self.relaxation_time, self.solvent_viscosity)

    def sympy(self) -> "sympy.Expr":
        """Return h of a mode as a SymPy expression over non-commuting tensors."""
        return extra_term_expression(self.terms, self.named)

    def latex(self) -> str:
        """Return the dimensionless law as one LaTeX equation, and that of states behind it."""
        law = law_latex(self.terms, self.linear_relaxation, named=self.named)
        return SEPARATOR.join([law, *(one.equation for one in self.spelled_states)])

    @property
    def spelled_states(self) -> list[Spelled]:
        """Equations and letters of the states, no letter twice, in LaTeX."""
        spelled = spelled_distinctly(part.own for part in self.states)
        return [spelled[part.effect] for part in self.states]

    @property
    def header(self) -> list[str]:
        """Origin, notes and tested box as plain lines that no file format takes amiss."""
        lines = [self.title, *self.notes, *(() if self.tested is None else self.tested.lines)]
        whole = (" ".join(line.split()) for line in lines if line)
        # without anything that could end a comment or a string
        kept = (
            "".join(c if c.isprintable() and c not in "\"'`\\" else "_" for c in line)
            for line in whole
        )
        return [line.replace("*/", "* /")[:300] for line in kept]

    def modes_table(self) -> pd.DataFrame:
        """Return G_k in Pa and λ_k in s, one line for each mode, and what differs by mode."""
        table = pd.DataFrame({"G_Pa": self.modulus, "lambda_s": self.relaxation_time})
        if self.named is not None:
            for name in self.named.differing:
                table[name] = [one[name] for one in self.named.constants]
        return table

    def _repr_html_(self) -> str:
        # markup of this package, not a sentence to be escaped
        return law_element(self.terms, self.linear_relaxation, self.named) + super()._repr_html_()

    def _shown(self) -> Iterable[Any]:
        if (self.modulus, self.relaxation_time) != ((1.0,), (1.0,)):
            yield self.modes_table()
        if self.solvent_viscosity:
            yield f"Solvent viscosity {self.solvent_viscosity:.4g} Pa s."
        for part in self.states:
            values = ", ".join(f"{name} = {value:.4g}" for name, value in part.values.items())
            yield f"A state of the whole fluid: {part.effect} ({values})."
        yield from () if self.tested is None else self.tested.lines
        yield from self.notes


def mean_relaxation_time(
    modulus: Sequence[float] | ArrayLike, relaxation_time: Sequence[float] | ArrayLike
) -> float:
    """Return λ̄ = Σ G λ² / Σ G λ in s: each mode weighs as its share of the viscosity."""
    g, time = np.asarray(modulus), np.asarray(relaxation_time)
    return float(np.sum(g * time**2) / np.sum(g * time))


def _span(bounds: Interval) -> str:
    low, high = (f"{value:.3g}" for value in bounds)
    return low if low == high else f"{low} to {high}"


def flow_numbers(
    times: Real[np.ndarray, " n"],
    shear_rate: Real[np.ndarray, " n"],
    relaxation_time: float,
    frequency: float | None = None,
) -> tuple[float, float]:
    """Return Wi = λ̄ max|γ̇| and De of one flow: λ̄ω in oscillation, else λ̄/T with its length T.

    `times`, `shear_rate` in s and 1/s. `relaxation_time`: λ̄ in s. `frequency`: ω in rad/s where
    known; otherwise from the changes of sign of the rate.
    """
    length = float(times[-1]) if times[-1] > 0 else 1.0
    if frequency is None:
        flowing = np.abs(shear_rate) > 0
        rate, time = shear_rate[flowing], times[flowing]
        turned = np.flatnonzero(np.diff(np.sign(rate)))
        share = rate[turned] / (rate[turned] - rate[turned + 1])  # of the step, up to the zero
        at = time[turned] + share * (time[turned + 1] - time[turned])
        frequency = 1.0 / length
        if at.size >= 2:
            frequency = np.pi * (at.size - 1) / float(at[-1] - at[0])
    return relaxation_time * float(np.max(np.abs(shear_rate))), relaxation_time * frequency


def box_of(numbers: Iterable[tuple[float, float]]) -> Box | None:
    """Return the smallest box that holds all flows, given by Wi and De; None without flows."""
    pairs = list(numbers)
    if not pairs:
        return None
    weissenberg, deborah = zip(*pairs, strict=True)
    return Box((min(weissenberg), max(weissenberg)), (min(deborah), max(deborah)))


class HasEquation:
    """A result with an `equation`, and what follows from it."""

    def equation(self) -> Equation:
        """Return the law as an equation."""
        raise NotImplementedError

    def sympy(self) -> "sympy.Expr":
        """Return h as a SymPy expression; raises InputError if it is no sum of library terms."""
        return self.equation().sympy()

    def latex(self) -> str:
        """Return the law as LaTeX; raises InputError if it is no sum of library terms."""
        return self.equation().latex()
