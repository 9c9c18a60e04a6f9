"""From a study to trained learners."""

from collections.abc import Sequence

from discover.dataset.run import Run
from discover.laws.multimode import Fluid
from discover.laws.textbook.maxwell import UpperConvectedMaxwell
from discover.learners.registry import LearningTask, learn_with
from discover.learners.results.result import LearnerResult
from discover.progress import Progress, silent
from discover.study.declared_model import DeclaredModel
from discover.study.schema import Study
from tensor_library.library import TermLibrary, build_library


def train(
    learner: str,
    study: Study,
    model: DeclaredModel,
    runs: Sequence[Run],
    seed: int = 0,
    progress: Progress = silent,
    searched_library: TermLibrary | None = None,
) -> tuple[LearnerResult, Fluid]:
    """Return what one learner finds in these runs, and the fluid that it makes.

    `learner`: ``"tensor_sindy"``, ``"tbnn_ude"``, or a registered one's name. `study`: the study,
    for the learner's settings. `model`: the known part. `progress`: called as it goes.
    `searched_library`: the candidate terms of sparse regression and of registered learners, in
    place of the study's.
    """
    options = study.compare
    plain_maxwell = isinstance(model.law, UpperConvectedMaxwell)
    shared = {
        "modulus": model.modulus,
        "relaxation_time": model.relaxation_time,
        "known_relaxation": study.model.known_relaxation,
        "base_law": None if plain_maxwell else model.law,
        "solvent_viscosity": model.solvent_viscosity,
    }
    library = study_library(study)
    if learner == "tensor_sindy":
        from discover.learners.tensor_sindy import TensorSINDy

        sparse = TensorSINDy(
            library=searched_library or library,
            optimizer=options.optimizer,
            selection=options.selection,
            max_terms=options.max_terms,
            use_normal_stresses=options.use_normal_stresses,
            progress=progress,
            modulus_covariance=model.modulus_covariance,
            **shared,
        ).fit(list(runs))
        return sparse.result_, sparse.fluid_
    if learner == "tbnn_ude":
        from discover.learners.tbnn_ude import TBNNUDE

        estimator = TBNNUDE(
            recipe=options.recipe,
            n_members=options.members,
            quick=options.quick,
            projection_library=library,
            progress=progress,
            random_state=seed,
            **shared,
        )
        estimator.fit(list(runs))
        return estimator.result_, estimator.fluid_
    asked = LearningTask(tuple(runs), model.fluid, searched_library or library, seed, progress)
    return learn_with(learner, asked)


def study_library(study: Study) -> TermLibrary:
    """Return the candidate terms of a study."""
    asked = study.compare.library
    return build_library(degree=asked.degree, closed_forms=asked.closed_forms)
