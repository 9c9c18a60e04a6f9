"""What several rules for choosing a law say of one and the same path."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from discover.learners.tensor_sindy.refit import Fit
from discover.learners.tensor_sindy.selection import (
    choose_by_bic,
    choose_by_held_out,
    choose_by_one_standard_error,
)
from discover.learners.tensor_sindy.stability import STABLE, Stability


def choose_by_stability(path: Sequence[Fit], stability: Stability) -> int:
    """Return the position of the largest member of the path all of whose terms are stable."""
    stable = stability.interchangeable >= STABLE
    members = [i for i, fit in enumerate(path) if all(stable[j] for j in fit.support)]
    return members[-1]  # the empty law is always one


def compare_selectors(
    names: Sequence[str],
    path: Sequence[Fit],
    criterion: Float[np.ndarray, " path"],
    held_out: Float[np.ndarray, "path folds"] | None,
    stability: Stability | None,
    of_pysindy: tuple[int, ...],
    floor: float,
) -> dict[str, Any]:
    """Return what each rule chooses, as terms, and whether they agree.

    Parameters
    ----------
    path
        Best fit of each size.
    criterion, held_out
        Extended BIC, and misfits on groups of runs left out, of each member.
    stability
        From `selection_stability`.
    of_pysindy
        Support that the sparse optimiser leaves at its default setting, on the path or not.
    floor
        Relative misfit below which laws count as equal.
    """
    chosen: dict[str, tuple[int, ...]] = {"bic": path[choose_by_bic(criterion)].support}
    if held_out is not None:
        chosen["held_out"] = path[choose_by_held_out(held_out, floor)].support
        simplest = path[choose_by_one_standard_error(held_out, floor)]
        chosen["one_standard_error"] = simplest.support
    if stability is not None:
        chosen["stability"] = path[choose_by_stability(path, stability)].support
    chosen["pysindy"] = of_pysindy
    return {
        "chosen": {rule: [names[i] for i in support] for rule, support in chosen.items()},
        "agree": len(set(chosen.values())) == 1,
    }
