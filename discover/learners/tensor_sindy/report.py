"""Results of a search: terms with their intervals, and JSON-able tables."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from discover.inference.fits import Fit
from discover.learners.results import RecoveredTerm
from discover.learners.tensor_sindy.optimisers import solve_sparse
from discover.learners.tensor_sindy.search import SupportSearch
from discover.statistics.noise_model import rms

_CLOSE = 5.0
"""Log odds beyond which evidence against a law is very strong   [Kass & Raftery 1995]."""

_SEEN = 1e-3
"""Probability from which on a term is listed."""


def recovered_terms(search: SupportSearch, fit: Fit) -> tuple[RecoveredTerm, ...]:
    """Return the terms of a fit in the order of the library; none of an empty law."""
    if not fit.names or fit.covariance is None:
        return ()
    model, penalised = search.problem.model, _penalised(search, fit)
    terms = []
    for index in search.support(fit):
        term = search.library.terms[index]
        at, *inner_at = model.positions(term.name)
        inner = dict(zip(term.inner_names, inner_at, strict=True))
        terms.append(
            RecoveredTerm(
                term=term.name,
                coefficient=float(fit.theta[at]),
                coefficient_penalised=penalised.get(index),
                ci95=fit.interval(at),
                inner={name: float(fit.theta[own]) for name, own in inner.items()},
                inner_ci95={name: fit.interval(own) for name, own in inner.items()},
                latex=term.latex(),
            )
        )
    return tuple(terms)


def covariance_of_terms(search: SupportSearch, fit: Fit) -> Float[np.ndarray, "p p"] | None:
    """Return the covariance of the coefficients of a fit, then of its inner parameters."""
    if not fit.names or fit.covariance is None:
        return None
    each = [search.problem.model.positions(search.library.names[i]) for i in search.support(fit)]
    at = [own[0] for own in each] + [position for own in each for position in own[1:]]
    places = [fit.free.index(position) for position in at]
    # from the coordinate that is fitted to the constant
    slope = np.array([fit.theta[p] if fit.priors[p].is_logarithm else 1.0 for p in at])
    return fit.covariance[np.ix_(places, places)] * np.outer(slope, slope)


def _penalised(search: SupportSearch, fit: Fit) -> dict[int, float]:
    """Return what the optimiser makes of the terms of a fit: thresholded or penalised."""
    model, support = search.model_at(fit), search.support(fit)
    swept = solve_sparse(search.optimizer, model.design, model.target, search.most)
    if support in swept:
        return {i: float(swept[support][i]) for i in support}
    # the optimiser left to itself stops elsewhere: what it says of these terms alone
    design = model.design[:, list(support)]
    alone = solve_sparse(search.optimizer, design, model.target, len(support))
    if not alone:
        return dict.fromkeys(support, 0.0)
    return dict(zip(support, map(float, alone[max(alone, key=len)]), strict=True))


def _described(search: SupportSearch, fit: Fit) -> dict[str, Any]:
    terms = [search.library.terms[i] for i in search.support(fit)]
    theta, model = fit.theta, search.problem.model
    inner = {}
    for term in terms:
        if term.form is not None:
            inner[term.form.inner_name] = float(theta[model.positions(term.name)[1]])
    return {
        "support": [term.name for term in terms],
        "coefficients": [float(theta[model.positions(term.name)[0]]) for term in terms],
        "inner": inner,
        "misfit": search.fitter.misfit(fit),
        "log_evidence": search.rank(fit),
    }


def path_table(
    search: SupportSearch, path: Sequence[Fit], held_out: Float[np.ndarray, "path runs"] | None
) -> list[dict[str, Any]]:
    """Return one row for each member of the path: support, size, misfits, log evidence.

    ``held_out``: rms of the misfit over the runs left out.
    """
    rows = []
    for i, fit in enumerate(path):
        row = _described(search, fit)
        row["size"] = len(fit.names)
        row["held_out"] = None if held_out is None else float(rms(held_out[i]))
        rows.append(row)
    return rows


def rival_table(search: SupportSearch, chosen: Fit) -> list[dict[str, Any]]:
    """Return the other laws that the records do not rule out, closest first.

    No larger than the chosen support. ``difference``: relative rms difference of the predictions;
    ``exact``: no record of these runs distinguishes the two.
    """
    rivals = []
    for fit in search.ranked():
        if fit is chosen or len(fit.names) > len(chosen.names):
            continue
        exact = search.indistinguishable(fit, chosen)
        if exact or search.rank(fit) > search.rank(chosen) - _CLOSE:
            row = _described(search, fit)
            row |= {"difference": search.difference(fit, chosen), "exact": exact}
            rivals.append(row)
    return sorted(rivals, key=lambda row: row["difference"])


def inclusion(search: SupportSearch) -> dict[str, float]:
    """Return the posterior probability of each term, were the law among those fitted."""
    fits = search.ranked()
    logs = np.array([search.rank(fit) for fit in fits])
    weights = np.exp(logs - np.logaddexp.reduce(logs))
    found = {
        name: float(sum(w for fit, w in zip(fits, weights, strict=True) if name in fit.names))
        for name in search.library.names
    }
    likely = {name: p for name, p in found.items() if p >= _SEEN}
    return dict(sorted(likely.items(), key=lambda pair: -pair[1]))


def noise_of(fit: Fit, observations: int) -> dict[str, float]:
    """Return the noise that a fit leaves, relative to the records, and the effective samples."""
    share = (1.0 - fit.noise.correlation) / (1.0 + fit.noise.correlation)
    return {
        "size": fit.noise.common,
        "lag_one_correlation": fit.noise.correlation,
        "effective_samples": observations * share,
    }
