"""What the data leave open, with the names of its dimensions: for xarray and ArviZ."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from discover.dataset.run import Run
from discover.errors import InputError
from discover.labelled_arrays import xarray_module
from discover.learners.runs import as_runs

if TYPE_CHECKING:
    import xarray

N_DRAWS = 1000


def labelled_draws(estimator: Any, seed: int) -> "xarray.Dataset":
    """Return draws of the coefficients of a law's terms, dimensions chain, draw and term.

    Raises InputError if the law has no term, or xarray is missing.
    """
    rng = np.random.default_rng(seed)
    terms, values, inner = _of_a_sparse_law(estimator, rng)
    variables = {"coefficient": (("chain", "draw", "term"), values[None])}
    variables |= {name: (("chain", "draw"), column[None]) for name, column in inner.items()}
    coordinates = {"chain": [0], "draw": np.arange(len(values)), "term": terms}
    told = {"given": "the terms that were chosen", **_source(estimator)}
    return xarray_module().Dataset(variables, coordinates, told)


def labelled_members(estimator: Any, runs: Iterable[Run] | None) -> "xarray.Dataset":
    """Return what each network of an ensemble predicts, dimensions member and sample.

    `estimator`: a fitted `TBNNUDE`. `runs`: the flows; by default those that were fitted. σ12, N1
    and N2 are in Pa, time is in s. Raises InputError if there are no runs, or xarray is missing.
    """
    wanted = getattr(estimator, "runs_", None) if runs is None else runs
    if wanted is None:
        raise InputError("A file holds no data; give the runs to predict: to_xarray(data).")
    fluid = estimator.fluid_
    followed = as_runs(wanted, fluid.relaxation_time, fluid.law.linear_relaxation)
    each = [estimator.predict_members(run.protocol, run.time) for run in followed]
    variables = {
        name: (("member", "sample"), np.concatenate([getattr(one, name) for one in each], axis=1))
        for name in ("sigma12", "N1", "N2")
    }
    coordinates = {
        "member": np.arange(len(estimator.members_)),
        "run": ("sample", np.concatenate([[run.name] * len(run) for run in followed])),
        "time_s": ("sample", np.concatenate([run.time for run in followed])),
    }
    return xarray_module().Dataset(variables, coordinates, _source(estimator))


def _of_a_sparse_law(
    estimator: Any, rng: np.random.Generator
) -> tuple[list[str], np.ndarray, dict[str, np.ndarray]]:
    """Return the terms, and draws of their coefficients and of inner parameters."""
    if estimator.covariance_ is None:
        raise InputError("No term was chosen, so there is no coefficient to draw.")
    found = [term.coefficient for term in estimator.terms_]
    inner = {name: v for term in estimator.terms_ for name, v in term.inner.items()}
    centre = [*found, *inner.values()]
    values = rng.multivariate_normal(centre, estimator.covariance_, N_DRAWS)
    size, terms = len(found), [term.term for term in estimator.terms_]
    return terms, values[:, :size], dict(zip(inner, values[:, size:].T, strict=True))


def _source(estimator: Any) -> dict[str, str]:
    found = estimator.provenance_
    return {"learner": estimator.learner, "data": found.data, "runs": ", ".join(found.runs)}
