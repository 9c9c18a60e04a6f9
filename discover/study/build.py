"""From a study to its data, its split and its declared fluid."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from discover.dataset import Dataset, LinearSweep
from discover.dataset.linear_viscoelasticity import RelaxationSpectrum, relaxation_spectrum
from discover.dataset.load import load_dataset
from discover.dataset.material_functions import TABLES
from discover.dataset.run import SLOWEST_RATE, Run, require_signal
from discover.effects import KnownEffect, known_effects
from discover.errors import InputError
from discover.forward import DeclaredModel as ForwardDeclared
from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.maxwell import UpperConvectedMaxwell
from discover.laws.multimode import Fluid
from discover.laws.registry import LAWS, make_law, starting_value
from discover.protocols.kinematics import MODULI
from discover.simulate.synthetic import SyntheticDataset, synthetic_dataset
from discover.study.from_result import EarlierResult, read_earlier
from discover.study.schema import Study

MODE_CONSTANTS = ("modulus_Pa", "relaxation_time_s")
"""Constants of the modes that may be left to be fitted."""


@dataclass(frozen=True)
class StudyData:
    """The data of a study, split.

    Attributes
    ----------
    dataset
        All runs.
    fit, held_out
        Runs that fits may see, and runs that only judge.
    each
        Whether every fitted run is also to be held out in turn.
    """

    dataset: Dataset
    fit: Dataset
    held_out: Dataset
    each: bool = False

    @property
    def truth(self) -> Fluid | None:
        """The fluid that made synthetic data, or None."""
        return self.dataset.truth if isinstance(self.dataset, SyntheticDataset) else None


@dataclass(frozen=True)
class DeclaredModel:
    """The declared law with starting values for what is to be fitted.

    Attributes
    ----------
    law
        The dimensionless law.
    law_name, parameters
        As declared, with numbers for those to be fitted.
    modulus, relaxation_time
        Of each mode, shape (k,), in Pa and s.
    free
        Names of the quantities to be fitted: parameters, ``modulus_Pa``, ``relaxation_time_s``.
    spectrum
        Where the modes come from, if from a linear sweep.
    solvent_viscosity
        In Pa s.
    effects
        Effects known beside the law, with values or to be fitted.
    source
        What was taken from an earlier result, in words; empty where nothing was.
    by_mode
        Parameters of the law, and effects, that may differ from mode to mode.
    choice
        Named laws to choose the law from; none where it is declared.
    """

    law: AbstractConstitutiveLaw
    law_name: str
    parameters: dict[str, float]
    modulus: np.ndarray
    relaxation_time: np.ndarray
    free: tuple[str, ...]
    spectrum: RelaxationSpectrum | None
    solvent_viscosity: float = 0.0
    effects: tuple[KnownEffect, ...] = ()
    source: str = ""
    by_mode: tuple[str, ...] = ()
    choice: tuple[str, ...] = ()

    @property
    def free_constants(self) -> tuple[str, ...]:
        """Names of all that is to be fitted, those of known effects included."""
        of_effects = (f"{known.name}.{name}" for known in self.effects for name in known.free)
        return (*self.free, *of_effects)

    @property
    def fluid(self) -> Fluid:
        """The declared fluid."""
        return Fluid(self.law, self.modulus, self.relaxation_time, self.solvent_viscosity)


def load_study_data(study: Study, seed: int | None = None) -> StudyData:
    """Return the data of a study, split into runs to fit and runs held out.

    Parameters
    ----------
    study
        The study.
    seed
        Overrides the seed of synthetic noise.

    Raises
    ------
    InputError
        If a file is wrong, a named run does not exist, or the runs to fit hold no signal.
    """
    data = study.data
    if data.synthetic is not None:
        made = data.synthetic
        dataset: Dataset = synthetic_dataset(
            made.law,
            made.parameters,
            made.protocol,
            made.noise,
            made.seed if seed is None else seed,
            made.samples,
        )
    else:
        base = None if study.path is None else study.path.parent
        dataset = load_dataset(
            str(data.folder),
            data.clock_factor,
            base,
            rate_is_measured=data.rate == "measured",
            rate_before=data.rate_before,
            sequence=data.sequence,
            amplitude_sweep_rad_s=data.amplitude_sweep_rad_s,
        )
    each = data.held_out == "each"
    named = () if data.held_out == "each" else data.held_out
    dataset, named, fit = _with_tables(dataset, study, named)
    if data.observe is not None:
        dataset, named, fit_names = _observed(dataset, data.observe, named, fit)
    else:
        fit_names = tuple(fit or (name for name in dataset.names if name not in named))
    held_out = dataset.select(named)
    if not len(dataset):
        raise InputError(
            f"The data set {dataset.name!r} has no run, and no table that could be fitted in place "
            "of one. Add runs.csv with one line a run, or one of "
            f"{', '.join(f'{kind}.csv' for kind in TABLES)} or lve.csv."
        )
    if not fit_names:
        raise InputError("Every run is held out; leave at least one run to fit.")
    if each and len(fit_names) < 2:
        raise InputError(
            f'held_out = "each" needs at least 2 runs, one to leave out and one to fit; got '
            f"{len(fit_names)}. Leave held_out out."
        )
    fit = dataset.select(fit_names)
    require_signal(fit.runs)
    return StudyData(dataset, fit, held_out, each)


def _with_tables(
    dataset: Dataset, study: Study, held_out: tuple[str, ...]
) -> tuple[Dataset, tuple[str, ...], tuple[str, ...] | None]:
    """Return the data with the tables beside the runs among them, those held out, and those fitted.

    A table judges, unless the study says that it is fitted or there is nothing else to fit.
    """
    data = study.data
    kinds = (*TABLES, "lve")
    asked = {kind: getattr(data, kind) for kind in kinds if getattr(data, kind) is not None}
    dataset.with_material_functions(list(asked))  # those that are not there are refused
    there = list(dataset.material_functions)
    # the linear sweep gives the modes, and is no judge unless it is asked for
    if "lve" in asked or (dataset.linear_sweep is not None and not there and not len(dataset)):
        there.append("lve")
    roles = {kind: asked.get(kind, "judge" if len(dataset) else "fit") for kind in there}
    if data.held_out == "each":
        # each run judges in turn, and nothing beside them
        roles = {kind: role for kind, role in roles.items() if role == "fit" or kind in asked}
    if not roles:
        return dataset, held_out, data.fit
    fitted, judging = (
        tuple(
            run.name
            for kind, role in roles.items()
            if role == wanted
            for run in replace(dataset, runs=()).with_material_functions([kind])
        )
        for wanted in ("fit", "judge")
    )
    fit = None if data.fit is None else (*data.fit, *(n for n in fitted if n not in data.fit))
    return dataset.with_material_functions(list(roles)), (*held_out, *judging), fit


def _observed(
    dataset: Dataset,
    observe: Sequence[str],
    held_out: Sequence[str],
    fit: Sequence[str] | None,
) -> tuple[Dataset, tuple[str, ...], tuple[str, ...]]:
    """Return the data with every quantity as a record, those held out, and those fitted.

    What is recorded and not observed only judges.
    """
    dataset.select([*held_out, *(fit or ())])  # names that do not exist are refused
    whole = dataset.quantity_by_quantity()
    missing = set(observe) - {run.quantity for run in whole}
    if missing:
        raise InputError(
            f"[data] observe names {sorted(missing)[0]}, which no run of {dataset.name!r} has. "
            f"Write some of {', '.join(sorted({run.quantity for run in whole}))}."
        )
    wanted = dataset.names if fit is None else fit
    by_name = {run.name: [] for run in dataset}
    for run in whole:
        by_name[run.name if run.quantity in MODULI else run.source].append(run)
    # both moduli of a sweep are fitted, unless one of them is named
    observed = set(observe) if set(observe) & set(MODULI) else {*observe, *MODULI}
    for name in fit or ():
        if not any(run.quantity in observed for run in by_name[name]):
            raise InputError(
                f"[data] fit names {name!r}, which recorded nothing that is in observe = "
                f"{list(observe)}. Leave the run out of fit, or add what it recorded to observe."
            )
    fitted = [
        run.name
        for name in wanted
        if name not in held_out
        for run in by_name[name]
        if run.quantity in observed
    ]
    judging = [
        run.name
        for name in (*held_out, *(name for name in wanted if name not in held_out))
        for run in by_name[name]
        if run.name not in fitted
    ]
    return whole, tuple(judging), tuple(fitted)


def declared_model(study: Study, dataset: Dataset) -> DeclaredModel:
    """Return the declared law of a study, with its modes.

    Raises
    ------
    InputError
        If a parameter is wrong, or modes are asked of data without a linear sweep.
    """
    model = study.model
    effects = known_effects(model.effects, "[model] effects")
    if model.from_ is not None:
        return _from_earlier(read_earlier(model.from_, study.path), effects)
    name = model.law if isinstance(model.law, str) and model.law in LAWS else "ucm"
    free = [key for key, value in model.parameters.items() if value == "fit"]
    parameters = {
        key: starting_value(name, key) if value == "fit" else float(value)
        for key, value in model.parameters.items()
    }
    if not model.known_relaxation and name != "ucm":
        raise InputError(
            "known_relaxation = false leaves the linear term to the learner, so the declared law "
            f"must be ucm; got {name}."
        )
    law = make_law(name, parameters)
    if not model.known_relaxation:
        law = UpperConvectedMaxwell(linear_relaxation=False)
    spectrum = None
    if model.modes == "lve":
        if dataset.linear_sweep is None:
            raise InputError(
                f'modes = "lve" needs a linear sweep, but {dataset.name!r} has no lve.csv. Give '
                "modulus_Pa and relaxation_time_s, or add the file."
            )
        spectrum = relaxation_spectrum(_usable(dataset.linear_sweep, model.sweep_rad_s))
        modulus, relaxation_time = spectrum.modulus, spectrum.relaxation_time
    else:
        start = _linear_start(dataset)
        modulus, relaxation_time = (
            np.array([start[key] if value == "fit" else float(value)])
            for key, value in (
                ("modulus_Pa", model.modulus_Pa),
                ("relaxation_time_s", model.relaxation_time_s),
            )
        )
    # beside a sweep: another loading, or an aged sample; one factor on all moduli, or on all times
    free += [key for key in MODE_CONSTANTS if getattr(model, key) == "fit"]
    return DeclaredModel(
        law,
        name,
        parameters,
        modulus,
        relaxation_time,
        tuple(free),
        spectrum,
        model.solvent_viscosity_Pa_s,
        effects,
        by_mode=model.by_mode,
        choice=model.choice,
    )


def forward_model(declared: DeclaredModel) -> ForwardDeclared:
    """Return a study's declared model as forward models take it, with all that is to be fitted."""
    spectrum = declared.spectrum
    modes = declared.modulus, declared.relaxation_time
    options = {
        "solvent_viscosity": declared.solvent_viscosity,
        "linear_error": 0.0 if spectrum is None else spectrum.relative_error,
        "effects": declared.effects,
        "by_mode": declared.by_mode,
    }
    if declared.law.linear_relaxation and declared.law_name in LAWS:
        named = declared.law_name, declared.parameters
        return ForwardDeclared.named(*named, *modes, free=declared.free, **options)
    return ForwardDeclared(
        declared.law,
        *modes,
        fit_modulus="modulus_Pa" in declared.free,
        fit_relaxation_time="relaxation_time_s" in declared.free,
        **options,
    )


FOUND_LAW = "a law found before"
"""Name of a law that was taken from a result."""


def _from_earlier(found: EarlierResult, own: Sequence[KnownEffect]) -> DeclaredModel:
    """Return what a result found as declared; effects of the study stand in place of its own."""
    equation = found.equation
    names = {known.name for known in own}
    kept = (known for known in found.effects if known.name not in names)
    law, name, constants = equation.law(), FOUND_LAW, {}
    if not equation.terms and equation.named is None:
        law, name = UpperConvectedMaxwell(equation.linear_relaxation), "ucm"
    elif equation.named is not None and not equation.terms:
        name, constants = equation.named.law, dict(equation.named.constants[0])
    return DeclaredModel(
        law,
        name,
        constants,
        np.array(equation.modulus),
        np.array(equation.relaxation_time),
        (),
        None,
        equation.solvent_viscosity,
        (*kept, *own),
        found.text,
    )


def _usable(sweep: LinearSweep, window: tuple[float, float] | None) -> LinearSweep:
    """Return the frequencies of a sweep that the study lets count."""
    if window is None:
        return sweep
    omega = sweep.angular_frequency
    keep = (omega >= window[0]) & (omega <= window[1])
    if np.count_nonzero(keep) < 2:
        raise InputError(
            f"lve.csv has {np.count_nonzero(keep)} frequencies from {window[0]:g} to "
            f"{window[1]:g} rad/s; at least 2 are needed, and it goes from {omega.min():g} to "
            f"{omega.max():g}. Widen [model] sweep_rad_s."
        )
    return LinearSweep(omega[keep], sweep.storage_modulus[keep], sweep.loss_modulus[keep])


def _linear_start(dataset: Dataset) -> dict[str, float]:
    """Return a modulus and relaxation time of the right order from the runs themselves.

    The relaxation time is that of the slowest change a run can show, a tenth of the median
    duration, or the inverse of a flow curve's middle rate or a sweep's middle frequency; the
    modulus follows from the largest stress over rate times that.
    """

    def slowest(run: Run) -> float:
        if run.protocol.control == "oscillation":
            return 1.0 / float(np.median(run.angular_frequency))
        if run.protocol.control == "steady":
            return 1.0 / max(float(np.median(np.abs(run.rate))), SLOWEST_RATE)
        return 0.1 * float(run.time[-1])

    times = [slowest(run) for run in dataset]
    time = float(np.median(times))
    viscosities = [
        np.max(np.abs(run.stress)) / np.max(np.abs(run.rate))
        for run in dataset
        if np.max(np.abs(run.rate)) > SLOWEST_RATE and np.any(run.stress)
    ]
    moduli = [
        float(np.max(np.abs(run.stress)) / np.max(np.abs(run.strain)))
        for run in dataset
        if run.strain is not None and np.any(run.strain)
    ]
    if viscosities or not moduli:
        modulus = float(np.median(viscosities or [1.0])) / max(time, 1e-300)
    else:
        modulus = float(np.median(moduli))
    return {"modulus_Pa": modulus, "relaxation_time_s": time}
