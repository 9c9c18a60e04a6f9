"""Learners by name: the built-in ones, and a user's own."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from time import perf_counter

from discover.dataset import Run
from discover.errors import InputError
from discover.laws.multimode import Fluid
from discover.learners.results import LearnerResult
from discover.validation import require_new_name
from discover.words import unknown_name
from tensor_library.closed_forms import Registry
from tensor_library.library import TermLibrary

BUILT_IN: Mapping[str, str] = {"tensor_sindy": "sparse regression", "tbnn_ude": "neural network"}
"""Titles of the learners of this package."""


@dataclass(frozen=True)
class LearningTask:
    """What a learner of a user's own is given; `progress` takes a text and the fraction done."""

    runs: tuple[Run, ...]  # runs to learn from; stresses in Pa, times in s
    base: Fluid  # the known fluid, whose law the learner adds to: its modes and its solvent stay
    library: TermLibrary  # the candidate terms of the study
    seed: int  # of whatever is random in the learner
    progress: Callable[[str, float], None]


@dataclass(frozen=True)
class NamedLearner:
    """Learner of a user's own."""

    learn: Callable[[LearningTask], LearnerResult]  # the law of its result holds the known one
    title: str  # name for readers


LEARNERS: Registry[NamedLearner] = Registry("learner", "discover.learners", dict)
"""Learners of users' own by name; a package's by entry points of this group."""


def register_learner(
    name: str, learn: Callable[[LearningTask], LearnerResult], title: str = ""
) -> NamedLearner:
    """Make a learner of one's own known by name to studies and comparisons in this process.

    An installed package does so in every process: see docs/adding-a-learner.md.

    Parameters
    ----------
    name
        As ``[compare] learners`` spells it: lower-case letters, digits and underscores.
    learn
        Takes a `LearningTask` and returns a `LearnerResult`.
    title
        Name for readers, by default `name` in words.

    Raises
    ------
    InputError
        If the name is taken or is none, or `learn` cannot be called.

    Examples
    --------
    >>> import discover as dc
    >>> dc.register_learner("one_term", learn, title="one term")  # doctest: +SKIP
    >>> dc.compare(data, learners=["one_term"])  # doctest: +SKIP
    """
    require_new_name(name, [*BUILT_IN, *LEARNERS.present], "learner")
    if not callable(learn):
        raise InputError(
            f"The learner {name!r} must be a function of a LearningTask; got {learn!r}. See "
            "docs/adding-a-learner.md."
        )
    LEARNERS[name] = NamedLearner(learn, title or name.replace("_", " "))
    return LEARNERS.present[name]


def learner_names() -> list[str]:
    """Return the names of all learners, those that are built in first."""
    return [*BUILT_IN, *LEARNERS]


def learner_title(name: str) -> str:
    """Return the title of a learner; its name if it is unknown here."""
    own = LEARNERS.get(name)
    return BUILT_IN.get(name, name) if own is None else own.title


def learn_with(name: str, task: LearningTask) -> tuple[LearnerResult, Fluid]:
    """Return what a learner of a user's own finds, and the fluid that it makes.

    Raises InputError if there is no such learner, or it returns no `LearnerResult`.
    """
    if name not in LEARNERS:
        raise InputError(unknown_name("learner", name, learner_names()))
    start = perf_counter()
    found = LEARNERS[name].learn(task)
    if not isinstance(found, LearnerResult):
        raise InputError(
            f"The learner {name!r} must return a LearnerResult; got a {type(found).__name__}. See "
            "docs/adding-a-learner.md."
        )
    found = replace(
        found, learner=name, train_seconds=found.train_seconds or perf_counter() - start
    )
    return found, replace(task.base, law=found.law)
