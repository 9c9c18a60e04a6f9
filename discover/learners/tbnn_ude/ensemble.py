"""Ensemble of networks that reach the data by different ways.

Shear stress cannot distinguish many laws, and networks with other weights on the same tensors end
in the same one, so the ways differ: less likely laws that were met, other first tensors, other
initial weights, or draws from what the data leave of the weights, or of the constants where these
suffice. What those that fit disagree on, the data leave open. All share the compiled programs of
the first.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Array, Bool, Float, Key

from discover.laws import TensorBasisNetwork
from discover.learners.tbnn_ude.evidence import posterior_draws
from discover.learners.tbnn_ude.least_squares import law_misfit
from discover.learners.tbnn_ude.problem import DefaultRecipe, Trained, TrainingProblem
from discover.learners.tbnn_ude.recipes import train_along
from discover.learners.tbnn_ude.session import Progress

FITS = 1.25
"""A member whose misfit is so many times the least is no explanation of the data.

Its squares are larger by half: fifty independent samples rule that out at 5 %.
"""

SIMILAR = 1.05
"""Of members whose misfits differ by less than this factor, the simplest is taken."""


def train_others(
    problem: TrainingProblem,
    first: Trained,
    keys: Key[Array, " others"],
    recipe: DefaultRecipe,
    progress: Progress | None = None,
) -> tuple[list[Trained], str]:
    """Return one more member for each key, and in words how they came about."""
    members = list(first.others[: len(keys)])
    if first.left_out or not first.varies:
        drawn = posterior_draws(first.law, problem, keys[len(members) :], FITS)
        how = "held to more variation, or " * bool(members)
        what = "weights" if first.varies else "constants"
        members += [replace(first, law=law, penalised_law=law) for law in drawn]
        return members, f"{how}drawn from what the data leave of the {what}"
    raced = min([first, *members], key=lambda one: len(one.tensors))
    # what the first one needed later may have been the better beginning
    starts = sorted(first.passed_over, key=lambda tensor: tensor not in raced.tensors)
    for i, key in enumerate(keys[len(members) :]):
        groups = [raced.tensors]
        if i % 2 == 0 and i // 2 < len(starts):
            other = starts[i // 2]
            beside = [t for t in raced.tensors if t != other]
            groups = [(other,), beside[: recipe.max_tensors - 1]]
        members.append(
            train_along(problem, key, first.law, [g for g in groups if g], recipe, progress)
        )
    return members, "trained from other tensors and from other initial weights"


def choose_member(
    members: Sequence[Trained],
    misfits: Float[np.ndarray, " members"],
    resolved: float,
    surprise: Float[np.ndarray, " members"] | None = None,
) -> tuple[int, Bool[np.ndarray, " members"]]:
    """Return the member to be reported, and which ones fit.

    The likeliest of those that fit; without noise the fewest varying tensors near the least misfit.
    `misfits`: relative, on all runs; where constants suffice the first member is taken. `resolved`:
    relative misfit that a rheometer does not resolve. `surprise`: from `negative_log_evidence`,
    where noise hides more.
    """
    least = float(np.min(misfits))
    fits = misfits <= max(FITS * least, resolved)
    if not np.isfinite(least) or not members[0].varies:
        return 0, np.where(np.arange(len(members)) == 0, True, fits)
    if surprise is not None:
        return int(np.argmin(np.where(fits, surprise, np.inf))), fits
    near = [int(i) for i in np.flatnonzero(misfits <= SIMILAR * least)]
    chosen = min(near, key=lambda i: (len(members[i].tensors), misfits[i]))
    return chosen, fits


def member_misfits(
    laws: Sequence[TensorBasisNetwork], problem: TrainingProblem
) -> Float[np.ndarray, " members"]:
    """Return the relative misfit of every law; infinite where it diverges."""
    misfits = np.array([np.linalg.norm(np.asarray(law_misfit(law, problem))) for law in laws])
    return np.where(np.isfinite(misfits), misfits, np.inf)
