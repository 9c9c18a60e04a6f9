"""What a network says in symbols: its extra term projected on a library."""

from dataclasses import dataclass
from typing import Any

import jax
import numpy as np
from scipy.optimize import minimize_scalar

from discover.laws.tensor_basis_network import TensorBasisNetwork
from discover.learners.tbnn_ude.least_squares import Cloud
from discover.programs import compiled, on_device
from tensor_library import LawTerm, TermLibrary

ENOUGH = 1e-3
"""Relative misfit of the extra term below which more terms say nothing."""

SIMILAR = 1.05
"""Of candidates whose misfits differ by less than this factor, the simplest is taken."""


@dataclass(frozen=True)
class Projection:
    """A sparse expansion of a network's extra term.

    `misfit`: norm of what is left over that of the extra term, over the states that training
    visited, each with the weight that the record gives its mode.
    """

    terms: tuple[LawTerm, ...]  # with least-squares coefficients; none of a law that adds nothing
    misfit: float


def project(
    law: TensorBasisNetwork, cloud: Cloud, library: TermLibrary, max_terms: int = 5
) -> Projection:
    """Return the few library terms that best stand for what a network adds to its known law.

    Forward selection with backward elimination on the value of h at the states of `cloud`. The
    result describes the network; it is not fitted to the data. There is one term at least, however
    badly it describes h: the misfit says how badly.
    """
    # of several modes each counts as the record shows it: a slow one's h may be a million
    weight = np.asarray(cloud.weight)[:, None]
    target = (weight * np.asarray(_own_term(law, cloud.stress, cloud.rate))).ravel()
    norm = float(np.linalg.norm(target))
    if norm < 1e-12 or not np.isfinite(norm):
        return Projection((), 0.0 if norm < 1e-12 else np.inf)

    def design(inner):
        values = np.asarray(_terms(library, cloud.stress, cloud.rate, on_device(inner)))
        weighted = weight[..., None] * values
        return weighted.transpose(0, 2, 1).reshape(target.size, len(library))

    inner = np.array(library.inner_default)
    for i, (low, high) in enumerate(library.inner_bounds):
        columns = [j for j, t in enumerate(library.terms) if t.form is library.forms[i]]

        def misfit_of(log_value, i=i, columns=columns):
            trial = inner.copy()
            trial[i] = np.exp(log_value)
            # beside the plain tensor, so that the form explains only what varies
            plain = [j for j, t in enumerate(library.terms) if not t.degree and t.form is None]
            return _misfit(design(trial)[:, sorted({*columns, *plain})], target, norm)

        found: Any = minimize_scalar(
            misfit_of, bounds=(np.log(low), np.log(high)), method="bounded"
        )
        inner[i] = np.exp(found.x)
    matrix = design(inner)
    support: list[int] = []
    misfit = 1.0
    while misfit > ENOUGH and len(support) < max_terms:
        trials = {
            j: _misfit(matrix[:, [*support, j]], target, norm)
            for j in range(len(library))
            if j not in support
        }
        best = min(trials.values())
        if support and best > 0.9 * misfit:  # not worth a term beside the others
            break
        near = [j for j, value in trials.items() if value <= SIMILAR * best + 1e-9]
        support.append(min(near, key=lambda j: (library.terms[j].complexity, j)))
        misfit = trials[support[-1]]
    while len(support) > 1:  # a first pick may have become redundant
        without = {
            j: _misfit(matrix[:, [k for k in support if k != j]], target, norm) for j in support
        }
        weakest = min(without, key=lambda j: without[j])
        if without[weakest] > max(ENOUGH, SIMILAR * misfit):
            break
        support.remove(weakest)
        misfit = without[weakest]
    of_forms = dict(zip(library.inner_names, map(float, inner), strict=True))
    terms = []
    for j, value in zip(support, _solve(matrix[:, support], target), strict=True):
        term = library.terms[j]
        terms.append(LawTerm(term.name, float(value), {n: of_forms[n] for n in term.inner_names}))
    return Projection(tuple(terms), misfit)


@compiled
def _terms(library, stress, rate, inner):
    return jax.vmap(library.evaluate, (0, 0, None))(stress, rate, inner)


@compiled
def _own_term(law, stress, rate):
    return jax.vmap(law.own_term)(stress, rate)


def _solve(matrix: np.ndarray, target: np.ndarray) -> np.ndarray:
    scale = np.linalg.norm(matrix, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    return np.linalg.lstsq(matrix / scale, target, rcond=1e-10)[0] / scale


def _misfit(matrix: np.ndarray, target: np.ndarray, norm: float) -> float:
    return float(np.linalg.norm(matrix @ _solve(matrix, target) - target) / norm)
