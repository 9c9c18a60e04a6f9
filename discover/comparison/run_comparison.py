"""Both learners on identical data, part by part, so that a run that was stopped can go on."""

import itertools
from collections.abc import Callable, Mapping

from discover.comparison.comparison import Comparison
from discover.comparison.description import data_in_words, known_in_words
from discover.comparison.equations import known_equation
from discover.comparison.fitting.prepared import (
    prepared,
    require_one_known_law,
    settled_by,
    thinned_to,
    with_each_run,
    without_spikes_in_fit,
)
from discover.comparison.fitting.step_instants import with_step_instants
from discover.comparison.fitting.training import study_library
from discover.comparison.instrument.known import Known, known_part
from discover.comparison.learning import Learning, distilled, require_teacher
from discover.comparison.outcomes.truth import true_terms
from discover.comparison.own_loadings import judged, with_own_loadings
from discover.comparison.own_noise import learned_by_noise
from discover.comparison.sweep import sweep_points, sweep_studies
from discover.dataset import Dataset
from discover.dataset.run_table import material_and_temperature
from discover.errors import InputError
from discover.inference.scattered_rates import smoothed, unfelt_scatter
from discover.laws.multimode import Fluid
from discover.learners.results.result import LearnerResult
from discover.linear_algebra_threads import in_one_thread
from discover.progress import Progress, silent
from discover.study.data import StudyData, load_study_data
from discover.study.declared_model import DeclaredModel, declared_model, forward_model
from discover.study.run_folder import RunFolder
from discover.study.schema import Study
from tensor_library.law_terms import LawTerm
from tensor_library.library import TermLibrary


@in_one_thread
def compare(
    study: Study,
    seed: int | None = None,
    progress: Progress = silent,
    store: RunFolder | None = None,
    fit_constants: Callable[[DeclaredModel, Dataset], DeclaredModel] | None = None,
    *,
    data: StudyData | None = None,
    declared: DeclaredModel | None = None,
    made: Mapping[str, tuple[LearnerResult, Fluid]] | None = None,
    library: TermLibrary | None = None,
) -> Comparison:
    """Run a study's learners on identical data and look at what each found.

    Parameters
    ----------
    study
        The study.
    seed
        Overrides the study's seeds, of the noise and of the learners.
    progress
        Called with what is going on and the fraction done.
    store
        Where finished learners are kept and found again.
    fit_constants
        Fits what the declared law leaves open; without it, open parameters are an error.
    data, declared
        Data and known part that are at hand, in place of the study's.
    made
        Learners that are fitted already: what they found, by learner.
    library
        The terms that they searched, in place of the study's.

    Raises
    ------
    InputError
        If the study asks for something that its data cannot give.
    """
    options = study.compare
    data = prepared(load_study_data(study, seed) if data is None else data)
    of_spikes = ""
    if made is None:  # estimators that are fitted already saw every sample
        data, of_spikes = without_spikes_in_fit(data)
        data = thinned_to(data, options.most_samples)
        data = with_own_loadings(data, options.loading)
    require_teacher(study)
    sweep = sweep_studies(study)
    declared = declared_model(study, data.dataset) if declared is None else declared
    require_one_known_law(declared)
    of_scatter = unfelt_scatter(forward_model(declared), data.fit.runs)
    if of_scatter:
        data = with_each_run(data, smoothed)
    data = settled_by(data, float(max(declared.relaxation_time)), declared.law.linear_relaxation)
    next_flows = options.next.weissenberg_numbers, options.next.deborah_numbers
    pipkin = list(itertools.product(*next_flows))
    library = study_library(study) if library is None else library
    undated = data
    data, of_steps = with_step_instants(declared, data, library)

    def known_in(some: StudyData) -> Known:
        grid = options.high_deborah, pipkin
        return known_part(declared, some, library, *grid, fit_constants)

    known = known_in(data)
    if sweep and (known.along is not None or declared.effects):
        raise InputError(
            "compare.sweep computes data that hold no instrument, so [model] can have neither "
            'effects nor constants to be fitted along with it. Write numbers instead of "fit".'
        )
    learning = Learning(study, options.seed if seed is None else seed, store, made)
    n_parts = (1 + len(sweep)) * len(options.learners) + int(options.distillation) + 1

    def learn(text: str, fraction: float) -> None:
        progress(text, fraction * len(options.learners) / n_parts)

    own = learning.outcomes(options.learners, known, learn)
    if made is None:
        known, own = learned_by_noise(study, learning, data, (known, own), known_in, learn)
    model = known.before.model

    def at(done: int, title: str) -> Progress:
        return lambda text, fraction: progress(f"{title}: {text}", (done + fraction) / n_parts)

    points = sweep_points(sweep, learning, model, seed, lambda i, title: at(len(own) + i, title))
    done = (1 + len(sweep)) * len(options.learners)

    def say(text: str) -> None:
        progress(text, done / n_parts)

    deviation = options.loading if made is None else None
    seen = judged(
        study, (known, own), (data, undated), known_in, library, learning.seed, say, deviation
    )
    known, found = seen.known, seen.judgement
    distillations = distilled(study, data.truth, store, at(done, "distillation"))
    progress("done", 1.0)
    return Comparison(
        name=study.name,
        data_summary=data_in_words(data, study)
        + (_TAKEN_OUT if known.along is None and known.effects else "")
        + "".join(f". {text}" for text in (of_scatter, of_steps, of_spikes) if text)
        + (_BY_LOADING if seen.loadings is not None else "")
        + (_BY_NOISE if any(flow.weight != 1.0 for flow in known.flows) else ""),
        known_part=known_in_words(declared, known, study),
        flows=seen.flows,
        before=known.alone(),
        outcomes=found.outcomes,
        truth=_truth(study, model),
        noise=None if study.data.synthetic is None else study.data.synthetic.noise,
        rivals=found.rivals,
        statements=found.statements,
        structure=found.structure,
        sweep=points,
        distillations=distillations,
        next_measurement=found.next_measurement,
        seed=learning.seed,
        known=known_equation(model),
        known_of={name: known_equation(frame.model) for name, frame in seen.frames.items()},
        known_effects=known.effects,
        conditions=material_and_temperature(data.dataset, study.data.material),
        stood_for=() if known.along is None else known.along.twins,
        explanation=found.explanation,
        classical=found.classical,
        warnings=found.warnings,
        by_mode=found.by_mode,
        loadings=seen.loadings,
    )


_BY_NOISE = ". Records differ in noise, and each weighs by its own"
_BY_LOADING = ". The fitted records are shown without the factor of their loading"
_TAKEN_OUT = ". What the known instrument did is taken out of the records"


def _truth(study: Study, model: DeclaredModel) -> tuple[LawTerm, ...] | None:
    synthetic = study.data.synthetic
    if synthetic is None or model.law_name != "ucm":
        return None
    return true_terms(synthetic.law, synthetic.parameters, study.model.known_relaxation)
