"""The scikit-learn estimator: runs in, all laws of a library that fit them out."""

import time
from collections.abc import Iterable
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from sklearn.utils.validation import check_is_fitted

from discover.dataset.run import Run
from discover.errors import InputError
from discover.forward.enough_steps import in_enough_steps
from discover.forward.grids.flow_batch import lay_out
from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.expansion import LibraryExpansion
from discover.laws.multimode import Fluid
from discover.laws.textbook.maxwell import UpperConvectedMaxwell
from discover.learners import LearnerResult, RecoveredTerm
from discover.learners.files.provenance import Provenance
from discover.learners.known_part import KnownPart, known_part
from discover.learners.results.weighted_laws import Limits, WeightedLaws
from discover.learners.run_prediction import RunPrediction
from discover.learners.settings import PerMode, check_library, default_library
from discover.learners.tensor_dense.draws import DenseDraws
from discover.learners.tensor_dense.mixture import Mixture, Optimum, explore
from discover.learners.tensor_dense.reference_laws import (
    N_CONSTANTS,
    REFERENCES,
    ReferenceLaw,
    with_reference,
)
from discover.learners.tensor_dense.term_sizes import term_sizes
from discover.learners.trajectories.prediction import predict_runs
from discover.learners.trajectories.problem import TrajectoryProblem, make_problem
from discover.progress import Progress, by_lines
from tensor_library.library import TermLibrary
from tensor_library.terms import parse_term


class TensorDense(RunPrediction):
    """Every term of a library at once, with a Gaussian prior: what σ12 leaves open.

    A sparse law's band holds if the law is in the library. Here no term is left out: each has a
    prior about what a named law gives it, for each of several named laws in turn, and every
    optimum that fits the data takes part in the band.

    Parameters
    ----------
    library
        Candidate terms, without closed forms; by default the eight tensors times one and each
        invariant.
    modulus, relaxation_time
        G in Pa and λ in s, numbers, or arrays with one value for each mode.
    solvent_viscosity
        η_s in Pa s.
    known_relaxation
        Whether −σ is known.
    base_law
        A known dimensionless law to which terms are added; by default UCM.
    base
        The known `Fluid`, in place of `modulus`, `relaxation_time`, `solvent_viscosity`,
        `base_law`, `known_relaxation` and `modulus_covariance`.
    modulus_covariance
        Of the moduli in Pa, as a sweep leaves them, shape (k, k), in Pa squared: the laws that fit
        differ in them too. None where the moduli are exact.
    use_normal_stresses
        Whether N1 and N2, where measured, join as observed rows.
    misfit_floor
        Relative misfit that no data are taken to go below.
    strain_step
        Largest strain between steps of the integration.
    random_state
        Seed of the draws.
    progress
        Called with a line of text and the fraction done, or None.

    Attributes
    ----------
    result_ : LearnerResult
        The law of the likeliest optimum that is a sum of library terms.
    law_ : LibraryExpansion
        The same law, dimensionless.
    fluid_ : Fluid
        The law with moduli and relaxation times.
    terms_ : tuple of RecoveredTerm
        All terms, the largest along the trajectories first.
    library_ : TermLibrary
        The library.
    coefficients_ : ndarray of shape (n_terms,)
        Coefficients over the library.
    draws_ : DenseDraws
        All laws that fit, with their weights.
    noise_ : float
        Relative noise of the records.
    runs_ : tuple of Run
        What was fitted; not in a file.
    provenance_ : Provenance
        The same in words, with a hash.
    equation_ : Equation
        The law with its modes, for SymPy, LaTeX, JSON.

    Examples
    --------
    >>> import discover as dc
    >>> data = dc.synthetic_dataset("giesekus", {"alpha": 0.2}, noise=0.01, n_samples=51)
    >>> dense = dc.TensorDense().fit(data)  # doctest: +SKIP
    >>> band = dense.predict_band(data)  # doctest: +SKIP
    """

    learner = "tensor_dense"
    _saved = (
        "n_features_in_",
        "law_",
        "fluid_",
        "terms_",
        "result_",
        "library_",
        "coefficients_",
        "draws_",
        "noise_",
        "provenance_",
    )
    _saved_types = (LearnerResult, RecoveredTerm, DenseDraws, Provenance)

    def __init__(
        self,
        library: TermLibrary | None = None,
        modulus: PerMode = 1.0,
        relaxation_time: PerMode = 1.0,
        solvent_viscosity: float = 0.0,
        known_relaxation: bool = True,
        base_law: AbstractConstitutiveLaw | None = None,
        use_normal_stresses: bool = False,
        misfit_floor: float = 1e-3,
        strain_step: float = 0.2,
        random_state: int | None = 0,
        progress: Progress | None = None,
        base: Fluid | None = None,
        modulus_covariance: Float[np.ndarray, "c c"] | None = None,
    ):
        self.library = library
        self.modulus = modulus
        self.relaxation_time = relaxation_time
        self.solvent_viscosity = solvent_viscosity
        self.known_relaxation = known_relaxation
        self.base_law = base_law
        self.use_normal_stresses = use_normal_stresses
        self.misfit_floor = misfit_floor
        self.strain_step = strain_step
        self.random_state = random_state
        self.progress = progress
        self.base = base
        self.modulus_covariance = modulus_covariance

    def _learn(self, runs: list[Run], known: KnownPart) -> None:
        started = time.perf_counter()
        problem = self._problem(runs, known)

        def sizes(constants):
            return term_sizes(with_reference(problem, constants))

        say = by_lines(self.progress, len(REFERENCES))
        found = explore(problem, sizes, self.misfit_floor, self.random_state or 0, say)
        at = _point(found)
        library = problem.library
        self.library_, self.coefficients_ = _whole(library, found, at, problem)
        self.noise_ = found.noise
        constants = np.stack([o.constants for o in found.optima])[found.optimum_of_draw]
        self.draws_ = DenseDraws(
            constants,
            found.coefficients,
            found.weights_of_draws,
            float(_reference(problem).relaxation),
            found.moduli if np.any(np.asarray(problem.modulus_error)) else None,
            None if found.named_law_fits else found.optimum_of_draw,
        )
        self.law_ = LibraryExpansion(
            coefficients=jnp.asarray(self.coefficients_),
            inner=jnp.zeros(0),
            library=self.library_,
            linear_relaxation=_reference(problem).linear_relaxation,
            base=known.law,
        )
        self.fluid_ = Fluid(
            self.law_, problem.modulus, problem.relaxation_time, problem.solvent_viscosity
        )
        self.terms_ = _terms(self.library_, self.coefficients_, found.scale)
        self.result_ = LearnerResult(
            learner=self.learner,
            law=self.law_,
            terms=self.terms_,
            train_seconds=time.perf_counter() - started,
            details=_details(found, at, problem.records.n_observations),
            message=(
                f"All {len(self.library_)} terms leave a relative misfit of {at.misfit:.2g}; "
                f"{len(found.optima)} optima about "
                f"{len({o.reference for o in found.optima})} named laws fit as well."
            ),
        )

    def laws_that_fit(self) -> WeightedLaws:
        """Return the laws that make the band, dimensionless, with their weights."""
        check_is_fitted(self, "draws_")
        known = known_part(self)
        base = UpperConvectedMaxwell(known.linear_relaxation) if known.law is None else known.law
        own = TermLibrary(self.library_.terms[: self.draws_.coefficients.shape[1]])
        return self.draws_.laws(own, base)

    def predict_band(self, X: Iterable[Run]) -> list[Limits | None]:
        """Return the 95 % band of the recorded stress, N1 and N2 in each run.

        Parameters
        ----------
        X
            Runs or a data set; of their stresses nothing is used.

        Returns
        -------
        For each run ``"sigma12"``, ``"N1"`` and ``"N2"``: lowest, middle and highest value in Pa at
        its samples, shape (3, n); where no named law fits, those of N1 allow for a law of one more
        kind. None where laws of more than half of the weight run away.
        """
        check_is_fitted(self, "fluid_")
        fluid, runs = self.fluid_, self._runs(X)
        flows = lay_out(
            [r.protocol for r in runs],
            [r.time for r in runs],
            strain_step=self.strain_step,
            relaxation_time=fluid.settling_time,
        )
        return self.laws_that_fit().bands(
            (fluid.modulus, fluid.relaxation_time, fluid.solvent_viscosity),
            in_enough_steps(fluid, flows),
            [len(run) for run in runs],
        )

    def _problem(self, runs: list[Run], known: KnownPart) -> TrajectoryProblem:
        library = default_library() if self.library is None else self.library
        base = UpperConvectedMaxwell(known.linear_relaxation) if known.law is None else known.law
        # every named law relaxes: where the known part does not, the reference brings −σ along
        lacking = jnp.asarray(0.0 if base.linear_relaxation else 1.0)
        return make_problem(
            runs,
            library,
            known.modulus,
            known.relaxation_time,
            known.solvent_viscosity,
            ReferenceLaw(
                constants=jnp.zeros(N_CONSTANTS),
                relaxation=lacking,
                base=base,
                linear_relaxation=base.linear_relaxation,
            ),
            known.linear_relaxation,
            self.use_normal_stresses,
            strain_step=self.strain_step,
            modulus_covariance=known.modulus_covariance,
        )

    def _predict_runs(self, runs: list[Run]) -> list[Float[np.ndarray, " n"]]:
        return predict_runs(self.fluid_, self.library_, runs, self.strain_step)

    def _check_parameters(self) -> None:
        check_library(self.library)
        if self.library is not None and self.library.inner_names:
            raise InputError(
                "TensorDense takes a library without closed forms, for their inner parameters "
                f"have no Gaussian prior; got {', '.join(self.library.inner_names)}. Use "
                "build_library(degree=1)."
            )


def _reference(problem: TrajectoryProblem) -> ReferenceLaw:
    assert isinstance(problem.base, ReferenceLaw)
    return problem.base


def _point(found: Mixture) -> Optimum:
    """Return the optimum of the highest evidence that is a sum of library terms."""
    told = [o for o in found.optima if REFERENCES[o.reference].terms is not None]
    return max(told, key=lambda o: o.log_evidence)


def _whole(
    library: TermLibrary, found: Mixture, at: Optimum, problem: TrajectoryProblem
) -> tuple[TermLibrary, Float[np.ndarray, " n"]]:
    """Return an optimum's law as coefficients of the library, its reference law's included."""
    added = {
        name: factor * at.constants[place]
        for name, (place, factor) in (REFERENCES[at.reference].terms or {}).items()
    }
    relaxation = float(_reference(problem).relaxation)
    if relaxation:
        added["sigma"] = added.get("sigma", 0.0) + relaxation
    library = library.extended(parse_term(name) for name in added)
    coefficients = np.zeros(len(library))
    coefficients[: len(found.scale)] = at.coefficients * found.scale
    for name, value in added.items():
        coefficients[library.names.index(name)] += value
    return library, coefficients


def _terms(library, coefficients, scale) -> tuple[RecoveredTerm, ...]:
    """Return all terms, those that are largest along the trajectories first."""
    known = np.ones(len(library))
    known[: len(scale)] = np.where(scale > 0, scale, np.inf)
    order = np.argsort(-np.abs(coefficients) / known, kind="stable")
    return tuple(
        RecoveredTerm(library.names[i], float(coefficients[i]), latex=library.terms[i].latex())
        for i in order
    )


def _details(found: Mixture, at: Optimum, n_observations: int) -> dict[str, Any]:
    rows = [
        {
            "reference": optimum.reference,
            "width": optimum.width,
            "misfit": optimum.misfit,
            "reference_misfit": optimum.reference_misfit,
            "log_evidence": optimum.log_evidence,
            "weight": float(weight),
            "draws": int(np.sum(found.optimum_of_draw == i)),
        }
        for i, (optimum, weight) in enumerate(zip(found.optima, found.weights, strict=True))
    ]
    return {
        "optima": rows,
        "misfit": at.misfit,
        "noise": {"relative": found.noise, "effective_samples": found.records},
        "n_observations": n_observations,
    }
