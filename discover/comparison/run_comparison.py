"""Both learners on identical data, part by part, so that a run that was stopped can go on."""

import itertools
from collections.abc import Callable, Mapping
from dataclasses import replace

from discover.comparison.classical import fit_classical_laws
from discover.comparison.comparison import Comparison, SweepPoint
from discover.comparison.dense_library import open_where_dense_is_wide
from discover.comparison.disagreement import contested, disagreements, open_where_contested
from discover.comparison.equations import known_equation
from discover.comparison.explanation import Explanation, explain
from discover.comparison.flows import Flow, comparison_flows, predict
from discover.comparison.identifiability import (
    find_rivals,
    physics_of,
    structure_of,
)
from discover.comparison.next_measurement import NextMeasurement, next_measurement
from discover.comparison.outcome import LearnerOutcome
from discover.comparison.sampled_rates import left_by_sampled_rates
from discover.comparison.statements import make_statements
from discover.comparison.training import (
    Progress,
    require_numbers,
    silent,
    study_library,
    train,
)
from discover.comparison.truth import TrueTerm, true_terms
from discover.comparison.unseen_runs import hold_against_unseen
from discover.dataset import Dataset
from discover.errors import InputError
from discover.laws.multimode import Fluid
from discover.laws.registry import LAWS, make_law
from discover.learners.result import LearnerResult
from discover.protocols.kinematics import recorded_quantity
from discover.statistics.residual import Expectation
from discover.study.build import DeclaredModel, StudyData, declared_model, load_study_data
from discover.study.run_folder import RunFolder
from discover.study.schema import Study
from tensor_library.library import TermLibrary


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
    data = load_study_data(study, seed) if data is None else data
    _require_one_split(data)
    _require_teacher(study)
    sweep = _sweep_studies(study)
    declared = declared_model(study, data.dataset) if declared is None else declared
    model = declared if fit_constants is None else fit_constants(declared, data.fit)
    require_numbers(model)
    following_options = options.next
    grid = itertools.product(
        following_options.weissenberg_numbers, following_options.deborah_numbers
    )
    flows = comparison_flows(data, options.high_deborah, list(grid))
    learner_seed = options.seed if seed is None else seed
    n_parts = (1 + len(sweep)) * len(options.learners) + int(options.distillation) + 1
    done = 0

    def step(title: str) -> Progress:
        return lambda text, fraction: progress(f"{title}: {text}", (done + fraction) / n_parts)

    outcomes = {}
    for learner in options.learners:
        outcomes[learner] = _outcome(
            learner, learner, study, model, data, flows, learner_seed, step(learner), store, made
        )
        done += 1
    points = []
    for law, value, other in sweep:
        other_data = load_study_data(other, seed)
        flow = comparison_flows(other_data, ())[len(other_data.fit)]
        found = {}
        for learner in options.learners:
            part = f"sweep_{law}_{value:g}_{learner}"
            found[learner] = _outcome(
                part, learner, other, model, other_data, [flow], learner_seed, step(part), store
            )
            done += 1
        assert options.sweep is not None
        points.append(SweepPoint(law, options.sweep.parameter, value, flow, found))
    normal = options.use_normal_stresses
    expectation = expectation_of(study, model)
    explanation = explain(outcomes, flows, expectation, normal)
    progress("rivals: simulating laws that the data do not rule out", done / n_parts)
    chosen = outcomes.get("tensor_sindy")
    rivals, structure, following = [], None, NextMeasurement()
    judged = [flow for flow in flows if flow.kind in ("test", "held_out")]
    fitted = [flow for flow in flows if flow.kind == "training"]
    judged = judged or fitted
    if chosen is not None and explanation.verdict != "no_signal":
        library = study_library(study) if library is None else library
        met = chosen.details.get("rivals", ())
        rivals = find_rivals(chosen.terms, met, model, flows, library, chosen.predictions)
        structure = structure_of(chosen.terms, data.fit.runs, library, model, normal)
    if chosen is not None and explanation.in_library:
        # where a quantity is said to be determined, its band says how well
        banded = judged if judged is fitted else [*judged, *fitted]
        # bands and experiments take it that the law, or a rival, is the fluid's
        following = next_measurement(
            chosen, rivals, model.fluid, banded, following_options, learner_seed
        )
    explanation = hold_against_unseen(explanation, outcomes, flows, following.bands, expectation)
    if not explanation.in_library:
        following = NextMeasurement()
    outcomes = {name: _told(outcome, explanation) for name, outcome in outcomes.items()}
    classical = []
    bands, silent_records = following.bands, explanation.verdict == "no_signal"
    statements = make_statements(explanation, flows, rivals, structure, bands, normal)
    if not silent_records:
        statements = open_where_contested(statements, contested(outcomes, judged, bands))
        statements = open_where_dense_is_wide(statements, outcomes, judged)
        progress("the classical laws on the same runs", done / n_parts)
        classical = fit_classical_laws(model, flows, study.model.known_relaxation)
    distillations = _distil(study, data, store, step("distillation"))
    progress("done", 1.0)
    return Comparison(
        name=study.name,
        data_summary=_summary(data, study),
        known_part=_known_part(model, study, declared.free),
        flows=flows,
        before={flow.key: predict(model.fluid, flow) for flow in flows},
        outcomes=outcomes,
        truth=_truth(study, model),
        noise=None if study.data.synthetic is None else study.data.synthetic.noise,
        rivals=rivals,
        statements=statements,
        structure=structure,
        sweep=points,
        distillations=distillations,
        next_measurement=following,
        seed=learner_seed,
        known=known_equation(model),
        explanation=explanation,
        classical=classical,
        warnings=() if silent_records else tuple(disagreements(outcomes, judged, bands)),
    )


def expectation_of(study: Study, model: DeclaredModel) -> Expectation:
    """Return what a complete law may leave of a study's runs, as the closed loop has it."""
    linear_error = 0.0 if model.spectrum is None else model.spectrum.relative_error
    return Expectation(study.loop.noise, linear_error)


def _told(outcome: LearnerOutcome, explanation: Explanation) -> LearnerOutcome:
    """Return an outcome without the claims that its data do not bear."""
    if explanation.verdict == "no_signal":
        message = "The records hold no signal, so what was fitted to them is no law"
        return replace(outcome, terms=(), message=message, details={})
    if outcome.learner == "tensor_sindy" and not explanation.in_library:
        tested = int(outcome.details.get("tested") or 0)
        text = f"{tested} other laws were tried. " if tested else ""
        text += (
            "No law in the library explains these data, so ruling out others says nothing; the "
            "laws below are those that describe the data about as well as the best."
        )
        return replace(outcome, details={**outcome.details, "rivals_text": text})
    return outcome


def _outcome(
    part: str,
    learner: str,
    study: Study,
    model: DeclaredModel,
    data: StudyData,
    flows: list[Flow],
    seed: int,
    progress: Callable[[str, float], None],
    store: RunFolder | None,
    made: Mapping[str, tuple[LearnerResult, Fluid]] | None = None,
) -> LearnerOutcome:
    kept = None if store is None else store.load(part)
    if kept is not None and all(flow.key in kept["predictions"] for flow in flows):
        return LearnerOutcome.from_state(kept)
    progress("starting", 0.0)
    if made is not None:
        result, fluid = made[learner]
    else:
        result, fluid = train(learner, study, model, data.fit.runs, seed, progress)
    outcome = LearnerOutcome.of(result, fluid, flows)
    if part == learner:
        # a sweep's outcomes are looked at in one flow only
        outcome = replace(
            outcome,
            physics=physics_of(fluid, flows),
            resolution=left_by_sampled_rates(fluid, flows, outcome.predictions),
        )
    if store is not None:
        store.save(part, outcome.to_state())
        # the same route as after an interruption, so that both give the same files
        return LearnerOutcome.from_state(outcome.to_state())
    return outcome


def _sweep_studies(study: Study) -> list[tuple[str, float, Study]]:
    sweep, synthetic = study.compare.sweep, study.data.synthetic
    if sweep is None:
        return []
    if synthetic is None:
        raise InputError(
            "compare.sweep makes synthetic data, so [data] must say synthetic = {...} too."
        )
    studies = []
    for law in sweep.laws:
        if sweep.parameter not in LAWS[law].parameters:
            wanted = ", ".join(LAWS[law].parameters) or "none"
            raise InputError(
                f"compare.sweep: the law {law!r} has no parameter {sweep.parameter!r}. "
                f"Write one of its parameters: {wanted}."
            )
        for value in sweep.values:
            make_law(law, {sweep.parameter: value})  # refuses now what would fail after hours
            made = synthetic.model_copy(update={"law": law, "parameters": {sweep.parameter: value}})
            data = study.data.model_copy(update={"synthetic": made})
            studies.append((law, value, study.model_copy(update={"data": data})))
    return studies


def _distil(study: Study, data: StudyData, store: RunFolder | None, progress: Progress):
    if not study.compare.distillation:
        return []
    assert data.truth is not None
    assert study.data.synthetic is not None
    kept = None if store is None else store.load("distillation")
    if kept is not None:
        return kept["rows"]
    from discover.learners.distillation import STUDENTS, distil

    teacher = study.data.synthetic.law
    students = [name for name in STUDENTS if name != teacher]
    rows = []
    for i, student in enumerate(students):
        progress(f"{teacher} teaches {student}", i / len(students))
        rows.append({"teacher": teacher, **distil(data.truth, student).as_dict()})
    if store is not None:
        store.save("distillation", {"rows": rows})
    return rows


def _truth(study: Study, model: DeclaredModel) -> tuple[TrueTerm, ...] | None:
    synthetic = study.data.synthetic
    if synthetic is None or model.law_name != "ucm":
        return None
    return true_terms(synthetic.law, synthetic.parameters, study.model.known_relaxation)


def _require_teacher(study: Study) -> None:
    if study.compare.distillation and study.data.synthetic is None:
        raise InputError(
            "compare.distillation needs a known law as teacher, so [data] must say synthetic = "
            "{...}. Use discover distil for laws by name."
        )


def _require_one_split(data: StudyData) -> None:
    """Refuse what only the closed loop can do."""
    if data.each:
        raise InputError(
            'held_out = "each" is for close-loop; a comparison needs the names of held-out runs, '
            'such as held_out = ["fast.csv"].'
        )


def _summary(data: StudyData, study: Study) -> str:
    samples = sum(len(run) for run in data.fit)
    recorded = recorded_quantity(run.flow for run in data.fit)
    runs = f"{recorded} of {len(data.fit)} runs ({samples} samples)"
    made = study.data.synthetic
    if made is None:
        kept = f"{data.dataset.left_out} {data.dataset.thinned}".strip().removesuffix(".")
        text = f"{runs} of {data.dataset.name}; {len(data.held_out)} runs held out"
        return f"{text}. {kept}" if kept else text
    law = LAWS[made.law].described(made.parameters)
    noise = f"{100 * made.noise:g} % noise" if made.noise else "no noise"
    return f"{runs} computed from the {law} law, {noise}"


def _known_part(model: DeclaredModel, study: Study, fitted: tuple[str, ...]) -> str:
    text = _law_and_modes(model, study)
    if not fitted:
        return text
    constants = f"G = {model.modulus.sum():.4g} Pa, λ = {model.relaxation_time.max():.4g} s"
    return f"{text}, {constants} ({', '.join(fitted)} fitted with this law alone, then held)"


def _law_and_modes(model: DeclaredModel, study: Study) -> str:
    if not study.model.known_relaxation:
        return "upper convected Maxwell without its relaxation term (a purely elastic solid)"
    named = LAWS.get(model.law_name)
    title = model.law_name if named is None else named.described(model.parameters)
    modes = len(model.modulus)
    return title if modes == 1 else f"{title}, {modes} relaxation modes from the linear sweep"
