"""The terms of the law that was chosen: penalised, debiased, with their intervals."""

import numpy as np
from pysindy.optimizers import BaseOptimizer

from discover.learners import RecoveredTerm
from discover.learners.tensor_sindy.intervals import ParameterUncertainty
from discover.learners.tensor_sindy.optimisers import solve_sparse
from discover.learners.tensor_sindy.refit import Fit
from discover.learners.tensor_sindy.search import SupportSearch
from discover.learners.tensor_sindy.weighed_draws import WeighedDraws


def recovered_terms(
    search: SupportSearch,
    fit: Fit,
    optimizer: str | BaseOptimizer,
    uncertainty: ParameterUncertainty | None,
    draws: WeighedDraws | None,
) -> tuple[RecoveredTerm, ...]:
    """Return the terms of a fit; none of an empty law."""
    library = search.problem.library
    if not fit.support:
        return ()
    assert uncertainty is not None  # some term was chosen
    assert draws is not None
    half_widths = uncertainty.half_widths
    linear = draws.method == "linear"
    weighed = draws.intervals if draws.method == "weighed" else None
    model = search.model_at(fit)
    solutions = {
        s.support: s.coefficients
        for s in solve_sparse(optimizer, model.design, model.target, search.largest)
    }
    penalised = solutions.get(fit.support)
    if penalised is None:
        # the optimiser left to itself stops elsewhere: what it says of these terms alone
        support = list(fit.support)
        alone = solve_sparse(optimizer, model.design[:, support], model.target, len(support))
        penalised = np.zeros(len(library))
        if alone:
            penalised[support] = max(alone, key=lambda s: len(s.support)).coefficients
    fitted = np.append(fit.coefficients, fit.inner[list(uncertainty.inner_positions)])

    def around(middle: float, half: float) -> tuple[float, float]:
        return middle - float(half), middle + float(half)

    def interval(place: int, middle: float) -> tuple[float, float] | None:
        if weighed is not None:
            return float(weighed[place, 0]), float(weighed[place, 1])
        return around(middle, half_widths[place]) if linear else None

    terms = []
    for position, (index, value) in enumerate(zip(fit.support, fit.coefficients, strict=True)):
        term = library.terms[index]
        half = half_widths[position]
        inner, inner_ci95, at_one = {}, {}, {}
        for place, i in enumerate(uncertainty.inner_positions, len(fit.support)):
            if (form := library.forms[i]).name == term.closed_form:
                known = float(fit.inner[i])
                inner[form.inner_name] = known
                if (limits := interval(place, known)) is not None:
                    inner_ci95[form.inner_name] = limits
                if draws.method != "none" and abs(value - 1.0) <= half:
                    given, halves = uncertainty.given(fitted, position, 1.0)
                    ends = around(float(given[place]), halves[place])
                    at_one[form.inner_name] = (float(given[place]), *ends)
        terms.append(
            RecoveredTerm(
                term=term.name,
                coefficient=float(value),
                coefficient_penalised=float(penalised[index]),
                ci95=interval(position, float(value)),
                inner=inner,
                inner_ci95=inner_ci95,
                inner_at_one=at_one,
                latex=term.latex(),
            )
        )
    return tuple(terms)
