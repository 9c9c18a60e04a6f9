"""A comparison's data and known part in words."""

from discover.comparison.known_part import Frame
from discover.laws.registry import LAWS
from discover.protocols.kinematics import in_words
from discover.study.data import StudyData
from discover.study.declared_model import DeclaredModel
from discover.study.schema import Study


def data_in_words(data: StudyData, study: Study) -> str:
    """Return what is fitted of which data."""
    samples = sum(len(run) for run in data.fit)
    recorded = in_words(run.quantity for run in data.fit)
    # what is recorded beside σ12 is data of its own, and no other run
    fitted, held_out = (len({run.source for run in part}) for part in (data.fit, data.held_out))
    runs = f"{recorded} of {_runs(fitted)} ({samples} samples)"
    made = study.data.synthetic
    if made is None:
        kept = f"{data.dataset.left_out} {data.dataset.thinned}".strip().removesuffix(".")
        text = f"{runs} of {data.dataset.name}; {_runs(held_out)} held out"
        return f"{text}. {kept}" if kept else text
    law = LAWS[made.law].described(made.parameters)
    noise = f"{100 * made.noise:g} % noise" if made.noise else "no noise"
    return f"{runs} computed from the {law} law, {noise}"


def _runs(number: int) -> str:
    return f"{number} run{'' if number == 1 else 's'}"


def known_in_words(declared: DeclaredModel, frame: Frame, study: Study) -> str:
    """Return what was known before, and what was fitted with the likeliest hypothesis."""
    text = _law_and_modes(frame.model, study)
    if declared.free_constants:
        text += f" ({', '.join(declared.free_constants)} fitted)"
    if frame.effects:
        taken = ", ".join(effect.text for effect in frame.effects)
        text += f"; corrected for in the data: {taken}"
    return f"{text}. {declared.source}".rstrip(" .") if declared.source else text


def _law_and_modes(model: DeclaredModel, study: Study) -> str:
    if not study.model.known_relaxation:
        return "upper convected Maxwell without its relaxation term (a purely elastic solid)"
    named = LAWS.get(model.law_name)
    title = model.law_name if named is None else named.described(model.parameters)
    modes = len(model.modulus)
    source = " from the linear sweep" if study.model.from_ is None else ""
    text = title if modes == 1 else f"{title}, {modes} relaxation modes{source}"
    if model.solvent_viscosity:
        text += f", a solvent of {model.solvent_viscosity:.4g} Pa s"
    return f"{text}; {model.solid.rstrip('.')}" if model.solid else text
