"""Doubts about sweeps by themselves, and about runs held against linear viscoelasticity."""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.stats import chi2

from discover.dataset.checking.runs import (
    Finding,
    is_start_up,
    note,
    steady_stress,
    stress_noise,
    warning,
)
from discover.dataset.linear.mode_search import BEYOND, relative_moduli, solved
from discover.dataset.linear_viscoelasticity import LinearSweep, RelaxationSpectrum
from discover.dataset.load import SWEEP_FILE
from discover.dataset.run import LARGEST, Run
from discover.statistics import HALF_BAND
from discover.statistics.noise.noise_model import rms
from discover.words import percent_of

# A sweep begins where the fluid is linear; above this amplitude no edge stays whole for many cycles
_LARGEST_FIRST, _LARGEST_STRAIN = 0.5, 30.0
# A small strain, and by how much G* there may differ from that of the linear sweep: another loading
_SMALL, _APART = 0.1, 0.2
_POINTS_PER_MODE = 1.5  # modes enough for any sweep of so many points; more would only fit noise
# Where every fluid is still linear, to a few per cent: damping functions are 0.98 and more there
_LINEAR_STRAIN = 0.2
# What gap, loading and temperature leave open between two instruments' stresses
_STRESS_TOLERANCE = 0.15
# What they leave open where nothing is wrong with either: 1 % of the radius of the filling is 3 %
# of the torque, 1 K some 3 % of a melt's viscosity, 10 µm some 1 % of a gap
_SHARED_TOLERANCE = 0.07
# Less than 1 % of the radius is worth no word; between the two a gain is noted and not doubted
_NOTED_GAIN = 0.03
# Of a gain: samples of a run, change of the ratio within it, and runs whose scatter is known
_FEWEST_RATIOS, _STEADY_RATIO, _FEWEST_GAINS = 5, 0.05, 3
_CLEAR_OF_ZERO = 0.3  # where the stress passes through zero its ratio says nothing
# Of gains that differ: what a law that thins leaves of linear theory at small strain, and chance
_STILL_LINEAR, _UNLIKELY = 0.01, 1e-3
# Well below a Weissenberg number of one the Cox–Merz rule holds to some ten per cent for simple
# fluids; above it laws differ, and it is theirs to say. A Maxwell fluid is off by 1.3 at 0.83
_COX_MERZ_FACTOR, _COX_MERZ_RATE = 1.3, 0.8
_SWEEP_TOLERANCE = 0.05
# Inertia may make this share of the modulus before a frequency is not to be used
_INERTIA_SHARE, _FEWEST_FOR_INERTIA = 0.01, 6
_VISIBLE_MISFIT = 0.02  # a sweep that modes describe better than this is as good as sweeps are
_STRONG_EVIDENCE = 6.0  # [Kass & Raftery 1995, JASA 90, 773]

Values = Float[np.ndarray, " n"]


def doubts_of_amplitude_sweep(run: Run, linear: LinearSweep | None) -> Iterator[Finding]:
    """Yield what is doubtful in an amplitude sweep."""
    strain, storage, loss = run.strain, run.storage_modulus, run.loss_modulus
    if strain is None or storage is None or loss is None:
        return
    low, high = float(np.min(strain)), float(np.max(strain))
    if low > _LARGEST_FIRST and high > _LARGEST_STRAIN:
        text = (
            f"The strain in {run.name} goes from {low:.3g} to {high:.3g}. If that is in per cent, "
            "rename the column to strain_percent."
        )
        yield warning("units", run.name, text)
    for name, values in (("G′", storage), ("G″", loss)):
        if np.any(values <= 0.0):
            text = (
                f"{np.count_nonzero(values <= 0.0)} values of {name} in {run.name} are not "
                "positive, as those of a passive fluid are: they are noise, or the phase is wrong."
            )
            yield warning("sign", run.name, text)
    if linear is None:
        return
    omega, known = run.angular_frequency, linear.angular_frequency
    small = (omega >= known[0]) & (omega <= known[-1]) & (strain <= _SMALL)
    if not np.any(small):
        return
    expected = magnitude_at(linear, omega[small])
    factor = float(np.median(np.hypot(storage[small], loss[small]) / expected))
    if abs(np.log(factor)) > _APART:
        text = (
            f"At strains up to {_SMALL:g} the modulus in {run.name} is {factor:.2g} times that of "
            "lve.csv at the same frequency: another loading, another unit, or no linear range."
        )
        yield warning("sweep", run.name, text)


def magnitude_at(sweep: LinearSweep, frequency):
    """Return |G*| in Pa at frequencies in rad/s, on straight lines between those of a sweep."""
    known, size = np.log(sweep.angular_frequency), np.hypot(sweep.storage_modulus,
                                                            sweep.loss_modulus)  # fmt: skip
    return np.exp(np.interp(np.log(frequency), known, np.log(size)))


def doubts_of_sweep(sweep: LinearSweep, spectrum: RelaxationSpectrum) -> Iterator[Finding]:
    """Doubts about a linear sweep; that modes fit G′ and G″ stands for Kramers–Kronig."""
    inertia = _inertia(sweep)
    repeated = len(np.unique(sweep.angular_frequency)) < len(sweep.angular_frequency)
    if spectrum.best_error > _SWEEP_TOLERANCE:
        text = (
            f"No sum of Maxwell modes, a solvent and an elastic constant fits {SWEEP_FILE} better "
            f"than {100 * spectrum.best_error:.0f} %: G' and G'' contradict each other. Inertia of "
            "the instrument at high frequency, a shift of one column, or too large an amplitude do "
            "that."
        )
        yield warning("sweep", SWEEP_FILE, text)
    if sweep.thinned:
        yield note("samples", SWEEP_FILE, f"{SWEEP_FILE}: {sweep.thinned}.")
    if inertia:
        yield warning("sweep", SWEEP_FILE, inertia)
    if spectrum.solid:
        yield note("sweep", SWEEP_FILE, f"{SWEEP_FILE}: {spectrum.solid}")
    if repeated:
        text = f"{SWEEP_FILE} holds some frequencies more than once."
        yield note("sweep", SWEEP_FILE, text)


def _inertia(sweep: LinearSweep) -> str:
    """Say where G' bends at high frequency as only a wrong inertia correction makes it."""
    omega, size = sweep.angular_frequency, np.hypot(sweep.storage_modulus, sweep.loss_modulus)
    if len(omega) < _FEWEST_FOR_INERTIA:
        return ""
    found = sweep_inertia(sweep)
    share = np.abs(found.inertia) * omega**2 / size
    seen = found.evidence >= _STRONG_EVIDENCE and found.error_before >= _VISIBLE_MISFIT
    if not seen or np.max(share) < _SWEEP_TOLERANCE:
        return ""
    usable = omega[share < _INERTIA_SHARE]
    remedy = (
        f'Give the study [model] modes = "lve" and sweep_rad_s = [{omega[0]:.4g}, '
        f"{np.max(usable):.4g}], or correct the inertia."
        if usable.size
        else "Correct the inertia."
    )
    return (
        f"G' in {SWEEP_FILE} holds {-found.inertia:.3g} Pa s2 "
        f"(± {HALF_BAND * found.deviation:.2g}) "
        "times frequency squared, which no fluid has: a tool's inertia, or a correction for it "
        f"that is off. It makes {100 * np.max(share):.0f} % of the modulus at the highest "
        f"frequency; modes, solvent and elastic constant alone miss by "
        f"{percent_of(found.error_before)}, with it by "
        f"{percent_of(found.error_after)}. {remedy}"
    )


class SweepInertia(NamedTuple):
    """What a term −I ω² in G′ does for a sum of Maxwell modes."""

    inertia: float  # I in Pa s²: positive, the tool's was not all subtracted; negative, too much
    deviation: float  # its standard deviation
    error_before: float  # root mean square of the misfit of G′ and G″ over |G*|, without the term
    error_after: float  # with it
    evidence: float  # lowering of the Bayesian information criterion


def sweep_inertia(sweep: LinearSweep) -> SweepInertia:
    """Return how much of G′, as recorded, is inertia, with Maxwell modes, solvent and constant.

    The torque on tool and sample is G* − I ω² times the strain   [Krieger 1990, J. Rheol. 34, 471].
    Modes with positive moduli only rise in G′, so a G′ that falls with ω² is no material's; a
    solvent raises G″ alone, and an elastic constant raises G′ at every frequency alike.
    """
    omega = np.asarray(sweep.angular_frequency, dtype=float)
    size = np.hypot(sweep.storage_modulus, sweep.loss_modulus)
    data = np.concatenate([sweep.storage_modulus / size, sweep.loss_modulus / size])
    column = np.concatenate([-(omega**2) / size, np.zeros_like(omega)])
    falling = column[:, None]
    n_modes = max(1, int(len(omega) / _POINTS_PER_MODE))
    trials = []
    for margin in np.linspace(0.0, BEYOND, 4):
        times = np.geomspace(10.0**-margin / omega.max(), 10.0**margin / omega.min(), n_modes)
        modes = relative_moduli(omega, np.stack([size, size]), times, solvent=True, elastic=True)
        # either sign: the correction may have been too small or too large
        trials.append((solved(modes, data), solved(np.hstack([modes, falling, -falling]), data)))
    before = min(without[1] for without, _ in trials)
    amounts, after = min((with_it for _, with_it in trials), key=lambda fit: fit[1])
    n = len(data)
    gain = n * np.log(max(before, 1e-300) / max(after, 1e-300)) - np.log(n)
    deviation = np.sqrt(after / max(n - 1, 1) / max(float(column @ column), 1e-300))
    error_before, error_after = (float(np.sqrt(squared / n)) for squared in (before, after))
    inertia = float(amounts[-2] - amounts[-1])
    return SweepInertia(inertia, float(deviation), error_before, error_after, float(gain))


def against_linear_theory(
    runs: Sequence[Run], sweep: LinearSweep | None, spectrum: RelaxationSpectrum | None
) -> Iterator[Finding]:
    """Yield where runs and the linear sweep, or runs among themselves, do not fit together."""
    fastest = max((np.max(np.abs(run.rate)) for run in runs), default=0.0)
    runs = [run for run in runs if run.flow == "shear" and run.from_rest]
    if sweep is None or spectrum is None:
        return
    mean_time = spectrum.mean_relaxation_time  # weighted by what modes add to the viscosity
    if runs and not spectrum.elastic_modulus and fastest * mean_time < 0.1:
        text = (
            f"The largest shear rate times the mean relaxation time ({mean_time:.3g} s) is "
            f"{fastest * mean_time:.2g}: every run is linear, and nothing nonlinear can be "
            "learned. Add faster runs."
        )
        yield warning("rate", "", text)
    linear = {run.name: _linear_part(run, sweep, spectrum) for run in runs if run.flows}
    yield from _shared_gain(runs, linear, sweep, spectrum)
    for run in runs:
        if is_start_up(run):
            yield from _of_start_up(run, *linear[run.name], sweep, mean_time)


def _of_start_up(
    run: Run, stress: Values, linear: Values, sweep: LinearSweep, mean_time: float
) -> Iterator[Finding]:
    """Yield what is doubtful of its duration, its linear part and its steady state."""
    rate, frequency = abs(run.rate[0]), sweep.angular_frequency
    # strongly sheared melts are steady after some strain, however slow they relax
    if run.time[-1] < mean_time and (strain := rate * run.time[-1]) < 5.0:
        text = (
            f"{run.name} lasts {run.time[-1]:.3g} s and strains by {strain:.2g}; the mean "
            f"relaxation time is {mean_time:.3g} s. It does not reach its steady state, and slow "
            "modes hardly show. Run longer, or do not expect it to tell."
        )
        yield warning("duration", run.name, text)
    ratio = float(np.median(stress / linear)) if len(stress) >= _FEWEST_RATIOS else 1.0
    if abs(ratio - 1.0) > _STRESS_TOLERANCE:
        text = (
            f"At strains below {_LINEAR_STRAIN:g} the stress in {run.name} is {ratio:.2g} times "
            f"what {SWEEP_FILE} predicts. Units, temperature, sample loading, a slow start or a "
            "soft instrument do that; the closed loop can distinguish some of them."
        )
        yield warning("linear", run.name, text)
    level = steady_stress(run)
    if rate * mean_time > _COX_MERZ_RATE or level is None:
        return
    if not frequency[0] <= rate <= frequency[-1]:
        return
    ratio = level / float(magnitude_at(sweep, rate))
    if not 1 / _COX_MERZ_FACTOR < ratio < _COX_MERZ_FACTOR:
        text = (
            f"The steady viscosity in {run.name} is {ratio:.2g} times the complex viscosity of "
            f"{SWEEP_FILE} at the same rate (Cox–Merz rule). Slip, edge fracture, units or "
            "another sample do that; so do structured fluids."
        )
        yield warning("Cox-Merz", run.name, text)


def _linear_stress(
    times: Values, rates: Values, spectrum: RelaxationSpectrum
) -> Float[np.ndarray, " n-1"]:
    """Return σ(t) = ∫ Σ G_k exp(−(t−s)/λ_k) γ̇(s) ds from rest, the rate linear between samples."""
    steps = np.diff(times)[:, None] / spectrum.relaxation_time
    whole = -np.expm1(-steps)
    # what the end of an interval adds where the rate rises over it from 0 to 1; by its series
    # where the closed form cancels
    rising = np.where(steps < 1e-4, 0.5 * steps, 1.0 - whole / np.maximum(steps, 1e-4))
    made = rates[:-1, None] * whole + np.diff(rates)[:, None] * rising
    total = np.zeros_like(made)
    for i, (kept, added) in enumerate(zip(1.0 - whole, made, strict=True)):
        total[i] = kept * total[i - 1] + added  # of the first, total[-1] is still zero
    polymer = total @ (spectrum.modulus * spectrum.relaxation_time)
    return polymer + spectrum.solvent_viscosity * rates[1:]


def _linear_part(
    run: Run, sweep: LinearSweep, spectrum: RelaxationSpectrum
) -> tuple[Values, Values]:
    """Stresses and those of linear theory until the strain first exceeds its limit."""
    rates, times = np.append(run.rate[0], run.rate), np.append(0.0, run.time)
    strain = np.abs(np.cumsum(0.5 * (rates[1:] + rates[:-1]) * np.diff(times)))
    n = int(np.argmax(np.append(strain, np.inf) >= _LINEAR_STRAIN))
    linear = _linear_stress(times[: n + 1], rates[: n + 1], spectrum)
    size = np.abs(linear)
    use = size > 5 * stress_noise(run)
    use &= size > _CLEAR_OF_ZERO * np.maximum.accumulate(size)
    # times shorter than those of the sweep are extrapolation
    use &= run.time[:n] > 1.0 / np.max(sweep.angular_frequency)
    return run.stress[:n][use], linear[use]


def _gain(run: Run, stress: Values, linear: Values) -> tuple[float, float] | None:
    """Log of a run's gain against the sweep, and its error; None if it drifts or leaves more."""
    if len(stress) < _FEWEST_RATIOS or np.any(stress * linear <= 0):
        return None
    ratios = np.log(stress / linear)
    gain, half = float(np.median(ratios)), len(ratios) // 2
    drift = abs(float(np.median(ratios[half:]) - np.median(ratios[:half])))
    left = rms(stress - np.exp(gain) * linear)
    if drift > _STEADY_RATIO or left > max(_STEADY_RATIO * rms(stress), 2.0 * stress_noise(run)):
        return None
    # lines between samples lose (ωh)²/12 of a wave; what they miss in the middle is (ωh)²/2
    coarse = rms(np.diff(run.rate, 2)) / rms(run.rate) / 6.0
    # a median's error is 1.25 times a mean's; the fewest samples hardly show how they scatter
    known = max(len(ratios) - _FEWEST_RATIOS, 1)
    of_median = 1.25 * float(np.std(ratios)) / np.sqrt(known)
    return gain, max(drift, of_median, coarse)


def _shared_gain(
    runs: Sequence[Run],
    linear: Mapping[str, tuple[np.ndarray, np.ndarray]],
    sweep: LinearSweep,
    spectrum: RelaxationSpectrum,
) -> Iterator[Finding]:
    """Yield by which factor all runs differ from the sweep, if it is one for all."""
    flowing = [run for run in runs if run.name in linear]
    found = [gain for run in flowing if (gain := _gain(run, *linear[run.name])) is not None]
    if not found:
        return
    gains, errors = np.array(found).T
    count, several = len(gains), len(gains) >= _FEWEST_GAINS
    if several:
        yield from _unlike_gains(gains, np.hypot(errors, _STILL_LINEAR))
    shared = float(np.median(gains))
    scatter = 1.4826 * float(np.median(np.abs(gains - shared))) / np.sqrt(count)
    warned = abs(shared) >= np.log1p(_SHARED_TOLERANCE)
    if warned and several:
        doubt = max(scatter, spectrum.best_error / np.sqrt(len(sweep.angular_frequency)))
    else:
        # so few do not show how they scatter: each answers for itself, and for the sweep's misfit
        doubt = max(scatter, float(np.max(errors)), spectrum.relative_error)
    if abs(shared) < 3.0 * doubt or np.min(gains) < 0 < np.max(gains):
        return
    if not warned and (abs(shared) < np.log1p(_NOTED_GAIN) or not several):
        return
    which = {1: "the one run that tells", 2: "both runs that tell"}
    why = (
        "a gain, such as another gap, radius, temperature or filling than in the sweep"
        if warned
        else "within the usual error of gap and filling"
    )
    text = (
        f"In {which.get(count, f'all {count} runs that tell')} it, the stress at small strain is "
        f"{np.exp(shared):.3g} times what {SWEEP_FILE} predicts: {why}. Correct it, or let the "
        'study fit it: [model] modes = "lve" with modulus_Pa = "fit".'
    )
    yield (warning if warned else note)("gain", "", text)


def _unlike_gains(gains: Values, errors: Values) -> Iterator[Finding]:
    """Yield by how much the gains of runs differ, if by more than their errors leave open."""
    weights = errors**-2.0
    off = (gains - np.sum(weights * gains) / np.sum(weights)) / errors
    spread = float(np.sqrt(max(np.var(gains, ddof=1) - np.mean(errors**2), 0.0)))
    if chi2.sf(float(off @ off), len(gains) - 1) > _UNLIKELY or spread > LARGEST:
        return
    low, high = np.exp(np.min(gains)), np.exp(np.max(gains))
    text = (
        f"At small strain the runs stand at {low:.3g} to {high:.3g} times what {SWEEP_FILE} "
        f"predicts, so they differ among themselves by {percent_of(spread)}, standard deviation, "
        "as fillings of one sample do. If each run is a loading of its own, say so in the study: "
        f"loading = {spread:.1g} in [loop] and in [compare]."
    )
    yield note("loading", "", text)
