"""The scikit-learn estimator: runs in, a sparse constitutive law out."""

import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pysindy.optimizers import BaseOptimizer

from discover.dataset.run import Run
from discover.inference.fits import Fitter
from discover.inference.left_out import left_out
from discover.laws import Fluid
from discover.laws.expansion import law_of_terms
from discover.learners import LearnerResult
from discover.learners.run_prediction import RunPrediction
from discover.learners.settings import check_library, default_library, law_below
from discover.learners.tensor_sindy import report
from discover.learners.tensor_sindy.optimisers import check_optimiser
from discover.learners.tensor_sindy.search import SupportSearch, library_problem
from discover.progress import Progress, by_lines
from discover.words import percent_of
from tensor_library import LawTerms, TermLibrary

_ROUNDS = 8
"""Lines of text that a search is expected to say."""


@dataclass(eq=False, repr=False)
class TensorSINDy(RunPrediction):
    """Sparse regression on a frame-invariant library, from shear stress alone.

    The normal stresses are integrated, never observed. Along a trial law's trajectory the data
    give a linear sparse problem for the coefficients; a pysindy optimiser proposes supports, each
    is fitted to the integrated trajectories and weighed by its evidence, and forward, backward and
    exchange moves go on from the likeliest until none helps. Of supports that no observation
    distinguishes the simplest is taken.

    Parameters
    ----------
    library
        Candidate terms; by default those of the commands: tensors with coefficients up to degree
        one in the invariants.
    optimizer
        ``"stlsq"``, ``"sr3"``, ``"ssr"``, ``"frols"``, or a pysindy optimiser.
    base
        The known `Fluid` to whose law terms are added; by default UCM with 1 Pa and 1 s. Evidence
        and intervals allow for errors of its moduli. With ``UpperConvectedMaxwell(False)`` not even
        −σ is known: the learner has to find ``sigma`` too.
    random_state
        Taken as every learner takes it; nothing here is random.
    use_normal_stresses
        Whether N1 and N2, where measured, join as records of their own.
    max_terms
        Largest support.
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
    covariance_ : ndarray of shape (p, p) or None
        Of the coefficients of `terms_`, then of their inner parameters; None for an empty law.
    search_ : SupportSearch
        Every support that was fitted.
    runs_ : tuple of Run
        What was fitted. A file holds neither these nor `search_`.
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
    _saved = (*RunPrediction._saved, "library_", "coefficients_", "inner_", "covariance_")

    library: TermLibrary | None = None
    optimizer: str | BaseOptimizer = "stlsq"
    use_normal_stresses: bool = False
    max_terms: int = 5
    progress: Progress | None = None
    base: Fluid | None = None
    random_state: int = 0

    def _learn(self, runs: list[Run], known: Fluid) -> None:
        started = time.perf_counter()
        library = default_library() if self.library is None else self.library
        problem = library_problem(runs, library, known, self.use_normal_stresses)
        fitter = Fitter(problem, problem.fitted)
        say = by_lines(self.progress, _ROUNDS)
        search = SupportSearch(fitter, library, self.optimizer, self.max_terms, say).run()
        path = search.path()
        held_out = left_out(fitter, path) if len(runs) > 1 else None
        # of equals the simplest
        number = int(np.argmax([search.rank(fit) for fit in path]))
        chosen = path[number]

        self.search_ = search
        self.library_ = library
        self.terms_ = report.recovered_terms(search, chosen)
        self.covariance_ = report.covariance_of_terms(search, chosen)
        terms = LawTerms.of(self.terms_)
        self.coefficients_, self.inner_ = terms.over(library)
        self.law_ = law_of_terms(terms, known.law.linear_relaxation, law_below(known))
        self.fluid_ = replace(known, law=self.law_, modulus_covariance=None)
        misfit, rows = fitter.misfit(chosen), len(problem.fitted)
        self.result_ = LearnerResult(
            learner="tensor_sindy",
            law=self.law_,
            terms=self.terms_,
            train_seconds=time.perf_counter() - started,
            details={
                "path": report.path_table(search, path, held_out),
                "chosen": number,
                "inclusion": report.inclusion(search),
                "rivals": report.rival_table(search, chosen),
                "optimizer": self.optimizer
                if isinstance(self.optimizer, str)
                else type(self.optimizer).__name__,
                "misfit": misfit,
                "noise": report.noise_of(chosen, rows),
                "n_observations": rows,
            },
            message=(
                f"{len(self.terms_)} of {len(library)} terms; misfit {percent_of(misfit)}; "
                f"{len(search.found)} sets of terms fitted."
            ),
        )

    def __getstate__(self) -> dict[str, Any]:
        """Return what another process can use: programs of the search are of this one."""
        state: dict[str, Any] = {**super().__getstate__()}  # pyright: ignore
        state.pop("search_", None)
        return state

    def _check_parameters(self) -> None:
        check_optimiser(self.optimizer)
        check_library(self.library)
