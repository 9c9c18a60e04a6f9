"""What a search says of its path and of rivals, as plain JSON-able tables."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from discover.learners.tensor_sindy.intervals import ParameterUncertainty
from discover.learners.tensor_sindy.refit import Fit
from discover.learners.tensor_sindy.search import SupportSearch
from discover.learners.tensor_sindy.stability import Stability
from discover.statistics.projection import rms
from tensor_library.library import TermLibrary

_CLOSE = 10.0  # difference of an information criterion beyond which evidence is very strong


def _describe(search: SupportSearch, fit: Fit) -> dict[str, Any]:
    return {
        **fit.law(search.problem.library).to_json(),
        "misfit": fit.misfit,
        "bic": search.criterion(fit),
    }


def path_table(
    search: SupportSearch,
    path: Sequence[Fit],
    criterion: Float[np.ndarray, " path"],
    held_out: Float[np.ndarray, "path folds"] | None,
    by_run: Sequence[Mapping[str, float]] | None = None,
) -> list[dict[str, Any]]:
    """Return one row for each member of the path: support, size, misfit, held-out misfit, BIC.

    The held-out misfit is the mean over folds; `by_run` gives it for each run, by name.
    """
    rows = []
    for i, fit in enumerate(path):
        row = _describe(search, fit)
        row["size"] = len(fit.support)
        row["bic_at_exact_moduli"] = row["bic"]
        row["bic"] = float(criterion[i])
        row["held_out"] = None if held_out is None else rms(held_out[i])
        row["held_out_by_run"] = {} if by_run is None else dict(by_run[i])
        rows.append(row)
    return rows


def rival_table(search: SupportSearch, chosen: Fit) -> list[dict[str, Any]]:
    """Return the supports met that the data do not rule out, closest first.

    A rival is no larger than the chosen support. Its ``difference`` is the relative
    root-mean-square difference of the two predictions; it is an ``exact`` tie where that is below
    the floor.
    """
    rivals = []
    limit = search.criterion(chosen) + _CLOSE
    for fit in search.fits.values():
        if fit.support == chosen.support or len(fit.support) > len(chosen.support):
            continue
        exact = search.indistinguishable(fit, chosen)
        if exact or search.criterion(fit) < limit:
            row = _describe(search, fit)
            row["difference"] = float(np.linalg.norm(fit.predicted - chosen.predicted))
            row["exact"] = exact
            rivals.append(row)
    return sorted(rivals, key=lambda row: row["difference"])


def described(uncertainty: ParameterUncertainty | None) -> dict[str, Any]:
    """Return the covariance of a law's parameters, and the errors of moduli that it allows for."""
    if uncertainty is None:
        return {"covariance": None}
    rows: dict[str, Any] = {"covariance": uncertainty.total_covariance.tolist()}
    errors = uncertainty.modulus_errors
    if errors is not None:
        rows["modulus_errors"] = {name: v.tolist() for name, v in vars(errors).items()}
    return rows


def frequency_table(library: TermLibrary, stability: Stability | None) -> list[dict[str, Any]]:
    """Return how often each term was chosen from halves of the data, the most often first."""
    if stability is None:
        return []
    rows = [
        {"term": name, "frequency": float(alone), "with_twins": float(together)}
        for name, alone, together in zip(
            library.names,
            stability.frequency,
            stability.interchangeable,
            strict=True,
        )
    ]
    return sorted(rows, key=lambda row: (-row["with_twins"], -row["frequency"]))


def noise_of(uncertainty: ParameterUncertainty | None) -> dict[str, Any] | None:
    """Return what is known of the noise, as numbers; None for an empty law."""
    if uncertainty is None:
        return None
    noise = uncertainty.noise
    return {
        "autoregressive_order": int(noise.coefficients.size),
        "lag_one_correlation": float(noise.correlation[1]) if noise.coefficients.size else 0.0,
        "effective_samples": noise.effective_samples,
    }
