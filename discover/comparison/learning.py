"""Learners of a comparison, their results kept as they are found."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from dataclasses import dataclass, replace
from functools import partial
from threading import Event, Lock
from typing import TypeVar

import numpy as np

from discover.comparison.known_part import Frame
from discover.comparison.outcome import LearnerOutcome, bands_of_members, physics_of, simulated
from discover.dataset.run import Run
from discover.laws import Fluid
from discover.learners.files import plain, restored
from discover.learners.lack_of_fit import LackOfFit, lack_of_fit
from discover.learners.registry import BUILT_IN, LearningTask, learn_with
from discover.learners.results import LearnerResult
from discover.progress import Progress, Stopped, may_be_stopped, silent
from discover.study.declared_model import StudyModel
from discover.study.run_folder import RunFolder
from discover.study.schema import Study
from tensor_library.library import TermLibrary, build_library


def train(
    learner: str, study: Study, model: StudyModel, runs: Sequence[Run], seed: int = 0,
    progress: Progress = silent,
) -> tuple[LearnerResult, Fluid]:  # fmt: skip
    """Return what one learner finds in these runs, and the fluid that it makes.

    `learner`: ``"tensor_sindy"``, ``"tbnn_ude"``, or a registered one's name. `model`: the known
    part.
    """
    options, library = study.compare, study_library(study)
    if learner == "tensor_sindy":
        from discover.learners.tensor_sindy import TensorSINDy

        estimator = TensorSINDy(
            base=replace(model.fluid, modulus_covariance=model.modulus_covariance),
            library=library,
            optimizer=options.optimizer,
            max_terms=options.max_terms,
            use_normal_stresses=options.use_normal_stresses,
            progress=progress,
        )
    elif learner == "tbnn_ude":
        from discover.learners.tbnn_ude import TBNNUDE

        estimator = TBNNUDE(
            base=model.fluid, recipe=options.recipe, n_members=options.members, quick=options.quick,
            projection_library=library, progress=progress, random_state=seed,
        )  # fmt: skip
    else:
        return learn_with(learner, LearningTask(tuple(runs), model.fluid, library, seed, progress))
    estimator.fit(list(runs))
    return estimator.result_, estimator.fluid_


def study_library(study: Study) -> TermLibrary:
    """Return the candidate terms of a study."""
    asked = study.compare.library
    return build_library(degree=asked.degree, closed_forms=asked.closed_forms)


@dataclass(frozen=True)
class Learning:
    """Where learners are trained, or found again; `made`: results of those fitted already."""

    study: Study  # which learners, and with what options
    seed: int
    store: RunFolder | None = None  # where finished learners are kept and found again
    made: Mapping[str, tuple[LearnerResult, Fluid]] | None = None

    def outcomes(
        self, learners: Sequence[str], frame: Frame, progress: Progress
    ) -> dict[str, LearnerOutcome]:
        """Return what each learner finds, those of this package side by side, then the others."""
        # before the threads: two that load scikit-learn at once find it half loaded
        from discover.learners import tbnn_ude, tensor_sindy  # noqa: F401

        ours = [one for one in learners if one in BUILT_IN]
        others = [[one] for one in learners if one not in BUILT_IN]
        found: dict[str, LearnerOutcome] = {}
        for group in filter(None, [ours, *others]):
            done, share = len(found) / len(learners), len(group) / len(learners)

            def say(text: str, fraction: float, done: float = done, share: float = share) -> None:
                progress(text, done + share * fraction)

            parts = {learner: partial(self.outcome, learner, frame) for learner in group}
            found |= run_concurrently(parts, say)
        return {learner: found[learner] for learner in learners}

    def outcome(self, learner: str, frame: Frame, progress: Progress) -> LearnerOutcome:
        """Return what a learner finds, in the frame in which it works."""
        store, made, flows = self.store, self.made, frame.flows
        kept = None if store is None else store.load(learner)
        found = None if kept is None else restored(kept)
        if found is not None and all(flow.key in found.predictions for flow in flows):
            return found
        progress("starting", 0.0)
        if made is not None:
            result, fluid = made[learner]
        else:
            runs = frame.data.fit.runs
            result, fluid = train(learner, self.study, frame.model, runs, self.seed, progress)
        predictions = simulated(fluid, flows)
        outcome = LearnerOutcome(
            result.learner, result.terms, result.train_seconds, result.details, result.message,
            predictions, physics_of(fluid, flows),
            bands_of_members(result, fluid, flows, predictions), self._left(fluid, frame),
        )  # fmt: skip
        if store is not None:
            store.save(learner, plain(outcome, f"What {learner} found"))
        return outcome

    def _left(self, fluid: Fluid, frame: Frame) -> LackOfFit | None:
        """Return what a fluid leaves of the runs that have a signal, as the posterior asks it."""
        study, runs = self.study, list(frame.data.fit.runs)
        if study.compare.use_normal_stresses:
            runs += [run.observing(quantity) for run in runs for quantity in run.also_recorded]
        runs = [run for run in runs if np.any(run.recorded)]
        if not runs:
            return None
        fluid = replace(fluid, modulus_covariance=frame.model.modulus_covariance)
        loading, computed = study.compare.loading or 0.0, study.data.synthetic is not None
        return lack_of_fit(fluid, runs, study.loop.noise, loading, computed)


R = TypeVar("R")

_LOOK_UP = 0.5  # seconds, for an interrupt on systems where a wait cannot be interrupted


def run_concurrently(
    parts: Mapping[str, Callable[[Progress], R]], progress: Progress
) -> dict[str, R]:
    """Return what each part returns, all computed side by side.

    Progress is passed on with the mean of the fractions, of one part at a time. If one part fails,
    or the caller is interrupted, the others end where they next ask or say something.
    """
    if len(parts) < 2:
        return {
            name: part(lambda text, fraction, name=name: progress(f"{name}: {text}", fraction))
            for name, part in parts.items()
        }
    stop, turn, fractions = Event(), Lock(), dict.fromkeys(parts, 0.0)

    def run(name: str, part: Callable[[Progress], R]) -> R:
        def say(text: str, fraction: float) -> None:
            with turn:
                if stop.is_set():
                    raise Stopped
                fractions[name] = max(fractions[name], fraction)
                progress(f"{name}: {text}", sum(fractions.values()) / len(fractions))

        with may_be_stopped(stop):
            return part(say)

    with ThreadPoolExecutor(len(parts)) as pool:
        futures = {name: pool.submit(run, name, part) for name, part in parts.items()}
        try:
            running = set(futures.values())
            while running:
                ended, running = wait(running, _LOOK_UP, FIRST_COMPLETED)
                for one in ended:
                    one.result()  # or what it failed with
        except BaseException:
            stop.set()
            raise
    return {name: future.result() for name, future in futures.items()}
