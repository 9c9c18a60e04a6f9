"""From a study to trained learners."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from discover.comparison.outcomes.expected import expectation_of
from discover.dataset.run import Run
from discover.errors import InputError
from discover.laws.multimode import Fluid
from discover.laws.textbook.maxwell import UpperConvectedMaxwell
from discover.learners.registry import LearningTask, learn_with
from discover.learners.results.result import LearnerResult
from discover.plain_json import plain
from discover.progress import Progress, silent
from discover.statistics.lack_of_fit import what_is_left
from discover.statistics.residual import Expectation
from discover.study.declared_model import DeclaredModel
from discover.study.schema import Study
from tensor_library.library import TermLibrary, build_library

if TYPE_CHECKING:
    from discover.learners.tensor_sindy import TensorSINDy


def require_numbers(model: DeclaredModel) -> None:
    """Check that nothing of the declared law is left to be fitted."""
    if model.free:
        raise InputError(
            f"compare needs a known part without free parameters, but {', '.join(model.free)} in "
            '[model] is "fit". Write a number, or modes = "lve" for a spectrum from lve.csv; '
            "discover close-loop fits them."
        )


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

    Parameters
    ----------
    learner
        ``"tensor_sindy"``, ``"tbnn_ude"``, ``"tensor_dense"``, or a registered one's name.
    study
        The study, for the learner's settings.
    model
        The known part.
    progress
        Called as it goes.
    searched_library
        The candidate terms of sparse regression and of registered learners, in place of the
        study's.
    """
    options = study.compare
    plain_maxwell = isinstance(model.law, UpperConvectedMaxwell)
    shared = {
        "modulus": model.modulus,
        "relaxation_time": model.relaxation_time,
        "known_relaxation": study.model.known_relaxation,
        "base_law": None if plain_maxwell else model.law,
        "random_state": seed,
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
            screening="exact" if options.recipe == "thorough" else "auto",
            **shared,
        ).fit(list(runs))
        # while the search with all its fits is at hand; only its result is kept in files
        drawn = not _surely_unexplained(sparse, runs, expectation_of(study, model))
        return searched(sparse, seed, drawn, runs), sparse.fluid_
    if learner == "tensor_dense":
        from discover.learners.tensor_dense import TensorDense

        # the whole library of degree one, whatever the study's: fewer terms are surer, not truer
        dense = TensorDense(
            use_normal_stresses=options.use_normal_stresses,
            modulus_covariance=model.modulus_covariance,
            progress=progress,
            **shared,
        ).fit(list(runs))
        return replace(dense.result_, weighted=dense.laws_that_fit()), dense.fluid_
    if learner == "tbnn_ude":
        from discover.learners.tbnn_ude import TBNNUDE

        estimator = TBNNUDE(
            recipe=options.recipe,
            n_members=options.members,
            quick=options.quick,
            projection_library=library,
            progress=progress,
            **shared,
        )
        estimator.fit(list(runs))
        return estimator.result_, estimator.fluid_
    asked = LearningTask(tuple(runs), model.fluid, searched_library or library, seed, progress)
    return learn_with(learner, asked)


_SURELY = 1.7
"""Of what noise and the sweep's error explain, so much more is no matter of how it is counted."""


def _surely_unexplained(
    sparse: "TensorSINDy", runs: Sequence[Run], expectation: Expectation
) -> bool:
    """Return whether the law found leaves so much that no band of its rivals will be asked for."""
    laid_out = sparse.search_.problem.records
    fit = sparse.path_[sparse.result_.details["chosen"]]
    weight = np.asarray(laid_out.weight)[..., 0]
    apart = (fit.predicted - laid_out.weighted_record).reshape(laid_out.weight.shape)[..., 0]
    residuals, records = [], []
    for row, weights, run in zip(apart, weight, runs, strict=True):
        seen = weights[: len(run)] > 0
        size = run.sizes(run.recorded)[seen]
        records.append(run.recorded[seen] / size)
        residuals.append(row[: len(run)][seen] / weights[: len(run)][seen] / size)
    left = what_is_left(residuals, records, expectation)
    return left.verdict == "unexplained" and left.misfit > _SURELY * left.expected


def searched(
    sparse: "TensorSINDy", seed: int = 0, drawn: bool = True, runs: Sequence[Run] = ()
) -> LearnerResult:
    """Return what a fitted sparse learner found, with the rivals that its search left standing.

    Parameters
    ----------
    sparse
        Fitted here, not read from a file: its search is needed.
    seed
        Of draws within the uncertainty.
    drawn
        Whether to draw the constants of rivals within theirs, for bands.
    runs
        That were fitted, for what each kind of test tells; none leaves that out.
    """
    from discover.identify.rivals.fitted_rivals import MOST_RIVALS, find_rivals
    from discover.learners.tensor_sindy.report import uncertainty_row
    from discover.learners.tensor_sindy.told_by_kinds import told_by_kinds

    result = sparse.result_
    chosen = sparse.path_[result.details["chosen"]]
    found = find_rivals(sparse.search_, chosen)
    table = found.to_json()
    told = table["rivals"][:MOST_RIVALS] if drawn else []
    for row, rival in zip(told, found.rivals, strict=False):
        assert rival.fit is not None  # the search at hand refitted it
        row.update(uncertainty_row(sparse.search_, rival.fit, seed))
    table["rivals_text"] = table.pop("text")
    if runs:
        table["told_by"] = plain(told_by_kinds(sparse.search_, chosen, runs))
    return replace(result, details={**result.details, **table})


def study_library(study: Study) -> TermLibrary:
    """Return the candidate terms of a study."""
    asked = study.compare.library
    return build_library(degree=asked.degree, closed_forms=asked.closed_forms)
