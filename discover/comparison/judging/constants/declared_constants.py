"""Linear terms of a law found that are a declared constant in other words.

In dσ/dτ = γ̇ + L·σ + σ·Lᵀ − σ − h, made dimensionless by a modulus G and a time λ, a term c σ of h
is a time of λ/(1 + c), and a term c γ̇ a modulus of (1 − c) G: with these the term is gone, and the
others keep their form. It is one law, so no data in any flow tell the term from a wrong
declaration.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from discover.comparison.judging.identifiability import SEPARATED
from discover.comparison.judging.statements import Statement
from discover.identify.rivals.bands import PredictionBand
from discover.learners import RecoveredTerm
from discover.study.declared_model import DeclaredModel
from tensor_library.integrity_basis import TENSOR_NAMES
from tensor_library.invariants import INVARIANT_NAMES
from tensor_library.terms import parse_term

TIME_TERM, MODULUS_TERM = "sigma", "gammadot"
"""Terms that amount to another relaxation time and to another modulus."""

LINEAR_TERMS = (TIME_TERM, MODULUS_TERM)
"""Terms that change the moduli at vanishing strain."""

_SEEN = 1e-3
"""Relative difference of a constant that a term amounts to, from which on it is told if its
interval says that there is one; exact data tell smaller ones, which are arithmetic."""


@dataclass(frozen=True)
class OtherConstant:
    """A declared constant that a linear term found amounts to.

    Attributes
    ----------
    declared
        What was declared, in s or Pa; None where there are several modes.
    factor, ci95
        On what was declared, and its 95 % interval; None where it has no positive end.
    slip
        Of the wall, in 1/(Pa s), with which a Maxwell fluid of the declared time has the same σ12;
        None where there is no such.
    """

    term: str
    coefficient: float
    declared: float | None
    factor: float
    ci95: tuple[float, float] | None
    slip: float | None = None

    @property
    def name(self) -> str:
        """The constant as a study spells it."""
        return "relaxation_time_s" if self.term == TIME_TERM else "modulus_Pa"

    @property
    def text(self) -> str:
        """What the term is the same as, as part of a sentence."""
        noun, unit = ("relaxation time", "s") if self.term == TIME_TERM else ("modulus", "Pa")
        plural = "relaxation times" if self.term == TIME_TERM else "moduli"
        size = self.declared or 1.0
        span = ""
        if self.ci95 is not None:
            span = " (95 % interval {:.4g} to {:.4g})".format(*(size * edge for edge in self.ci95))
        value = f"{size * self.factor:.4g}"
        if self.declared is None:
            same = f"{plural} that are all {value} times the declared ones{span}"
        else:
            same = f"a {noun} of {value} {unit}{span} in place of {self.declared:.4g} {unit}"
        if self.term == MODULUS_TERM:
            same += f", or as a transducer that shows {self.factor:.4g} times the stress"
        elif self.slip is not None:
            slip = f"{self.slip:.4g} 1/(Pa s)"
            same += f", or, as far as σ12 of a Maxwell fluid tells, as wall slip of {slip}"
        coefficient = f"{self.coefficient:.4g}".replace("-", "−")
        return f"{coefficient} {self.term} is the same as {same}: these data cannot tell"


def other_constants(terms: Iterable[RecoveredTerm], model: DeclaredModel) -> list[OtherConstant]:
    """Return which declared constants the linear terms of a law amount to.

    What differs by less than an experiment can be expected to see is none, unless this one saw it;
    nor is a term that leaves no positive time or modulus, or one without an interval, which other
    terms may replace.
    """
    found = []
    for term in terms:
        if term.term not in LINEAR_TERMS or term.ci95 is None:
            continue
        values = (term.coefficient, *term.ci95)
        if term.term == TIME_TERM:
            totals = [float(model.law.linear_relaxation) + value for value in values]
            declared = model.relaxation_time
        else:
            totals = [1.0 - value for value in values]
            declared = model.modulus
        if totals[0] <= 0.0:
            continue
        factor = 1.0 / totals[0] if term.term == TIME_TERM else totals[0]
        limits = None
        if min(totals) > 0.0:
            low, high = sorted(1.0 / t if term.term == TIME_TERM else t for t in totals[1:])
            limits = low, high
        if abs(factor - 1.0) > (_SEEN if _found(term, model) else SEPARATED):
            alone = float(declared[0]) if len(declared) == 1 else None
            slip = _slip(term, model) if term.term == TIME_TERM and alone is not None else None
            found.append(OtherConstant(term.term, term.coefficient, alone, factor, limits, slip))
    return found


def _found(term: RecoveredTerm, model: DeclaredModel) -> bool:
    """Return whether a linear term is more than its interval leaves of none.

    Where relaxation is left to the learner its term is there in any case.
    """
    learnt = term.term == TIME_TERM and not model.law.linear_relaxation
    return term.is_told_from_zero and not learnt


def _slip(term: RecoveredTerm, model: DeclaredModel) -> float | None:
    """Return the slip s that a term c σ amounts to in σ12 of a Maxwell fluid, c = s G λ.

    The fluid feels γ̇ − s σ12, so that σ12' = G (γ̇ − s σ12) − σ12/λ.
    """
    if term.coefficient <= 0.0 or model.solvent_viscosity or not model.law.linear_relaxation:
        return None
    return float(term.coefficient / (model.modulus[0] * model.relaxation_time[0]))


def beside(terms: Iterable[RecoveredTerm], others: Sequence[OtherConstant]) -> dict[str, float]:
    """Return the coefficients of the other terms with the other constants in place."""
    factors = {other.term: other.factor for other in others}
    left = {}
    for term in terms:
        if term.term in factors:
            continue
        of_stress, of_time = powers_of_factors(term.term)
        stress = factors.get(MODULUS_TERM, 1.0) ** of_stress
        left[term.term] = term.coefficient * stress * factors.get(TIME_TERM, 1.0) ** of_time
    return left


def powers_of_factors(term: str) -> tuple[int, int]:
    """Return the powers of the factors on modulus and time that a coefficient is multiplied by.

    A term of m stresses and n rates has f_G^(m − 1) f_λ^(1 − n) times its coefficient.

    Parameters
    ----------
    term
        Its spelling.
    """
    parsed = parse_term(term)
    # every product in a sum has the same degree
    names = [TENSOR_NAMES[parsed.tensor].split("+")[0]]
    names += [n for n, p in zip(INVARIANT_NAMES, parsed.powers, strict=True) for _ in range(p)]
    stresses, rates = (
        sum(name.count(symbol) for name in names) for symbol in (TIME_TERM, MODULUS_TERM)
    )
    return stresses - 1, 1 - rates


def other_gain(others: Iterable[OtherConstant]) -> float | None:
    """Return the gain of the transducer that linear terms may stand for; None if there is none."""
    return next((other.factor for other in others if other.term == MODULUS_TERM), None)


def with_other_gain(
    bands: Mapping[str, PredictionBand], others: Sequence[OtherConstant]
) -> dict[str, PredictionBand]:
    """Return bands of N1 and N2 that hold for a fluid behind a transducer of that gain as well."""
    gain = other_gain(others)
    if gain is None:
        return dict(bands)
    scale = np.array([1.0, 1.0 / gain, 1.0 / gain])  # σ12 is what is recorded
    return {
        key: replace(
            band,
            rivals_low=np.minimum(band.rivals_low, band.rivals_low * scale),
            rivals_high=np.maximum(band.rivals_high, band.rivals_high * scale),
        )
        for key, band in bands.items()
    }


def with_other_constants(
    statements: Sequence[Statement],
    terms: Sequence[RecoveredTerm],
    others: Sequence[OtherConstant],
    known: DeclaredModel,
) -> list[Statement]:
    """Return the statements with what linear terms say of the declared constants."""
    rest = ""
    if not known.effects and known.law_name in ("", "ucm"):
        named = [
            f"{value:.4g} {name}".replace("-", "−") for name, value in beside(terms, others).items()
        ]
        rest = f" Beside it the law is {' + '.join(named)}." if named else ""

    def same(other: OtherConstant) -> str:
        return "law" if other.slip is None else "law, or the same σ12"

    said = [
        Statement(
            other.name,
            "no",
            f"{other.text}, for it is one and the same {same(other)}.{rest} A constant that was "
            "measured on another sample or at another temperature does that; [model] "
            f"{other.name} = "
            '"fit" fits it along.',
            other.text,
        )
        for other in others
    ]
    gain = other_gain(others)
    if gain is not None:
        text = (
            f"The band holds {{0}} as shown and, should it be the transducer, {{0}} / {gain:.4g}."
        )
        statements = [
            s if s.undetermined else replace(s, text=f"{s.text} {text.format(s.quantity)}")
            for s in statements
        ]
    return [*statements, *said]
