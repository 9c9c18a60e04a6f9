"""Both learners on identical data, part by part, so that a run that was stopped can go on."""

import itertools
from collections.abc import Callable, Mapping
from dataclasses import replace

from discover.comparison.classical import CLASSICAL, fit_classical_laws
from discover.comparison.comparison import Comparison, SweepPoint
from discover.comparison.constant import in_words as in_words_of
from discover.comparison.dense_library import open_where_dense_is_wide
from discover.comparison.disagreement import contested, disagreements, open_where_contested
from discover.comparison.equations import known_equation
from discover.comparison.explanation import Explanation, explain
from discover.comparison.flows import comparison_flows
from discover.comparison.identifiability import (
    find_rivals,
    physics_of,
    structure_of,
)
from discover.comparison.instrument import Frame, Learned, classical_along
from discover.comparison.known import Known
from discover.comparison.known import known_part as _known
from discover.comparison.next_measurement import NextMeasurement, next_measurement
from discover.comparison.outcome import LearnerOutcome
from discover.comparison.sampled_rates import left_by_sampled_rates
from discover.comparison.statements import make_statements
from discover.comparison.training import study_library, train
from discover.comparison.truth import TrueTerm, true_terms
from discover.comparison.unseen_runs import hold_against_unseen
from discover.dataset import Dataset
from discover.dataset.conditions import material_and_temperature
from discover.dataset.material_functions import at_measured_rate
from discover.errors import InputError
from discover.laws.multimode import Fluid
from discover.laws.registry import LAWS, make_law
from discover.learners.result import LearnerResult
from discover.progress import Progress, silent
from discover.protocols import settled
from discover.protocols.kinematics import in_words
from discover.statistics.residual import Expectation
from discover.study.build import (
    MODE_CONSTANTS,
    DeclaredModel,
    StudyData,
    declared_model,
    load_study_data,
)
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
    data = _at_rates(data)
    _require_teacher(study)
    sweep = _sweep_studies(study)
    declared = declared_model(study, data.dataset) if declared is None else declared
    data = _settled(data, float(max(declared.relaxation_time)))
    if declared.choice:
        raise InputError(
            "[model] law names several laws to choose from, which is for close-loop: a comparison "
            "learns what one known law lacks. Name one law, or ucm."
        )
    if declared.by_mode:
        raise InputError(
            "[model] by_mode is for close-loop: a comparison has one set of constants for all "
            "relaxation modes, in the known part and in each learner. Leave it out here."
        )
    following_options = options.next
    grid = list(
        itertools.product(following_options.weissenberg_numbers, following_options.deborah_numbers)
    )
    library = study_library(study) if library is None else library
    known = _known(declared, data, library, options.high_deborah, grid, fit_constants)
    if sweep and (known.along is not None or declared.effects):
        raise InputError(
            "compare.sweep computes data that hold no instrument, so [model] can have neither "
            'effects nor constants to be fitted along with it. Write numbers instead of "fit".'
        )
    model, flows = known.before.model, known.flows
    learner_seed = options.seed if seed is None else seed
    n_parts = (1 + len(sweep)) * len(options.learners) + int(options.distillation) + 1
    done = 0

    def step(title: str) -> Progress:
        return lambda text, fraction: progress(f"{title}: {text}", (done + fraction) / n_parts)

    own: dict[str, LearnerOutcome] = {}
    frames: dict[str, Frame] = {}
    for learner in options.learners:
        own[learner] = _outcome(
            learner, learner, study, known, learner_seed, step(learner), store, made
        )
        frames[learner] = known.frame(own[learner])
        done += 1
    outcomes = {name: frames[name].outcome(outcome) for name, outcome in own.items()}
    points = []
    for law, value, other in sweep:
        other_data = load_study_data(other, seed)
        flow = comparison_flows(other_data, ())[len(other_data.fit)]
        found = {}
        for learner in options.learners:
            part = f"sweep_{law}_{value:g}_{learner}"
            alone = Known(Frame(model, other_data, [flow]), None, [flow])
            found[learner] = _outcome(part, learner, other, alone, learner_seed, step(part), store)
            done += 1
        assert options.sweep is not None
        points.append(SweepPoint(law, options.sweep.parameter, value, flow, found))
    normal = options.use_normal_stresses
    expectation = expectation_of(study, model)
    explanation = explain(outcomes, flows, expectation, normal)
    progress("rivals: simulating laws that the data do not rule out", done / n_parts)
    chosen, frame = own.get("tensor_sindy"), frames.get("tensor_sindy", known.before)
    rivals, structure, following = [], None, NextMeasurement()
    judged = [flow for flow in flows if flow.kind in ("test", "held_out")]
    fitted = [flow for flow in flows if flow.kind == "training"]
    judged = judged or fitted
    if chosen is not None and explanation.verdict != "no_signal":
        met = chosen.details.get("rivals", ())
        given = frame.model
        rivals = find_rivals(chosen.terms, met, given, frame.flows, library, chosen.predictions)
        structure = structure_of(chosen.terms, frame.data.fit.runs, library, given, normal)
    if chosen is not None and explanation.in_library:
        # where a quantity is said to be determined, its band says how well
        keys = {flow.key for flow in (judged if judged is fitted else [*judged, *fitted])}
        banded = [flow for flow in frame.flows if flow.key in keys]
        # bands and experiments take it that the law, or a rival, is the fluid's
        following = next_measurement(
            chosen, rivals, frame.model.fluid, banded, following_options, learner_seed
        )
    own_bands = following.bands
    following = replace(following, bands=frame.bands(own_bands))
    explanation = hold_against_unseen(explanation, outcomes, flows, following.bands, expectation)
    if not explanation.in_library:
        following, own_bands = NextMeasurement(), {}
    outcomes = {name: _told(outcome, explanation) for name, outcome in outcomes.items()}
    classical = []
    bands, silent_records = following.bands, explanation.verdict == "no_signal"
    seen_in = frame.flows
    statements = make_statements(explanation, seen_in, rivals, structure, own_bands, normal)
    if not silent_records:
        statements = open_where_contested(statements, contested(outcomes, judged, bands))
        statements = open_where_dense_is_wide(statements, outcomes, judged)
        progress("the classical laws on the same runs", done / n_parts)
        # the criterion of the sparse law counts these, and both stand in one column
        independent = None if chosen is None else chosen.details.get("n_independent")
        if known.along is None:
            relaxes = study.model.known_relaxation
            classical = fit_classical_laws(model, flows, relaxes, independent)
        else:
            each = [
                known.frame_of(known.along.raw(known.along.classical[law].theta))
                for law in CLASSICAL
            ]
            classical = classical_along(known.along, each, flows, independent)
    if known.along is not None and known.along.moves_modes:
        statements = [replace(s, text=f"{s.text} {_MODES_NOT_IN_BANDS}") for s in statements]
    distillations = _distil(study, data, store, step("distillation"))
    progress("done", 1.0)
    return Comparison(
        name=study.name,
        data_summary=_summary(data, study)
        + (_TAKEN_OUT if known.along is None and known.effects else ""),
        known_part=_known_part(declared, known, study),
        flows=flows,
        before=known.alone(),
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
        known_of={name: known_equation(frame.model) for name, frame in frames.items()},
        known_effects=known.effects,
        conditions=material_and_temperature(data.dataset),
        stood_for=() if known.along is None else known.along.twins,
        explanation=explanation,
        classical=classical,
        warnings=() if silent_records else tuple(disagreements(outcomes, judged, bands)),
    )


def _settled(data: StudyData, relaxation_time: float) -> StudyData:
    """Return data in which what starts periodic has the cycles before it that learners wait for."""
    parts = {
        name: replace(
            part,
            runs=tuple(
                replace(run, protocol=settled(run.protocol, relaxation_time)) for run in part.runs
            ),
        )
        for name in ("dataset", "fit", "held_out")
        for part in [getattr(data, name)]
    }
    return replace(data, **parts)


def _at_rates(data: StudyData) -> StudyData:
    """Return data in which every run follows a rate in time, which is what the learners fit.

    What has none is refused among the runs to fit, and set aside among those that only judge.
    """
    if all(run.protocol.control == "rate" for run in (*data.fit, *data.held_out)):
        return data
    fit = replace(data.fit, runs=tuple(at_measured_rate(run) for run in data.fit))
    held, aside = [], dict(data.dataset.set_aside)
    for run in data.held_out:
        try:
            held.append(at_measured_rate(run))
        except InputError as error:
            aside[run.name] = str(error).removesuffix(".")
    held_out = replace(data.held_out, runs=tuple(held))
    return replace(
        data,
        dataset=replace(data.dataset, runs=(*fit.runs, *held), set_aside=aside),
        fit=fit,
        held_out=held_out,
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
    known: Known,
    seed: int,
    progress: Callable[[str, float], None],
    store: RunFolder | None,
    made: Mapping[str, tuple[LearnerResult, Fluid]] | None = None,
) -> LearnerOutcome:
    """Return what a learner finds, in the frame in which it works."""
    kept = None if store is None else store.load(part)
    if kept is not None and all(flow.key in kept["predictions"] for flow in known.flows):
        return LearnerOutcome.from_state(kept)
    progress("starting", 0.0)
    frame, constants = known.before, {}
    if made is not None:
        result, fluid = made[learner]
    elif known.along is not None:
        found = known.along.learn(
            lambda model, data, library: train(
                learner, study, model, data.fit.runs, seed, progress, library
            )
        )
        result, fluid, constants = _told_of_constants(found), found.fluid, found.constants
        frame = known.frame_of({one.name: one.raw for one in constants.values()})
    else:
        result, fluid = train(learner, study, frame.model, frame.data.fit.runs, seed, progress)
    flows = frame.flows
    outcome = replace(LearnerOutcome.of(result, fluid, flows), constants=constants)
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


_MODES_NOT_IN_BANDS = (
    "A factor on the modes was fitted along, and its interval is in no band of N1 or N2."
)
_TAKEN_OUT = ". What the known instrument did is taken out of the records"


def _summary(data: StudyData, study: Study) -> str:
    samples = sum(len(run) for run in data.fit)
    recorded = in_words(run.quantity for run in data.fit)
    fitted = len(data.fit)
    runs = f"{recorded} of {fitted} run{'' if fitted == 1 else 's'} ({samples} samples)"
    made = study.data.synthetic
    if made is None:
        kept = f"{data.dataset.left_out} {data.dataset.thinned}".strip().removesuffix(".")
        held = len(data.held_out)
        text = f"{runs} of {data.dataset.name}; {held} run{'' if held == 1 else 's'} held out"
        return f"{text}. {kept}" if kept else text
    law = LAWS[made.law].described(made.parameters)
    noise = f"{100 * made.noise:g} % noise" if made.noise else "no noise"
    return f"{runs} computed from the {law} law, {noise}"


def _known_part(declared: DeclaredModel, known: Known, study: Study) -> str:
    model = known.before.model
    text = _law_and_modes(model, study)
    of_law = [name for name in declared.free if name not in MODE_CONSTANTS]
    if of_law:
        text += f" ({', '.join(of_law)} fitted with this law alone, then held)"
    fixed = [effect.text for effect in known.effects if not effect.free]
    if fixed:
        text += f", {', '.join(fixed)}"
    if known.along is not None:
        names = ", ".join(map(in_words_of, known.along.positions))
        text += f"; fitted along with each learner: {names}"
    return f"{text}. {declared.source}".rstrip(" .") if declared.source else text


def _law_and_modes(model: DeclaredModel, study: Study) -> str:
    if not study.model.known_relaxation:
        return "upper convected Maxwell without its relaxation term (a purely elastic solid)"
    named = LAWS.get(model.law_name)
    title = model.law_name if named is None else named.described(model.parameters)
    modes = len(model.modulus)
    source = " from the linear sweep" if study.model.from_ is None else ""
    return title if modes == 1 else f"{title}, {modes} relaxation modes{source}"
