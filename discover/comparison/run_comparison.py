"""Comparison of a study, part by part, so that a run that was stopped can go on."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from discover.comparison.classical import fit_classical_laws
from discover.comparison.comparison import Comparison
from discover.comparison.flows import (
    DRAWN,
    Flow,
    FlowBand,
    comparison_flows,
    prepared,
    require_one_known_law,
    thinned_to,
    true_terms,
    with_each_run,
    without_spikes_in_fit,
)
from discover.comparison.hypotheses import (
    MOST_EFFECTS,
    flow_bands,
    search_hypotheses,
    terms_of,
    with_proposals,
)
from discover.comparison.known_part import Frame, known_part
from discover.comparison.learning import Learning, study_library
from discover.comparison.rivals import Rival, exact_twins, other_possible_laws
from discover.comparison.statements import Statement, known_equation, make_statements
from discover.dataset import Dataset
from discover.dataset.run_table import material_and_temperature
from discover.identify import Structure, analyse_structure
from discover.laws import LAWS, Fluid
from discover.learners.results import LearnerResult
from discover.learners.settings import waiting
from discover.loop.loop import SearchOutcome, titled
from discover.loop.loop_result import LoopResult
from discover.loop.search_time import ComparisonTime, SearchTime
from discover.processor import in_one_thread
from discover.progress import Progress, silent
from discover.protocols.kinematics import in_words
from discover.study.data import StudyData, load_study_data
from discover.study.declared_model import StudyModel, declared_model
from discover.study.run_folder import RunFolder
from discover.study.schema import Study
from discover.words import counted
from tensor_library import LawTerm, TermLibrary


def data_in_words(data: StudyData, study: Study) -> str:
    """Return what is fitted of which data."""
    samples = sum(len(run) for run in data.fit)
    recorded = in_words(run.quantity for run in data.fit)
    # what is recorded in addition to σ12 is data of its own, and no other run
    fitted, held_out = (
        counted(len({run.source for run in part}), "run") for part in (data.fit, data.held_out)
    )
    runs = f"{recorded} of {fitted} ({samples} samples)"
    made = study.data.synthetic
    if made is None:
        kept = f"{data.dataset.left_out} {data.dataset.thinned}".strip().removesuffix(".")
        text = f"{runs} of {data.dataset.name}; {held_out} held out"
        return f"{text}. {kept}" if kept else text
    law = LAWS[made.law].described(made.parameters)
    noise = f"{100 * made.noise:g} % noise" if made.noise else "no noise"
    return f"{runs} computed from the {law} law, {noise}"


def known_in_words(declared: StudyModel, frame: Frame, study: Study) -> str:
    """Return what was known before, and what was fitted with the likeliest hypothesis."""
    text = f"{frame.model.described}, {frame.model.modes_in_words}"
    if not study.model.known_relaxation:
        text = "upper-convected Maxwell without its relaxation term (a purely elastic solid)"
    if declared.free_constants:
        text += f" ({', '.join(declared.free_constants)} fitted)"
    if frame.effects:
        taken = ", ".join(effect.text for effect in frame.effects)
        text += f"; corrected for in the data: {taken}"
    return f"{text}. {declared.source}".rstrip(" .") if declared.source else text


_NO_LAW = "The data hold no signal, so no law was identified"


@in_one_thread
def compare(
    study: Study, seed: int | None = None, progress: Progress = silent,
    store: RunFolder | None = None, *, data: StudyData | None = None,
    declared: StudyModel | None = None,
    made: Mapping[str, tuple[LearnerResult, Fluid]] | None = None,
    library: TermLibrary | None = None,
) -> Comparison:  # fmt: skip
    """Run a study's learners on identical data, and weigh what each found with a search's findings.

    The posterior over laws, effects and terms comes first; its likeliest hypothesis fixes what is
    declared as fitted, and what it holds of the instrument is taken out of the records, so that
    learners learn the fluid. Then each learner's law is a hypothesis too.

    `seed`: overrides the study's seeds. `store`: where finished learners are kept. `data`,
    `declared`: in place of the study's. `made`: results of fitted learners; `library`: the terms
    that they searched. Raises InputError if the study asks for something that its data cannot give.
    """
    options = study.compare
    data = prepared(load_study_data(study, seed) if data is None else data)
    of_spikes = ""
    if made is None:  # estimators that are fitted already saw every sample
        data, of_spikes = without_spikes_in_fit(data)
        data = thinned_to(data, options.most_samples)
    declared = declared_model(study, data.dataset) if declared is None else declared
    require_one_known_law(declared)
    # a periodic start has the cycles before it that learners wait for
    longest, relaxes = float(max(declared.relaxation_time)), declared.law.linear_relaxation
    data = with_each_run(data, lambda run: waiting(run, longest, relaxes))
    pipkin = list(itertools.product(options.next.weissenberg_numbers, options.next.deborah_numbers))
    library = study_library(study) if library is None else library
    learning = Learning(study, options.seed if seed is None else seed, store, made)

    several, held_out = len(declared.modulus) > 1, len(data.held_out) > 0
    searches = SearchTime(MOST_EFFECTS, several, held_out=held_out, reported=False)
    times = ComparisonTime(progress, searches)
    progress("searching among laws, effects and terms", 0.0)
    found = search_hypotheses(study, data, declared, library, times.searching)
    simple = found.material() if made is None else None
    if simple is not None:
        progress("done", 1.0)
        return _of_material(simple, study, data, declared, learning.seed)
    frame = known_part(declared, found.ended(), data, options.high_deborah, pipkin)
    times.learning()
    own = learning.outcomes(options.learners, frame, times.learned)
    times.weighing("weighing what was found")
    outcomes = {name: frame.outcome(outcome) for name, outcome in own.items()}
    found, proposed = with_proposals(found, {name: one.terms for name, one in outcomes.items()})
    found = found.with_curves()
    outcomes = {name: replace(one, terms=proposed[name].terms) for name, one in outcomes.items()}
    made_of, truth = study.data.synthetic, None
    if made_of is not None and declared.law_name == "ucm":
        truth = true_terms(made_of.law, made_of.parameters, study.model.known_relaxation)
    if found.ended().verdict == "no_signal":
        outcomes = {
            name: replace(
                one, terms=(), message=_NO_LAW, details={},
                left=one.left and replace(one.left, verdict="no_signal"),
            )
            for name, one in outcomes.items()
        }  # fmt: skip
    comparison = Comparison(
        name=study.name,
        data_summary=f"{data_in_words(data, study)}{f'. {of_spikes}' if of_spikes else ''}",
        known_part=known_in_words(declared, frame, study),
        flows=frame.flows,
        before=frame.of_declared(declared, found.ended()),
        outcomes=outcomes,
        posterior=titled(found.result(), study, data),
        shares={name: one.share for name, one in proposed.items()},
        truth=truth,
        noise=None if made_of is None else made_of.noise,
        seed=learning.seed,
        known=known_equation(frame.model),
        known_effects=frame.effects,
        conditions=material_and_temperature(
            data.dataset, study.data.material, data.dataset.name
        ),
    )  # fmt: skip
    comparison = _with_what_is_open(comparison, found, frame, data, study, library)
    progress("done", 1.0)
    return comparison


def _of_material(
    simple: LoopResult, study: Study, data: StudyData, declared: StudyModel, seed: int
) -> Comparison:
    """Return the comparison for a yield stress, a viscous fluid or a solid: no learner is asked."""
    assert simple.material is not None
    data = replace(data, dataset=Dataset(data.dataset.name, (*data.fit, *data.held_out)))
    flows = comparison_flows(data, ())
    records = {record.name: record for record in simple.records}

    def column(flow: Flow, values: np.ndarray) -> dict[str, np.ndarray]:
        unknown = np.full(len(values), np.nan)
        return {"sigma12": values, "N1": unknown, "N2": unknown}

    before = {flow.key: column(flow, records[flow.name].predicted[0]) for flow in flows}
    bands = {}
    for flow in flows:
        middle = column(flow, records[flow.name].predicted[1])
        bands[flow.key] = FlowBand(middle, middle, middle).limited_to(())
    why = f"A {simple.material.title} has no law for it, and it was not measured."
    return Comparison(
        name=study.name, data_summary=data_in_words(data, study),
        known_part=known_in_words(declared, Frame(declared, data, flows), study),
        flows=flows, before=before, outcomes={},
        posterior=titled(simple, study, data), bands=bands,
        statements=[Statement(quantity, "no", why) for quantity in ("N1", "N2")], seed=seed,
        conditions=material_and_temperature(
            data.dataset, study.data.material, data.dataset.name
        ),
    )  # fmt: skip


def _structure(
    terms: Sequence[LawTerm], frame: Frame, library: TermLibrary, use_normal_stresses: bool
) -> Structure | None:
    """Return what shear determines at a law, or at the known part where that law diverges."""
    runs, known = frame.data.fit.runs, frame.model.fluid
    if not any(run.flow == "shear" for run in runs):
        return None
    found = analyse_structure(runs, library, terms, known, use_normal_stresses)
    return found or analyse_structure(runs, library, (), known, use_normal_stresses)


def _with_what_is_open(
    comparison: Comparison, found: SearchOutcome, frame: Frame, data: StudyData, study: Study,
    library: TermLibrary,
) -> Comparison:  # fmt: skip
    """Return a comparison with bands, classical laws, rivals, and what is determined."""
    if comparison.verdict == "no_signal":
        statements = make_statements("no_signal", frame.flows, {}, None, {})
        return replace(comparison, statements=statements)
    runs = {run.name: run for run in data.dataset}
    drawn = [flow for flow in frame.flows if flow.kind in DRAWN]
    bands = flow_bands(found, drawn, runs)
    best = found.posterior.fits[0][0] if found.posterior.fits else None
    terms = None if best is None else terms_of(best, found)
    if terms is None:
        sparse = comparison.outcomes.get("tensor_sindy")
        terms = () if sparse is None else tuple(term.in_law for term in sparse.terms)
    structure = _structure(terms, frame, library, study.compare.use_normal_stresses)
    twins: list[Rival] = []
    if comparison.verdict == "explained":
        twins = exact_twins(terms, frame.model, drawn, library)
    others = other_possible_laws(found, drawn, runs)
    spread = comparison.posterior.spread_of_laws
    statements = make_statements(
        comparison.verdict, frame.flows, bands, structure,
        {name: one.inside for name, one in spread.items()}, study.compare.use_normal_stresses,
        len(terms),
    )  # fmt: skip
    return replace(
        comparison, bands=bands, classical=fit_classical_laws(found, frame, study.compare.laws),
        rivals=(*twins, *others), statements=statements, structure=structure,
    )  # fmt: skip
