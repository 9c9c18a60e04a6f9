"""The scikit-learn estimator: runs in, a trained network law out."""

import os
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Float

from discover.dataset.records.thinning import evenly_chosen
from discover.dataset.run import Run
from discover.errors import InputError
from discover.forward.flow_batch import FlowBatch
from discover.laws import Fluid, TensorBasisNetwork
from discover.learners import LearnerResult, RecoveredTerm
from discover.learners.run_prediction import RunPrediction
from discover.learners.settings import default_library, law_below
from discover.learners.tbnn_ude import ensemble
from discover.learners.tbnn_ude.evidence import negative_log_evidence
from discover.learners.tbnn_ude.least_squares import Cloud, law_misfit, sample_states
from discover.learners.tbnn_ude.problem import DefaultRecipe, Trained, TrainingProblem, make_problem
from discover.learners.tbnn_ude.projection import Projection, project
from discover.learners.tbnn_ude.recipes import PaperRecipe, train_default, train_paper, work
from discover.progress import Progress, by_steps
from discover.protocols.kinematics import STATES
from tensor_library import TENSOR_NAMES, TermLibrary, parse_term

RECIPES = ("default", "thorough", "paper")


@dataclass(eq=False, repr=False)
class TBNNUDE(RunPrediction):
    """A tensor-basis neural network inside the differential equation, from shear stress alone.

    Parameters
    ----------
    recipe
        ``"default"`` (least squares, constants first), ``"thorough"`` (the same, with nothing left
        out where there are many modes, runs and steps), ``"paper"`` (Adam, 7,200 iterations), or a
        `DefaultRecipe` or `PaperRecipe`.
    base
        The known `Fluid` to whose law the network is added; by default UCM with 1 Pa and 1 s. With
        ``UpperConvectedMaxwell(False)`` not even −σ is known: the network has to find it too.
    n_members
        Networks that reach the data by different ways (see `ensemble`). The likeliest of those that
        fit is taken, without noise the simplest; what they disagree on, the data leave open.
    projection_library
        Candidate terms in which the network is put into words; by default tensors with
        coefficients up to degree one.
    quick
        Fewer steps, for demonstrations.
    random_state
        Seed of the initial weights.
    progress
        Called with a line of text and the fraction done, or None.

    Attributes
    ----------
    result_ : LearnerResult
        The law, its projection on the library, coefficients along trajectories, seconds.
    law_ : TensorBasisNetwork
        The dimensionless law.
    fluid_ : Fluid
        The law with moduli and relaxation times.
    terms_ : tuple of RecoveredTerm
        The projection.
    members_ : list of TensorBasisNetwork
        Every trained member, the first one first.
    ensemble_fluids_ : list of Fluid
        Every member with moduli and relaxation times, ready to simulate.
    ensemble_ : str
        How the members came about.
    fitting_ : list of TensorBasisNetwork
        Members that fit the data about as well as the best, `law_` first.
    runs_ : tuple of Run
        What was fitted; a file does not hold it.
    provenance_ : Provenance
        The same in words, with a hash.
    equation_ : Equation
        The projection with the modes, for SymPy, LaTeX, JSON.

    Examples
    --------
    >>> import discover as dc
    >>> data = dc.synthetic_dataset("giesekus", {"alpha": 0.2}, noise=0.01, n_samples=51)
    >>> network = dc.TBNNUDE(quick=True).fit(data)  # doctest: +SKIP
    >>> network.predict(data).shape  # doctest: +SKIP
    """

    learner = "tbnn_ude"
    _saved = (*RunPrediction._saved, "members_", "ensemble_fluids_", "ensemble_", "fitting_")

    recipe: str | DefaultRecipe | PaperRecipe = "default"
    n_members: int = 3
    projection_library: TermLibrary | None = None
    quick: bool = False
    random_state: int = 0
    progress: Progress | None = None
    base: Fluid | None = None

    def _learn(self, runs: list[Run], known: Fluid) -> None:
        started = time.perf_counter()
        recipe = self._recipe()
        problem, fitted = make_problem(runs, known), ""
        if isinstance(recipe, DefaultRecipe) and work(problem) > recipe.affordable:
            problem, fitted = _rougher(problem, runs, known, recipe.samples)
            recipe = replace(recipe, affordable=0.0)  # the race stays too much on any grid
        modes = replace(known, modulus_covariance=None)

        keys = jax.random.split(jax.random.key(self.random_state), self.n_members)
        trained, agreement = self._train_all(problem, keys, recipe, known)
        members = [member.law for member in trained]
        misfits = ensemble.member_misfits(members, problem)
        resolved, surprise = _resolved(recipe), None
        if isinstance(recipe, DefaultRecipe) and np.min(misfits) > resolved and trained[0].varies:
            surprise = negative_log_evidence(members, problem)
        chosen, fits = ensemble.choose_member(trained, misfits, resolved, surprise)
        best = replace(trained[chosen], misfit=float(misfits[chosen]))

        self.members_ = members
        self.ensemble_ = agreement
        self.law_ = best.law
        self.fitting_ = [best.law, *(m for i, m in enumerate(members) if fits[i] and i != chosen)]
        self.ensemble_fluids_ = [replace(modes, law=law) for law in members]
        self.fluid_ = replace(modes, law=best.law)
        cloud = sample_states(best.law, problem)
        library = self.projection_library or default_library()
        projection = project(best.law, cloud, library)
        self.terms_ = _terms(projection, best, cloud)
        self.result_ = LearnerResult(
            learner="tbnn_ude",
            law=self.law_,
            terms=self.terms_,
            train_seconds=time.perf_counter() - started,
            details={
                "recipe": type(recipe).__name__,
                "misfit": best.misfit,
                "coefficients": _coefficient_table(best.law, cloud),
                "coefficients_vary": best.varies,
                "n_constants": _count_of_numbers(best.law, best.varies),
                "projection_misfit": projection.misfit,
                "ensemble": agreement,
                "members": [
                    {
                        "misfit": float(misfit),
                        "fits": bool(fitting),
                        "coefficients": _coefficient_table(law, sample_states(law, problem)),
                    }
                    for law, misfit, fitting in zip(members, misfits, fits, strict=True)
                ],
            },
            message="; ".join(filter(None, (best.message, trained[0].left_out, fitted))),
            members=tuple(self.fitting_) if len(self.fitting_) > 1 else (),
        )

    def _recipe(self) -> DefaultRecipe | PaperRecipe:
        if isinstance(self.recipe, DefaultRecipe | PaperRecipe):
            return self.recipe
        if self.recipe == "default":
            recipe = DefaultRecipe()
            if not self.quick:
                return recipe
            return replace(recipe, width=8, steps=6, polish_steps=30, max_tensors=1, variations=())
        if self.recipe == "thorough":
            return DefaultRecipe(affordable=np.inf)
        if self.recipe == "paper":
            return PaperRecipe(iterations_per_series=100 if self.quick else 900)
        raise InputError(f"recipe must be one of {', '.join(RECIPES)}; got {self.recipe!r}.")

    def _train_all(
        self, problem: TrainingProblem, keys, recipe, known: Fluid
    ) -> tuple[list[Trained], str]:
        """Return all members, and how they came about."""
        say = by_steps(self.progress)

        def member(key) -> Trained:
            return self._train(problem, key, recipe, known, say)

        first = member(keys[0])
        if len(keys) == 1:
            return [first], "a single member"
        if isinstance(recipe, PaperRecipe):
            # the first has compiled the program; its steps are too small to be shared out
            with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
                each = [first, *pool.map(member, keys[1:])]
            return each, "trained from initial weights of their own"
        others, agreement = ensemble.train_others(problem, first, keys[1:], recipe, say)
        return [first, *others], agreement

    def _train(self, problem: TrainingProblem, key, recipe, known: Fluid, say) -> Trained:
        relaxes, below = known.law.linear_relaxation, law_below(known)
        if isinstance(recipe, DefaultRecipe):
            return train_default(problem, key, relaxes, recipe, say, below)
        law, losses = train_paper(problem, key, relaxes, recipe, say, base_law=below)
        misfit = float(np.linalg.norm(np.asarray(law_misfit(law, problem))))
        message = f"the paper's recipe, {losses.size} iterations; relative misfit {misfit:.2g}"
        return Trained(law, law, misfit, True, message)


def _resolved(recipe: DefaultRecipe | PaperRecipe) -> float:
    return recipe.resolved if isinstance(recipe, DefaultRecipe) else DefaultRecipe().resolved


_WORTH_TRAINING_ON = 1.5
"""Times fewer steps from which a rough grid pays; a law is tested on a grid of its own."""


def _rougher(
    problem: TrainingProblem, runs: Sequence[Run], known: Fluid, samples: int
) -> tuple[TrainingProblem, str]:
    """Return a problem of fewer samples and longer steps, and what was left out in words."""
    fewer = [run.window(evenly_chosen(len(run), samples)) for run in runs]
    said = []
    if any(len(few) < len(run) for few, run in zip(fewer, runs, strict=True)):
        problem = make_problem(fewer, known)
        said.append(f"at most {samples} samples of a run were fitted")
    limits = _rough_limits(problem.flows, np.asarray(known.relaxation_time))
    if limits is not None and known.law.linear_relaxation:
        rough = make_problem(fewer, known, **limits)
        share = problem.flows.n_steps / rough.flows.n_steps
        if share >= _WORTH_TRAINING_ON:
            problem = rough
            said.append(f"it was trained in {share:.2g} times fewer steps than it is tested in")
    return problem, ", and ".join(said)


_STRAIN_STEP, _PHASE_STEP, _GROWTH = 0.4, 0.3, 0.1


def _rough_limits(
    flows: FlowBatch, relaxation_time: Float[np.ndarray, " k"]
) -> Mapping[str, float] | None:
    """Return limits of longer steps, as `make_grid` takes them; None where the flows have none.

    Steps grow after a change of the rate up to a strain of one, and follow the fastest relaxation
    where the fine grid does, else the slowest: over steps of many relaxation times a law that
    relaxes faster than the known one diverges.
    """
    controls = {protocols.control for protocols, _ in flows.parts}
    if not controls <= {"rate", *STATES}:
        return None
    if "rate" not in controls:
        return {"strain_step": _STRAIN_STEP}
    longest = max(
        float(np.max(np.diff(grid.times, axis=1)))
        for protocols, grid in flows.parts
        if protocols.control == "rate"
    )
    times = np.asarray(relaxation_time)
    followed = float(np.min(times) if longest <= np.min(times) else np.max(times))
    return {
        "strain_step": _STRAIN_STEP,
        "phase_step": _PHASE_STEP,
        "growth": _GROWTH,
        "max_step": max(longest, followed),
    }


def _count_of_numbers(law: TensorBasisNetwork, varies: bool) -> int:
    """Return how many numbers of a law were fitted: constants that are not zero, and weights."""
    count = int(np.count_nonzero(np.asarray(law.constants)))
    if varies:
        weights = jax.tree.leaves(eqx.filter(law.network, eqx.is_inexact_array))
        count += sum(int(leaf.size) for leaf in weights)
    return count


def _coefficient_table(law: TensorBasisNetwork, cloud: Cloud) -> dict[str, dict[str, float]]:
    """Return mean and spread of every coefficient along the trajectories, by tensor."""
    values = np.asarray(cloud.coefficients(law))
    return {
        name: {"mean": float(np.mean(column)), "spread": float(np.std(column))}
        for name, column in zip(TENSOR_NAMES, values.T, strict=True)
    }


def _terms(projection: Projection, trained: Trained, cloud: Cloud) -> tuple[RecoveredTerm, ...]:
    if not projection.terms:
        return ()
    chosen = TermLibrary(tuple(parse_term(term.term) for term in projection.terms))
    # the same terms in the law as the prior left it
    shrunk = project(trained.penalised_law, cloud, chosen, max_terms=len(chosen))
    penalised = {term.term: term.coefficient for term in shrunk.terms}
    return tuple(
        RecoveredTerm(
            found.term,
            found.coefficient,
            found.inner,
            coefficient_penalised=penalised.get(found.term, 0.0),
            latex=term.latex(),
        )
        for found, term in zip(projection.terms, chosen.terms, strict=True)
    )
