"""Coefficients that hold whichever constants of the modes are right: the declared or others.

A linear term that amounts to another relaxation time or modulus (`declared_constants`) makes the
coefficients beside it those of the declared one. With the other one in its place the same law has
other coefficients, and the data cannot tell which of the two it is.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from jaxtyping import Float

from discover.comparison.judging.constants.declared_constants import (
    MODULUS_TERM,
    TIME_TERM,
    OtherConstant,
    powers_of_factors,
)
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.learners import RecoveredTerm
from tensor_library.law_terms import Interval


def with_other_coefficients(
    outcomes: Mapping[str, LearnerOutcome], others: Sequence[OtherConstant]
) -> dict[str, LearnerOutcome]:
    """Return the outcomes, intervals of the sparse law holding its coefficients in every frame.

    A frame has the declared constants, or some of the other ones in their place. In it a
    coefficient k is k f, where f is a product of powers of 1/(1 + c_σ) and 1 − c_γ̇; how far k f is
    known is to first order in all three.

    Parameters
    ----------
    outcomes
        By learner.
    others
        From `other_constants`.
    """
    sparse = outcomes.get("tensor_sindy")
    if sparse is None or not others:
        return dict(outcomes)
    covariance = sparse.details.get("covariance")
    terms = sparse.terms
    errors = _errors(terms, None if covariance is None else np.asarray(covariance, dtype=float))
    linear = {term.term: i for i, term in enumerate(terms)}
    frames = list(_frames(others))
    found = []
    for i, term in enumerate(terms):
        one = term
        if term.ci95 is not None and term.term not in {other.term for other in others}:
            beside = [_beside(terms, i, frame, linear, errors) for frame in frames]
            low, high = zip(term.ci95, *beside, strict=True)
            one = replace(one, ci95=(min(low), max(high)), ci95_given_declared=term.ci95)
        found.append(_with_inner(one, others))
    return {**outcomes, "tensor_sindy": replace(sparse, terms=tuple(found))}


def _frames(others: Sequence[OtherConstant]) -> Iterator[tuple[OtherConstant, ...]]:
    """Yield every choice of constants that are not the declared ones."""
    for count in range(1, len(others) + 1):
        yield from combinations(others, count)


def _errors(
    terms: Sequence[RecoveredTerm], covariance: Float[np.ndarray, "p p"] | None
) -> Float[np.ndarray, "q q"]:
    """Return a covariance of the coefficients whose 95 % intervals are one standard deviation each.

    So an interval by Student's factor, or one that arithmetic widens, stays as wide as it is.
    """
    halves = np.array([0.5 * (t.ci95[1] - t.ci95[0]) if t.ci95 else 0.0 for t in terms])
    q = len(terms)
    correlation = np.eye(q)
    if covariance is not None and covariance.shape[0] >= q:
        own = covariance[:q, :q]
        size = np.sqrt(np.diag(own))
        if np.all(size > 0.0):
            correlation = own / np.outer(size, size)
    return correlation * np.outer(halves, halves)


def _beside(
    terms: Sequence[RecoveredTerm],
    at: int,
    frame: Sequence[OtherConstant],
    linear: Mapping[str, int],
    errors: Float[np.ndarray, "q q"],
) -> Interval:
    """Return the 95 % interval of a coefficient with the other constants of a frame in place."""
    stress, time = powers_of_factors(terms[at].term)
    powers = {MODULUS_TERM: stress, TIME_TERM: time}
    factor, slope = 1.0, np.zeros(len(terms))
    for other in frame:
        power = powers[other.term]
        factor *= other.factor**power
        # of log f: a time is 1/(1 + c) of the declared, a modulus 1 − c
        own = -other.factor if other.term == TIME_TERM else -1.0 / other.factor
        slope[linear[other.term]] = power * own
    value = terms[at].coefficient * factor
    slope = value * slope
    slope[at] += factor
    half = float(np.sqrt(max(slope @ errors @ slope, 0.0)))
    return value - half, value + half


def _with_inner(term: RecoveredTerm, others: Sequence[OtherConstant]) -> RecoveredTerm:
    """Return a closed form whose inner constants, of one stress each, hold another modulus too."""
    stress = next((other for other in others if other.term == MODULUS_TERM), None)
    if stress is None or not term.inner:
        return term
    factors = [1.0, stress.factor, *(stress.ci95 or ())]

    def wider(ends: Interval) -> Interval:
        found = [end * factor for end in ends for factor in factors]
        return min(found), max(found)

    return replace(
        term,
        inner_ci95={name: wider(ends) for name, ends in term.inner_ci95.items()},
        inner_at_one={
            name: (value, *wider((low, high)))
            for name, (value, low, high) in term.inner_at_one.items()
        },
    )
