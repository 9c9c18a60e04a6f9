"""Hypotheses that predict the same: classes of them, and what terms without a name lose."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from discover.effects.library_term import LibraryTerm
from discover.inference.fits import Fit
from discover.inference.problem import Problem
from discover.inference.search import Search

SAME = 0.3
"""Root mean square of a difference of predictions over the noise, below which no test of these
runs can tell two hypotheses apart."""

NEAR = 6.0
"""Log odds behind the likeliest up to which a set that predicts the same is as good."""

_AS_LIKELY = 1.0
"""Log odds that are not worth more than a bare mention   [Kass & Raftery 1995, JASA 90, 773]."""

_NAMELESS = 0.5
"""Share that a term without a law keeps: it is as likely the first of a law nobody wrote down."""


@dataclass(frozen=True)
class Indistinguishable:
    """Hypotheses that these records cannot tell apart: with a name, then the likeliest first."""

    members: tuple[tuple[str, ...], ...]
    probability: float


def indistinguishable(
    problem: Problem, search: Search, fits: Sequence[Fit], probability: np.ndarray
) -> tuple[tuple[Indistinguishable, ...], float]:
    """Return classes of hypotheses with the same predictions, and what nameless terms lose."""
    fitter, classes = search.fitter, []
    for fit, p in zip(fits, probability, strict=True):
        record, rank = fitter.record(fit), search.rank(fit)
        for one in classes:
            off = (record - one["record"]) / (one["noise"] * fitter.rows.size)
            if np.sqrt(np.mean(off**2)) < SAME and rank > one["rank"] - NEAR:
                one["members"].append((fit.names, rank))
                one["p"] += p
                break
        else:
            noise = fit.noise.sizes[fitter.rows.run]
            known = {"record": record, "noise": noise, "rank": rank}
            classes.append(known | {"members": [(fit.names, rank)], "p": p})
    found, lost = [], 0.0
    for one in classes:
        share = float(one["p"])
        if all(_has_term(problem, names) for names, _ in one["members"]):
            lost += (1.0 - _NAMELESS) * share
            share *= _NAMELESS
        # of what predicts the same, the name that the field has is the answer
        members = sorted(_without_idle(one["members"]), key=lambda names: _has_term(problem, names))
        found.append(Indistinguishable(tuple(members), share))
    return tuple(sorted(found, key=lambda one: -one.probability)), lost


def _without_idle(
    members: Sequence[tuple[tuple[str, ...], float]],
) -> tuple[tuple[str, ...], ...]:
    """Return sets that predict the same, the smallest first, without those that only add to these.

    One that adds an effect stays where it is as likely: what is added may be there.
    """
    ranked = [(set(names), names, rank) for names, rank in members]
    small, large = [], []
    for own, names, rank in ranked:
        parts = [other for inner, _, other in ranked if inner < own]
        if not parts:
            small.append(names)
        elif rank > max(parts) - _AS_LIKELY:
            large.append(names)
    return (*small, *large)


def _has_term(problem: Problem, names: Sequence[str]) -> bool:
    return any(isinstance(problem.effects[name], LibraryTerm) for name in names)
