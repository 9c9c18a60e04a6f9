"""What each learner finds, kept as it is found, so that a run that was stopped can go on."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from discover.comparison.at_once import at_once
from discover.comparison.fitting.sampled_rates import with_sampled_rates
from discover.comparison.fitting.training import train
from discover.comparison.instrument import Learned
from discover.comparison.instrument.known import Known
from discover.comparison.judging.identifiability import (
    physics_of,
)
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.errors import InputError
from discover.laws.multimode import Fluid
from discover.learners.registry import BUILT_IN
from discover.learners.results.result import LearnerResult
from discover.progress import Progress
from discover.study.run_folder import RunFolder
from discover.study.schema import Study


@dataclass(frozen=True)
class Learning:
    """Where learners are trained, or found again.

    Attributes
    ----------
    study
        Which learners, and with what options.
    store
        Where finished learners are kept and found again.
    made
        Learners that are fitted already: what they found, by learner.
    prefix
        Of the names under which they are kept.
    """

    study: Study
    seed: int
    store: RunFolder | None = None
    made: Mapping[str, tuple[LearnerResult, Fluid]] | None = None
    prefix: str = ""

    def outcomes(
        self, learners: Sequence[str], known: Known, progress: Progress
    ) -> dict[str, LearnerOutcome]:
        """Return what each learner finds, those of this package side by side.

        Whether another one may share a process with threads is not known, so they come after.
        """
        if known.along is not None:
            _ = known.along.twins  # once, and not in every thread

        def part(learner: str) -> Callable[[Progress], LearnerOutcome]:
            return lambda say: self.outcome(learner, known, say)

        ours = [one for one in learners if one in BUILT_IN]
        others = [[one] for one in learners if one not in BUILT_IN]
        found: dict[str, LearnerOutcome] = {}
        for group in [ours, *others] if ours else others:
            done, share = len(found) / len(learners), len(group) / len(learners)

            def say(text: str, fraction: float, done: float = done, share: float = share) -> None:
                progress(text, done + share * fraction)

            found |= at_once({learner: part(learner) for learner in group}, say)
        return {learner: found[learner] for learner in learners}

    def outcome(
        self, learner: str, known: Known, progress: Progress, part: str = ""
    ) -> LearnerOutcome:
        """Return what a learner finds, in the frame in which it works.

        Parameters
        ----------
        known
            The known part, and the flows of the page.
        progress
            Called with what is going on and the fraction done.
        part
            Of a sweep, the name under which it is kept; its outcomes are looked at in one flow.
        """
        store, made = self.store, self.made
        name = f"{self.prefix}{part or learner}"
        kept = None if store is None else store.load(name)
        if kept is not None and all(flow.key in kept["predictions"] for flow in known.flows):
            return LearnerOutcome.from_state(kept)
        progress("starting", 0.0)
        frame, constants = known.before, {}
        if made is not None:
            result, fluid = made[learner]
        elif known.along is not None:
            found = known.along.learn(
                lambda model, data, library: train(
                    learner, self.study, model, data.fit.runs, self.seed, progress, library
                )
            )
            result, fluid, constants = _told_of_constants(found), found.fluid, found.constants
            frame = known.frame_of({one.name: one.raw for one in constants.values()})
        else:
            result, fluid = train(
                learner, self.study, frame.model, frame.data.fit.runs, self.seed, progress
            )
        flows = frame.flows
        outcome = replace(LearnerOutcome.of(result, fluid, flows), constants=constants)
        if not part:
            outcome = replace(outcome, physics=physics_of(fluid, flows))
            outcome = with_sampled_rates(outcome, fluid, frame.model.fluid, flows)
        if store is not None:
            store.save(name, outcome.to_state())
            # the same route as after an interruption, so that both give the same files
            return LearnerOutcome.from_state(outcome.to_state())
        return outcome


def _told_of_constants(found: Learned) -> LearnerResult:
    """Return a result that says how constants were fitted along with it."""
    times = "once" if found.rounds == 1 else f"{found.rounds} times"
    ended = "had settled" if found.settled else "had not settled, so they may still be off"
    message = found.result.message.rstrip(".")
    return replace(
        found.result,
        message=f"{message}; it learned {times} with constants fitted along, which {ended}.",
        details={**found.result.details, "rounds": found.rounds, "settled": found.settled},
    )


def require_teacher(study: Study) -> None:
    """Refuse a distillation where no law made the data."""
    if study.compare.distillation and study.data.synthetic is None:
        raise InputError(
            "compare.distillation needs a known law as teacher, so [data] must say synthetic = "
            "{...}. Use discover distil for laws by name."
        )


def distilled(
    study: Study, truth: Fluid | None, store: RunFolder | None, progress: Progress
) -> list[dict[str, Any]]:
    """Return what the law that made the data teaches each other law, where that is asked for."""
    if not study.compare.distillation:
        return []
    assert truth is not None
    assert study.data.synthetic is not None
    kept = None if store is None else store.load("distillation")
    if kept is not None:
        return kept["rows"]
    from discover.learners.distillation import distil
    from discover.learners.students import STUDENTS

    teacher = study.data.synthetic.law
    students = [name for name in STUDENTS if name != teacher]
    rows = []
    for i, student in enumerate(students):
        progress(f"{teacher} teaches {student}", i / len(students))
        rows.append({"teacher": teacher, **distil(truth, student).as_dict()})
    if store is not None:
        store.save("distillation", {"rows": rows})
    return rows
