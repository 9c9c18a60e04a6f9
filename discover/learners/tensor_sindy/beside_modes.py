"""Which size of a law to believe beside moduli that a sweep leaves open.

What a term stands for may be what the moduli are wrong by. So sizes are compared by what is left
after the moduli moved, as far as the sweep allows and at the price of it: with Z the change of the
records with errors u of unit variance, the least of n|r − Zu|²/s² + |u|², over u and the constants
of the law, to first order.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from discover.learners.tensor_sindy.intervals import sensitivities_at
from discover.learners.tensor_sindy.refit import Fit
from discover.learners.tensor_sindy.search import SupportSearch
from discover.learners.trajectories.modulus_errors import modulus_columns


def criteria_beside_modes(search: SupportSearch, path: Sequence[Fit]) -> Float[np.ndarray, " path"]:
    """Return the criterion of each member of a path, each with the moduli that suit it best."""
    plain = np.array([search.criterion(fit) for fit in path])
    if not np.any(np.asarray(search.problem.modulus_error)):
        return plain
    best = min(path, key=lambda fit: fit.misfit)
    noise = max(best.misfit, search.floor)
    change = modulus_columns(
        search.problem, best.support, search.slots, best.coefficients, best.inner
    )
    prior = noise / np.sqrt(search.n_independent)
    for i, fit in enumerate(path):
        left = _left(search, fit, change, prior)
        ratio = max(left, search.floor) / max(fit.misfit, search.floor)
        plain[i] += 2.0 * search.n_independent * np.log(ratio)
    return plain


def _left(search: SupportSearch, fit: Fit, change: np.ndarray, prior: float) -> float:
    """Return the relative misfit after the moduli moved, the price of moving them included."""
    residual, columns, _ = sensitivities_at(search.problem, fit)
    if not (np.all(np.isfinite(residual)) and np.all(np.isfinite(columns))):
        return fit.misfit
    if columns.shape[1]:
        basis = np.linalg.qr(columns)[0]
        change = change - basis @ (basis.T @ change)
        residual = residual - basis @ (basis.T @ residual)
    design = np.vstack([change, prior * np.eye(change.shape[1])])
    target = np.append(residual, np.zeros(change.shape[1]))
    moved = np.linalg.lstsq(design, target, rcond=None)[0]
    return min(float(np.linalg.norm(target - design @ moved)), fit.misfit)
