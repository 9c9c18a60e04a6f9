"""The search with each run weighed by its own noise, where equal weights will not do."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from discover.closed_loop.searching import SearchResult, SearchTask
from discover.dataset import Run
from discover.dataset.run_table import kind_of_record
from discover.forward import DeclaredModel
from discover.statistics.noise_weights import weights_by_noise


def searched_by_noise(
    task: SearchTask, ended: SearchResult, declared: DeclaredModel, laws: Sequence[str]
) -> tuple[SearchTask, SearchResult]:
    """Return a search with runs weighed by their noise, and its task, if that explains them.

    By no other effects than equal weights found. Otherwise the search that has ended, and its task.

    Parameters
    ----------
    task, ended
        The search with equal weights.
    declared, laws
        What it started from.
    """
    search = ended.search
    if task.silent or not search.fit.usable:
        return task, ended
    rows = zip(search.fit.residual, search.problem.weight, strict=True)
    left = [row[w > 0] * np.sqrt(np.count_nonzero(w)) for row, w in rows]
    # a misfit that the sweep excuses has a size of its own in each run, and is no noise
    random = search.explained and search.tolerated.left(search.fit.residual).random
    weights = weights_by_noise(left, list(map(kind_of_record, task.fitted)), random)
    if weights is None:
        return task, ended
    task.say("runs differ in noise: the search once more, each run weighed by its own")
    runs = [replace(run, weight=own) for run, own in zip(task.fitted, weights, strict=True)]
    weighed = replace(task, fitted=runs, name=f"{task.name}_by_noise")
    again = weighed.search(declared, laws)
    # weights are for constants: of what fits the quiet runs alone too many sets of effects do
    same = set(again.search.active) <= set(search.active)
    return (weighed, again) if again.search.explained and same else (task, ended)


def weighed_like(runs: Sequence[Run], fitted: Sequence[Run]) -> list[Run]:
    """Return runs that no fit saw, each with the mean weight of the fitted ones of its kind.

    Parameters
    ----------
    runs
        Those; one of a kind of its own has a weight of one.
    fitted
        Runs with their weights.
    """
    of_kind: dict[str, list[float]] = {}
    for run in fitted:
        of_kind.setdefault(kind_of_record(run), []).append(run.weight)
    mean = {kind: float(np.exp(np.mean(np.log(own)))) for kind, own in of_kind.items()}
    return [replace(run, weight=mean.get(kind_of_record(run), 1.0)) for run in runs]
