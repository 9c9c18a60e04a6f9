"""From a study to its declared fluid."""

import warnings
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np

from discover.dataset import Dataset, LinearSweep, RelaxationSpectrum, relaxation_spectrum
from discover.dataset.run import SLOWEST_RATE, Run
from discover.effects import ConstitutiveEffect, KnownEffect, known_effects
from discover.equations import AugmentedLaw, Equation
from discover.errors import InputError
from discover.forward import DeclaredModel
from discover.laws import AbstractConstitutiveLaw, Fluid, UpperConvectedMaxwell
from discover.laws.each_mode import law_of_each_mode
from discover.laws.registry import LAWS, make_law, starting_value
from discover.study.from_result import EarlierResult, read_earlier
from discover.study.schema import Model, Study
from discover.words import counted, percent_of

# Longest runs, and slowest modes, within which a declared elastic constant does not relax
_UNRELAXED = 1e3

MODE_CONSTANTS = ("modulus_Pa", "relaxation_time_s")
"""Constants of the modes that may be left to be fitted."""


@dataclass(frozen=True)
class StudyModel:
    """The declared law with starting values for what is to be fitted."""

    law: AbstractConstitutiveLaw  # the dimensionless law
    law_name: str
    parameters: dict[str, float]  # with numbers for those to be fitted
    modulus: np.ndarray  # of each mode in Pa, shape (k,)
    relaxation_time: np.ndarray  # of each mode in s, shape (k,)
    free: tuple[str, ...]  # to be fitted: parameters, ``modulus_Pa``, ``relaxation_time_s``
    spectrum: RelaxationSpectrum | None  # where the modes come from, if from a linear sweep
    solvent_viscosity: float = 0.0  # in Pa s
    effects: tuple[KnownEffect, ...] = ()
    source: str = ""  # what was taken from an earlier result, in words; empty where nothing was
    by_mode: tuple[str, ...] = ()  # parameters and effects that may differ from mode to mode
    choice: tuple[str, ...] = ()  # named laws to choose the law from; none where it is declared
    solid: str = ""  # what is to be known of an elastic constant among the modes

    @property
    def modes_in_words(self) -> str:
        """Relaxation modes and solvent, and where they come from."""
        text = counted(len(self.modulus), "relaxation mode")
        if self.solvent_viscosity:
            text += f" and a solvent of {self.solvent_viscosity:.4g} Pa s"
        if self.spectrum is not None:
            text += f" from the linear sweep (error {percent_of(self.spectrum.relative_error)})"
        return f"{text}; {self.solid.rstrip('.')}" if self.solid else text

    @property
    def free_constants(self) -> tuple[str, ...]:
        """Names of all that is to be fitted, those of known effects included."""
        of_effects = (f"{known.name}.{name}" for known in self.effects for name in known.free)
        return (*self.free, *of_effects)

    @property
    def modulus_covariance(self) -> np.ndarray | None:
        """Of the moduli in Pa², and of a solvent behind them; None without a sweep."""
        spectrum = self.spectrum
        if spectrum is None or spectrum.modulus_covariance is None:
            return None
        if spectrum.modulus.shape != self.modulus.shape:
            return None
        factor = self.modulus / spectrum.modulus  # a gain that was fitted, or another loading
        if len(spectrum.modulus_covariance) > len(factor):
            factor = np.append(factor, self.solvent_viscosity / spectrum.solvent_viscosity)
        return spectrum.modulus_covariance * np.outer(factor, factor)

    @property
    def described(self) -> str:
        """The law with its constants, in words; its name where that is none of a law's."""
        named = LAWS.get(self.law_name)
        return self.law_name if named is None else named.described(self.parameters)

    @property
    def fluid(self) -> Fluid:
        """The declared fluid."""
        return Fluid(self.law, self.modulus, self.relaxation_time, self.solvent_viscosity)


def declared_model(study: Study, dataset: Dataset) -> StudyModel:
    """Return the declared law of a study, with its modes; InputError if something is wrong."""
    model, is_computed = study.model, study.data.synthetic is not None
    # what nobody declares is one of computed data, and of others the sweep's or fitted
    given = [getattr(model, key) for key in MODE_CONSTANTS]
    undeclared = given == [None, None] and model.elastic_modulus_Pa is None
    if undeclared and not is_computed and dataset.linear_sweep is not None:
        model = model.model_copy(update={"modes": model.modes or "lve"})
    elif model.modes is None:
        given = [one or (1.0 if is_computed else "fit") for one in given]
    effects = known_effects(model.effects, "[model] effects")
    if model.from_ is not None:
        earlier = read_earlier(model.from_, study.path)
        sweep, found = dataset.linear_sweep, earlier.equation
        usable = None if sweep is None else _usable(sweep, model.sweep_rad_s)
        times = np.array(found.relaxation_time)
        spectrum = spectrum_of_modes(usable, found.solvent_viscosity, times)
        return _from_earlier(earlier, effects, spectrum)
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
    spectrum, solvent, solid = None, model.solvent_viscosity_Pa_s, ""
    if model.modes is not None:
        spectrum = _of_sweep(model, dataset)
        modulus, relaxation_time = spectrum.modulus, spectrum.relaxation_time
        solvent, solid = spectrum.solvent_viscosity, spectrum.solid
    else:
        start = linear_start(dataset.runs)
        modulus, relaxation_time = (
            np.atleast_1d(np.asarray(first if value == "fit" else value, dtype=float))
            for value, first in zip(given, start, strict=True)
        )
        if model.elastic_modulus_Pa:
            timed = (run for run in dataset if run.protocol.control in ("rate", "stress"))
            longest = max((float(run.time[-1]) for run in timed), default=1.0)
            still = _UNRELAXED * max(longest, float(np.max(relaxation_time)))
            solid = (
                f"the material is a solid, with an elastic constant of {model.elastic_modulus_Pa:g}"
                f" Pa. A law of a fluid holds it as a mode of {still:.3g} s: do not use what it "
                "says of steady flow, or of times as long."
            )
            modulus = np.append(modulus, model.elastic_modulus_Pa)
            relaxation_time = np.append(relaxation_time, still)
        if solvent == "fit":
            effects = (*effects, *known_effects({"solvent_viscosity": "fit"}, "[model]"))
            solvent = 0.0
    if solid:
        warnings.warn(f"Declared model: {solid}", stacklevel=2)
    # beside a sweep: another loading, or an aged sample; one factor on all moduli, or on all times
    free += [key for key, value in zip(MODE_CONSTANTS, given, strict=True) if value == "fit"]
    modes = modulus, relaxation_time, tuple(free), spectrum, float(solvent or 0.0)
    also = {"by_mode": model.by_mode, "choice": model.choice, "solid": solid}
    return StudyModel(law, name, parameters, *modes, effects, **also)


def forward_model(declared: StudyModel) -> DeclaredModel:
    """Return a study's declared model as forward models take it, with all that is to be fitted."""
    spectrum = declared.spectrum
    modes = declared.modulus, declared.relaxation_time
    options = {
        "solvent_viscosity": declared.solvent_viscosity,
        "linear_error": 0.0 if spectrum is None else spectrum.relative_error,
        "modulus_covariance": declared.modulus_covariance,
        "effects": declared.effects,
        "by_mode": declared.by_mode,
    }
    if declared.law.linear_relaxation and declared.law_name in LAWS:
        named = declared.law_name, declared.parameters
        return DeclaredModel.named(*named, *modes, free=declared.free, **options)
    return DeclaredModel(
        declared.law, *modes, fit_modulus="modulus_Pa" in declared.free,
        fit_relaxation_time="relaxation_time_s" in declared.free, **options,
    )  # fmt: skip


def _of_sweep(model: Model, dataset: Dataset) -> RelaxationSpectrum:
    """Return the spectrum that a study asks of the linear sweep."""
    if dataset.linear_sweep is None:
        raise InputError(
            f"modes = {model.modes!r} needs a linear sweep, but {dataset.name!r} has no lve.csv. "
            "Give modulus_Pa and relaxation_time_s, or add the file."
        )
    spectrum = relaxation_spectrum(
        _usable(dataset.linear_sweep, model.sweep_rad_s),
        modes=None if model.modes == "lve" else model.modes,
        solvent_viscosity=model.solvent_viscosity_Pa_s,
        elastic_modulus=model.elastic_modulus_Pa,
    )
    if model.modes != "lve" and len(spectrum) != model.modes:
        raise InputError(
            f"The sweep supports {counted(len(spectrum), 'mode')}, and modes = {model.modes} asks "
            'for that many exactly. Write fewer, or modes = "lve".'
        )
    return spectrum


FOUND_LAW = "a law found before"
"""Name of a law that was taken from a result."""


def _from_earlier(
    found: EarlierResult, own: Sequence[KnownEffect], spectrum: RelaxationSpectrum | None
) -> StudyModel:
    """Return what a result found as declared; effects of the study stand in place of its own."""
    equation = found.equation
    names = {known.name for known in own}
    kept = (known for known in found.effects if known.name not in names)
    of_modes = [of for of in found.of_modes if of[0].name not in names]
    name, constants = FOUND_LAW, {}
    if of_modes or (equation.named is not None and equation.named.differing):
        law = _law_of_each_mode(equation, of_modes)
    elif not equation.terms and equation.named is None:
        law, name = UpperConvectedMaxwell(equation.linear_relaxation), "ucm"
    else:
        law = equation.law()
        if equation.named is not None and not equation.terms:
            name, constants = equation.named.law, dict(equation.named.constants[0])
    modes = np.array(equation.modulus), np.array(equation.relaxation_time)
    rest = spectrum, equation.solvent_viscosity, (*kept, *own), found.told(names)
    return StudyModel(law, name, constants, *modes, (), *rest)


def _law_of_each_mode(
    equation: Equation, added: Sequence[Sequence[KnownEffect]]
) -> AbstractConstitutiveLaw:
    """Return the law of every mode, with constants of its own."""
    laws = []
    for number in range(len(equation.modulus)):
        base = equation.mode(number).law()
        effects = [
            (one.effect, [float(value) for value in one.values if value is not None])
            for one in (of[number] for of in added)
        ]
        whole = AugmentedLaw(
            base=base,
            values=tuple(jnp.asarray(values) for _, values in effects),
            effects=tuple(one for one, _ in effects if isinstance(one, ConstitutiveEffect)),
            linear_relaxation=base.linear_relaxation,
        )
        laws.append(whole if effects else base)
    return law_of_each_mode(laws)


# Relative difference of relaxation times that were written to a file and read again
_SAME_MODES = 1e-6


def spectrum_of_modes(
    sweep: LinearSweep | None, solvent: float, times: np.ndarray, modulus: np.ndarray | None = None
) -> RelaxationSpectrum | None:
    """Return the spectrum of a sweep that has these modes, whose errors it knows; None if none has.

    `solvent` in Pa s, `times` in s, `modulus` in Pa, shape (k,); one factor on all is allowed.
    """
    asked: tuple[dict[str, Any], ...]
    asked = ({}, {"solvent_viscosity": solvent}, {"modes": len(times)})
    if sweep is None:
        return None
    for options in asked:
        with suppress(InputError):  # too short a sweep, of which the modes are not then
            found = relaxation_spectrum(sweep, **options)
            if found.relaxation_time.shape != times.shape:
                continue
            factor = times / found.relaxation_time
            same = modulus is None or np.array_equal(found.modulus, modulus)
            if same and np.ptp(factor) <= _SAME_MODES * np.max(factor):
                return found
    return None


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


def linear_start(runs: Sequence[Run]) -> tuple[float, float]:
    """Return a modulus in Pa and a relaxation time in s of the right order from the runs.

    A tenth of the median duration, or an inverse middle rate; the largest stress over rate, or of a
    flow curve a middle viscosity, over that.
    """

    def slowest(run: Run) -> float:
        if run.protocol.control == "oscillation":
            return 1.0 / float(np.median(run.angular_frequency))
        if run.protocol.control == "steady":
            return 1.0 / max(float(np.median(np.abs(run.rate))), SLOWEST_RATE)
        return 0.1 * float(run.time[-1])

    time = float(np.median([slowest(run) for run in runs] or [1.0]))
    # of a flow curve a middle viscosity: that of the fastest rate is far from the slow ones
    middle = {True: np.median, False: np.max}
    stressed = [(run, middle[run.protocol.control == "steady"]) for run in runs if run.stress.any()]
    pairs = [(typical(np.abs(run.stress)), typical(np.abs(run.rate))) for run, typical in stressed]
    viscosities = [stress / rate for stress, rate in pairs if rate > SLOWEST_RATE]
    moduli = [
        float(np.max(np.abs(run.stress)) / np.max(np.abs(run.strain)))
        for run in runs
        if run.strain is not None and np.any(run.strain)
    ]
    if viscosities or not moduli:
        return float(np.median(viscosities or [1.0])) / max(time, 1e-300), time
    return float(np.median(moduli)), time
