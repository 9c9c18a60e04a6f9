"""Twins of any law, by fitting supports to its σ12 in random shear histories."""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np

from discover.identify.histories import SAME, random_histories
from discover.identify.laws_side_by_side import LawTerms, dense, joint_library, stresses_of_laws
from discover.identify.twins import Twin, find_twins
from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.maxwell import UpperConvectedMaxwell
from discover.learners.tensor_sindy.problem import TrajectoryProblem
from discover.learners.tensor_sindy.refit import POLISHING, Fit, refit
from tensor_library.library import TermLibrary
from tensor_library.terms import parse_term

_SLOTS = 5


def fit_twins(
    library: TermLibrary,
    law: LawTerms,
    supports: Sequence[Sequence[str]],
    base: AbstractConstitutiveLaw | None = None,
    tolerance: float = SAME,
) -> list[Twin]:
    """Return the twins of a law among laws with given terms and free coefficients.

    Each support is fitted to the law's σ12 in random shear histories by Levenberg–Marquardt,
    several side by side in one compiled program; what reproduces σ12 to integration error is a
    twin. Unlike the exact search this holds for closed forms and for any number of exchanged terms,
    but a fit may miss a distant solution: what it finds is sure, what it does not find is not ruled
    out.

    Parameters
    ----------
    library
        Candidate terms.
    law
        The law, beyond the known part.
    supports
        Terms of each candidate, at most five.
    base
        The known part; by default UCM.
    tolerance
        Largest relative root-mean-square difference of σ12.
    """
    base = UpperConvectedMaxwell() if base is None else base
    candidates = [LawTerms(dict.fromkeys(names, 0.0)) for names in supports]
    library = joint_library(library, [law, *candidates])
    problem = _problem(library, law, base)
    positions = [tuple(sorted(library.names.index(n) for n in names)) for names in supports]
    start, inner = dense(library, law)
    # what the law and a candidate share starts from the law's own coefficients
    fits = refit(
        problem,
        positions,
        [(start, inner)] * len(positions),
        np.ones(len(library)),
        _SLOTS,
        tolerance=POLISHING,
    )
    good = [_terms(library, fit) for fit in fits if fit.misfit <= tolerance]
    found = {frozenset(one.coefficients) for one in good}
    return [
        t for t in find_twins(library, law, base, good) if frozenset(t.law.coefficients) in found
    ]


def _problem(
    library: TermLibrary, law: LawTerms, base: AbstractConstitutiveLaw
) -> TrajectoryProblem:
    """Return the problem of reproducing a law's σ12 in the random histories in which it lives."""
    flows = random_histories()
    stress = stresses_of_laws(library, [law], flows.protocols, flows.grids, base)[0, :, :, 3]
    lives = np.all(np.isfinite(stress), axis=1)
    stress = np.where(lives[:, None], stress, 0.0)
    scale = np.sqrt(np.mean(stress**2, axis=1))
    weight = np.zeros((*stress.shape, 3))
    weight[lives, :, 0] = 1.0 / scale[lives, None]
    weight /= np.sqrt(np.sum(weight > 0))
    target = np.zeros_like(weight)
    target[..., 0] = stress
    times = np.asarray(flows.grids.times)[
        np.arange(len(stress))[:, None], np.asarray(flows.grids.sample_index)
    ]
    return TrajectoryProblem(
        library=library,
        base=base,
        modulus=jnp.ones(1),
        relaxation_time=jnp.ones(1),
        solvent_viscosity=jnp.asarray(0.0),
        protocols=flows.protocols,
        grids=flows.grids,
        target=jnp.asarray(target),
        weight=jnp.asarray(weight),
        order_of_time=jnp.asarray(times / times[:, -1:]),
    )


def _terms(library: TermLibrary, fit: Fit) -> LawTerms:
    names = [library.names[i] for i in fit.support]
    forms = {parse_term(name).closed_form for name in names}
    inner = {
        form.inner_name: float(fit.inner[i])
        for i, form in enumerate(library.forms)
        if form.name in forms
    }
    values = (float(c) for c in fit.coefficients)
    return LawTerms(dict(zip(names, values, strict=True)), inner)
