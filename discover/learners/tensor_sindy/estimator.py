"""The scikit-learn estimator: runs in, a sparse constitutive law out."""

import time
from collections.abc import Sequence
from functools import partial

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from pysindy.optimizers import BaseOptimizer

from discover.dataset.run import Run
from discover.errors import InputError
from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.expansion import LibraryExpansion
from discover.laws.multimode import Fluid
from discover.learners import LearnerResult, RecoveredTerm
from discover.learners.files.provenance import Provenance
from discover.learners.known_part import KnownPart
from discover.learners.run_prediction import RunPrediction
from discover.learners.settings import PerMode, check_library, default_library
from discover.learners.shorter_holds import shortened_rightly, shorter_where_it_pays
from discover.learners.tensor_sindy.beside_modes import criteria_beside_modes
from discover.learners.tensor_sindy.deviance import draws_of_fit
from discover.learners.tensor_sindy.intervals import ParameterUncertainty, parameter_uncertainty
from discover.learners.tensor_sindy.optimisers import (
    check_optimiser,
    default_support,
)
from discover.learners.tensor_sindy.recovered_terms import recovered_terms
from discover.learners.tensor_sindy.refit import Fit
from discover.learners.tensor_sindy.report import (
    described,
    frequency_table,
    noise_of,
    path_table,
    rival_table,
)
from discover.learners.tensor_sindy.rough_problem import ranked_in_words, rough_problem
from discover.learners.tensor_sindy.search import SupportSearch
from discover.learners.tensor_sindy.selection import (
    choose_by_bic,
    choose_by_held_out,
    choose_by_one_standard_error,
)
from discover.learners.tensor_sindy.selectors import compare_selectors
from discover.learners.tensor_sindy.stability import Stability, selection_stability
from discover.learners.tensor_sindy.validation import groups_of, held_out_misfits, run_folds
from discover.learners.tensor_sindy.weighed_draws import WeighedDraws
from discover.learners.trajectories.modulus_errors import ModulusErrors
from discover.learners.trajectories.prediction import predict_runs
from discover.learners.trajectories.problem import TrajectoryProblem, make_problem
from discover.progress import Progress, by_lines
from discover.statistics import NoiseModel
from tensor_library.library import TermLibrary

SCREENINGS = ("auto", "exact")
SELECTIONS = ("bic", "held_out", "one_standard_error")


class TensorSINDy(RunPrediction):
    """Sparse regression on a frame-invariant library, from shear stress alone.

    The normal stresses are integrated, never observed. Along a trial law's trajectory the data
    give a linear sparse problem for the coefficients; a pysindy optimiser proposes supports, each
    is refitted without penalty on the integrated trajectories, and forward, backward and swap
    moves go on from the best until none helps. BIC or held-out runs choose among the sizes; among
    supports that no observation distinguishes, the simplest.

    Parameters
    ----------
    library
        Candidate terms; by default those of the commands: tensors with coefficients up to degree
        one in the invariants.
    optimizer
        ``"stlsq"``, ``"sr3"``, ``"ssr"``, ``"frols"``, or a pysindy optimiser.
    modulus, relaxation_time
        G in Pa and λ in s, numbers, or arrays with one value for each mode.
    solvent_viscosity
        η_s in Pa s.
    known_relaxation
        Whether −σ is known. If not, the learner has to find ``sigma`` too.
    base_law
        A known dimensionless law to which terms are added; by default UCM.
    base
        The known `Fluid`, in place of `modulus`, `relaxation_time`, `solvent_viscosity`,
        `base_law`, `known_relaxation` and `modulus_covariance`.
    modulus_covariance
        Of the moduli in Pa, as a sweep leaves them, shape (k, k), in Pa squared: intervals and
        bands allow for it. None where the moduli are exact.
    use_normal_stresses
        Whether N1 and N2, where measured, join as observed rows.
    selection
        ``"bic"``; ``"held_out"``, a test on runs left out; or ``"one_standard_error"``, the
        simplest law within one standard error of the best on runs left out.
    max_terms
        Largest support.
    n_folds
        Groups of runs for the held-out misfit, at most one for each run; below 2 for none.
    n_stability
        Complementary pairs of halves of the data in which the selection is repeated; 0 for none.
    misfit_floor
        Relative misfit below which the data count as reproduced: what the fixed-step integration
        can promise. Laws that differ by less are ties.
    strain_step
        Largest strain between steps of the integration.
    screening
        ``"auto"``: where modes, runs and steps are many, supports are ranked on fewer samples and
        longer steps, and the best are fitted on all; ``"exact"``: all are.
    random_state
        Seed of the division of runs into folds.
    progress
        Called with a line of text and the fraction done, or None.

    Attributes
    ----------
    result_ : LearnerResult
        The law with its terms, path, rivals and seconds.
    law_ : LibraryExpansion
        The dimensionless law.
    fluid_ : Fluid
        The law with moduli and relaxation times.
    terms_ : tuple of RecoveredTerm
        The terms chosen.
    library_ : TermLibrary
        The library searched.
    coefficients_ : ndarray of shape (n_terms,)
        Coefficients over the library, zero where a term was left out.
    inner_ : ndarray of shape (n_inner,)
        Inner parameters of the library's closed forms.
    uncertainty_ : ParameterUncertainty or None
        Covariance of coefficients and inner parameters; None for an empty law.
    draws_ : WeighedDraws or None
        Whether that covariance holds against the data, and what holds instead.
    stability_ : Stability or None
        How often each term is chosen from halves of the data.
    path_ : list of Fit
        The best fit of each size, from empty on.
    search_ : SupportSearch
        Every support that was refitted.
    runs_ : tuple of Run
        What was fitted. A file holds neither these nor `search_` and `path_`.
    provenance_ : Provenance
        The same in words, with a hash.
    equation_ : Equation
        The law with its modes, for SymPy, LaTeX, JSON.

    Examples
    --------
    >>> import discover as dc
    >>> data = dc.synthetic_dataset("giesekus", {"alpha": 0.2}, noise=0.01, n_samples=51)
    >>> sindy = dc.TensorSINDy(max_terms=2).fit(data)  # doctest: +SKIP
    >>> [term.term for term in sindy.terms_]  # doctest: +SKIP
    """

    learner = "tensor_sindy"
    _saved = (
        "n_features_in_",
        "law_",
        "fluid_",
        "terms_",
        "result_",
        "library_",
        "coefficients_",
        "inner_",
        "uncertainty_",
        "draws_",
        "stability_",
        "provenance_",
    )
    _saved_types = (
        LearnerResult,
        RecoveredTerm,
        ParameterUncertainty,
        ModulusErrors,
        NoiseModel,
        Stability,
        WeighedDraws,
        Provenance,
    )

    def __init__(
        self,
        library: TermLibrary | None = None,
        optimizer: str | BaseOptimizer = "stlsq",
        modulus: PerMode = 1.0,
        relaxation_time: PerMode = 1.0,
        solvent_viscosity: float = 0.0,
        known_relaxation: bool = True,
        base_law: AbstractConstitutiveLaw | None = None,
        use_normal_stresses: bool = False,
        selection: str = "bic",
        max_terms: int = 5,
        n_folds: int = 8,
        n_stability: int = 20,
        misfit_floor: float = 1e-5,
        strain_step: float = 0.2,
        random_state: int | None = 0,
        progress: Progress | None = None,
        base: Fluid | None = None,
        modulus_covariance: Float[np.ndarray, "c c"] | None = None,
        screening: str = "auto",
    ):
        self.library = library
        self.optimizer = optimizer
        self.modulus = modulus
        self.relaxation_time = relaxation_time
        self.solvent_viscosity = solvent_viscosity
        self.known_relaxation = known_relaxation
        self.base_law = base_law
        self.use_normal_stresses = use_normal_stresses
        self.selection = selection
        self.max_terms = max_terms
        self.n_folds = n_folds
        self.n_stability = n_stability
        self.misfit_floor = misfit_floor
        self.strain_step = strain_step
        self.random_state = random_state
        self.progress = progress
        self.base = base
        self.modulus_covariance = modulus_covariance
        self.screening = screening

    def _learn(self, runs: list[Run], known: KnownPart, shorten: bool = True) -> None:
        started = time.perf_counter()
        library = default_library() if self.library is None else self.library

        def make(runs: Sequence[Run], **limits: float) -> TrajectoryProblem:
            return make_problem(
                runs,
                library,
                known.modulus,
                known.relaxation_time,
                known.solvent_viscosity,
                known.law,
                known.linear_relaxation,
                self.use_normal_stresses,
                modulus_covariance=known.modulus_covariance,
                **limits,
            )

        whole = problem = make(runs, strain_step=self.strain_step)
        followed, rough = runs, None
        if shorten and self.screening == "auto" and known.linear_relaxation:
            followed, problem = shorter_where_it_pays(
                runs, whole, partial(make, strain_step=self.strain_step), known.relaxation_time
            )
        if self.screening == "auto":
            rough = rough_problem(problem, followed, make)
        groups = groups_of(runs)
        n_groups = int(np.max(groups)) + 1
        validates = min(n_groups, self.n_folds) > 1
        if self.selection != "bic" and not validates:
            raise InputError(
                f"selection={self.selection!r} needs at least two runs and two folds; got "
                f"{n_groups} and {self.n_folds}. Use selection='bic'."
            )
        search = SupportSearch(
            problem, self.optimizer, self.max_terms, self.misfit_floor, rough=rough
        )
        # a line for each beginning of the runs, and for each size
        path = search.run(by_lines(self.progress, 3 + search.largest))
        held_out, by_run = None, None
        if validates:
            folds = run_folds(n_groups, self.n_folds, self.random_state)[groups]
            of_folds = problem if rough is None else rough
            held_out, errors = held_out_misfits(of_folds, path, folds, search.scale, search.slots)
            names = [run.name for run in runs]
            by_run = [dict(zip(names, map(float, row), strict=True)) for row in errors]
        criterion = criteria_beside_modes(search, path)
        if self.selection == "held_out" and held_out is not None:
            chosen = choose_by_held_out(held_out, self.misfit_floor)
        elif self.selection == "one_standard_error" and held_out is not None:
            chosen = choose_by_one_standard_error(held_out, self.misfit_floor)
        else:
            chosen = choose_by_bic(criterion)
        fit = path[chosen]
        search.bring_near(fit)

        self.search_ = search
        self.path_ = path
        self.library_ = library
        self.coefficients_ = fit.dense(len(library))
        self.inner_ = fit.inner
        self.law_ = _law(library, fit, known)
        self.fluid_ = Fluid(
            self.law_, problem.modulus, problem.relaxation_time, problem.solvent_viscosity
        )
        shortened = ""
        if followed is not runs:
            recorded = self._predict_runs(runs), self._predict_runs(list(followed))
            shortened = shortened_rightly(whole, problem, recorded, fit.misfit)
            if not shortened:
                self._learn(runs, known, shorten=False)
                return
        self.stability_ = None
        if self.n_stability:
            self.stability_ = selection_stability(
                problem,
                fit,
                self.optimizer,
                search.largest,
                self.misfit_floor,
                [member.support for member in path],
                self.n_stability,
                self.random_state,
                search.n_independent / problem.records.n_observations,
            )
        model = search.model_at(fit)
        # the model's rows are divided by √n; a ridge penalty of pysindy's is meant for sums
        rows = np.sqrt(problem.records.n_observations)
        selectors = compare_selectors(
            library.names,
            path,
            criterion,
            held_out,
            self.stability_,
            default_support(self.optimizer, rows * model.design, rows * model.target),
            self.misfit_floor,
        )
        self.uncertainty_, self.draws_ = None, None
        if fit.support:
            self.uncertainty_ = parameter_uncertainty(problem, fit, self.misfit_floor, search.slots)
            self.draws_ = draws_of_fit(
                problem, fit, self.uncertainty_, search.slots, self.random_state or 0
            )
        self.terms_ = recovered_terms(search, fit, self.optimizer, self.uncertainty_, self.draws_)
        misfits = np.array([misfit for _, misfit in search.history])
        self.result_ = LearnerResult(
            learner="tensor_sindy",
            law=self.law_,
            terms=self.terms_,
            train_seconds=time.perf_counter() - started,
            loss_history=(np.arange(1.0, misfits.size + 1.0), np.minimum.accumulate(misfits**2)),
            details={
                "path": path_table(search, path, criterion, held_out, by_run),
                "chosen": chosen,
                "selection": self.selection,
                "selectors": selectors,
                "selection_frequency": frequency_table(library, self.stability_),
                "rivals": rival_table(search, fit),
                **described(self.uncertainty_),
                "draws": None if self.draws_ is None else self.draws_.to_json(),
                "iterations": len(misfits),
                "optimizer": self.optimizer
                if isinstance(self.optimizer, str)
                else type(self.optimizer).__name__,
                "misfit": fit.misfit,
                "noise": noise_of(self.uncertainty_),
                "n_observations": problem.records.n_observations,
                "n_independent": search.n_independent,
            },
            message=(
                f"{len(fit.support)} of {len(library)} terms leave a relative misfit of "
                f"{fit.misfit:.2g}; {search.n_refitted} supports were refitted"
                f"{ranked_in_words(problem, rough, len(search.fits))}"
                f"{'; ' if shortened else ''}{shortened}."
            ),
        )

    def _predict_runs(self, runs: list[Run]) -> list[Float[np.ndarray, " n"]]:
        return predict_runs(self.fluid_, self.library_, runs, self.strain_step)

    def _check_parameters(self) -> None:
        check_optimiser(self.optimizer)
        if self.selection not in SELECTIONS:
            raise InputError(
                f"selection must be one of {', '.join(SELECTIONS)}; got {self.selection!r}."
            )
        if self.screening not in SCREENINGS:
            raise InputError(
                f"screening must be one of {', '.join(SCREENINGS)}; got {self.screening!r}."
            )
        check_library(self.library)


def _law(library: TermLibrary, fit: Fit, known: KnownPart) -> LibraryExpansion:
    support = list(fit.support)
    smaller = library.subset(support) if support else library.subset([0])
    coefficients = fit.coefficients if support else np.zeros(1)
    inner = [fit.inner[i] for i, form in enumerate(library.forms) if form in smaller.forms]
    return LibraryExpansion(
        coefficients=jnp.asarray(coefficients),
        inner=jnp.asarray(inner, float),
        library=smaller,
        linear_relaxation=known.linear_relaxation,
        base=known.law,
    )
