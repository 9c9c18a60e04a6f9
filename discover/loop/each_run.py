"""The closed loop with every run held out in turn, where there are too few to spare one."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from discover.dataset import Dataset
from discover.errors import InputError
from discover.forward import DeclaredModel
from discover.loop.loop import run_loop
from discover.loop.loop_result import LoopResult
from discover.loop.parts import ErrorPair, Fold
from discover.loop.search_time import SearchTime
from discover.progress import STATES, Progress, by_time
from discover.study.data import StudyData


def run_loop_on(
    data: StudyData,
    declared: DeclaredModel,
    progress: Progress | None,
    max_effects: int,
    **options: Any,
) -> LoopResult:
    """Close the loop on data that are divided, and judge it by the runs held out.

    Parameters
    ----------
    data
        Runs to fit, and those held out: some, or each in turn.
    declared, max_effects, **options
        As in `run_loop`.
    progress
        Called with a line of text now and then, and about what fraction is done.
    """
    rounds = 1 + len(data.fit) if data.each else 1
    tell = by_time(progress)
    left = SearchTime(max_effects, len(declared.modulus) > 1, rounds)

    states = not any(run.protocol.control in ("rate", "stress") for run in data.fit.runs)

    def say(line: str) -> None:
        tell(line, left.heard(line), STATES if states else 0.0)

    options |= {"fit": data.fit.names, "max_effects": max_effects, "progress": say}
    if data.each:
        return run_loop_on_each(data.dataset, declared, **options)
    return run_loop(data.dataset, declared, held_out=data.held_out.names, **options)


def run_loop_on_each(
    dataset: Dataset,
    declared: DeclaredModel,
    fit: Sequence[str] | None = None,
    progress: Callable[[str], None] | None = None,
    **options: Any,
) -> LoopResult:
    """Close the loop on all runs, and judge it by loops that each leave one run out.

    What is found comes from all runs. The held-out errors are means over loops that search afresh
    without one run, so that neither its stress nor the choice of effects has seen it   [Stone 1974,
    J. R. Stat. Soc. B 36, 111]. They judge the way of finding a law rather than the one law found.

    Parameters
    ----------
    dataset, declared, progress, **options
        As in `run_loop`.
    fit
        Names of the runs; by default all.

    Raises
    ------
    InputError
        As in `run_loop`, or if there are fewer than two runs.
    """
    names = list(dataset.names if fit is None else fit)
    if len(names) < 2:
        raise InputError(
            f"To hold out each run in turn, at least 2 are needed; got {len(names)}. Fit without "
            "held-out runs, or measure more."
        )
    say = progress or (lambda line: None)

    def loop(fitted: Sequence[str], held_out: Sequence[str], prefix: str) -> LoopResult:
        return run_loop(
            dataset,
            declared,
            fit=fitted,
            held_out=held_out,
            progress=lambda line: say(f"{prefix}: {line}"),
            **options,
        )

    whole = loop(names, (), "all runs")
    folds = []
    for name in names:
        part = loop([other for other in names if other != name], [name], f"without {name}")
        before, after = part.error_before.held_out, part.error_after.held_out
        assert before is not None  # one run is held out
        assert after is not None
        found = tuple(stage.effect for stage in part.stages)
        folds.append(Fold(name, part.verdict, found, before, after))
    return replace(
        whole,
        error_before=_with_folds(whole.error_before, [fold.error_before for fold in folds]),
        error_after=_with_folds(whole.error_after, [fold.error_after for fold in folds]),
        folds=tuple(folds),
    )


def _with_folds(error: ErrorPair, left_out: Sequence[float]) -> ErrorPair:
    return ErrorPair(error.fit, float(np.mean(left_out)))
