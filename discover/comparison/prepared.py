"""The data of a comparison as learners take them, and what a comparison refuses."""

from collections.abc import Callable, Iterable
from dataclasses import replace

from discover.dataset import Run
from discover.dataset.material_functions import as_compared
from discover.dataset.records.thinning import thin_run, without_spikes
from discover.errors import InputError
from discover.learners.runs import waiting
from discover.study.data import StudyData
from discover.study.declared_model import DeclaredModel


def prepared(data: StudyData) -> StudyData:
    """Return data whose runs are as learners take them."""
    if data.each:
        raise InputError(
            'held_out = "each" is for close-loop; a comparison needs the names of held-out runs, '
            'such as held_out = ["fast.csv"].'
        )
    return with_runs(data, as_compared)


def settled_by(data: StudyData, relaxation_time: float, relaxes: bool) -> StudyData:
    """Return data in which what starts periodic has the cycles before it that learners wait for.

    `data`: of a study, split. `relaxation_time`: the longest, in s. `relaxes`: whether the known
    law relaxes, so that a periodic state is solved for.
    """
    return with_each_run(data, lambda run: waiting(run, relaxation_time, relaxes))


def thinned_to(data: StudyData, most: int) -> StudyData:
    """Return data with at most so many samples of each run, evenly chosen in their order.

    Every sample is a step of the integration, and a record of thousands says little more of a law
    than its hundreds do. What was thinned says so.
    """
    return with_each_run(data, lambda run: thin_run(run, most))


def without_spikes_in_fit(data: StudyData) -> tuple[StudyData, str]:
    """Return data whose fitted runs lack the samples that stand alone, and words on them.

    Squares would let them bend the law. Those of runs held out stay, and do not judge.
    """
    parts = [without_spikes(run) for run in data.fit.runs]
    told = [f"{len(times)} of {run.name}" for run, times in parts if times]
    if not told:
        return data, ""
    cleaned = {run.name: run for run, _ in parts}
    dataset, fit = (
        replace(part, runs=tuple(cleaned.get(run.name, run) for run in part.runs))
        for part in (data.dataset, data.fit)
    )
    return replace(data, dataset=dataset, fit=fit), (f"Outliers excluded: {', '.join(told)}")


def with_each_run(data: StudyData, change: Callable[[Run], Run]) -> StudyData:
    """Return data with each run changed, in every part of it."""
    return with_runs(data, lambda runs: map(change, runs))


def with_runs(data: StudyData, change: Callable[[Iterable[Run]], Iterable[Run]]) -> StudyData:
    """Return data with the runs changed together, in every part of it."""
    parts = {
        name: replace(part, runs=tuple(change(part.runs)))
        for name in ("dataset", "fit", "held_out")
        for part in [getattr(data, name)]
    }
    return replace(data, **parts)


def require_one_known_law(declared: DeclaredModel) -> None:
    """Refuse a known part that only a closed loop can have."""
    if declared.choice:
        raise InputError(
            "[model] law names several laws to choose from, which is for close-loop: a comparison "
            "learns what one known law lacks. Name one law, or ucm."
        )
    if declared.by_mode:
        raise InputError(
            f"[model] by_mode lets {', '.join(declared.by_mode)} differ from mode to mode, which "
            "only close-loop fits. Run discover close-loop on this study, and start from what "
            'it finds: [model] from = "its folder". Or leave by_mode out.'
        )
