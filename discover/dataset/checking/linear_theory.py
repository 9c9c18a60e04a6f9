"""Doubts about runs held against linear viscoelasticity, and about the sweep itself."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from jaxtyping import Float
from scipy.stats import chi2

from discover.dataset.checking.finding import Finding
from discover.dataset.checking.runs import is_start_up, stress_noise
from discover.dataset.checking.sweeps import sweep_inertia
from discover.dataset.linear_viscoelasticity import LinearSweep, RelaxationSpectrum
from discover.dataset.load import SWEEP_FILE
from discover.dataset.run import LARGEST, Run
from discover.statistics import HALF_BAND
from discover.statistics.noise.noise_model import rms
from discover.words import percent_of

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
_FEWEST_RATIOS = 5
_STEADY_RATIO = 0.05
_FEWEST_GAINS = 3
# Where the stress passes through zero its ratio says nothing
_CLEAR_OF_ZERO = 0.3
# Of gains that differ: what a law that thins leaves of linear theory at small strain, and chance
_STILL_LINEAR = 0.01
_UNLIKELY = 1e-3
# Well below a Weissenberg number of one the Cox–Merz rule holds to some ten per cent for simple
# fluids; above it laws differ, and it is theirs to say. A Maxwell fluid is off by 1.3 at 0.83
_COX_MERZ_FACTOR = 1.3
_COX_MERZ_RATE = 0.8
_SWEEP_TOLERANCE = 0.05
# Inertia may make this share of the modulus before a frequency is not to be used
_INERTIA_SHARE = 0.01
_FEWEST_FOR_INERTIA = 6
# A sweep that modes describe better than this is as good as sweeps are
_VISIBLE_MISFIT = 0.02
_STRONG_EVIDENCE = 6.0


def doubts_of_sweep(sweep: LinearSweep, spectrum: RelaxationSpectrum) -> Iterator[Finding]:
    """Yield what is doubtful about a linear sweep.

    That Maxwell modes with positive moduli, a solvent and an elastic constant fit G′ and G″
    together is the practical form of the Kramers–Kronig relations.
    """
    if spectrum.best_error > _SWEEP_TOLERANCE:
        text = (
            f"No sum of Maxwell modes, a solvent and an elastic constant fits {SWEEP_FILE} better "
            f"than {100 * spectrum.best_error:.0f} %: G' and G'' contradict each other. Inertia of "
            "the instrument at high frequency, a shift of one column, or too large an amplitude do "
            "that."
        )
        yield Finding("warning", "sweep", SWEEP_FILE, text)
    if sweep.thinned:
        yield Finding("note", "samples", SWEEP_FILE, f"{SWEEP_FILE}: {sweep.thinned}.")
    yield from _inertia(sweep)
    if spectrum.solid:
        yield Finding("note", "sweep", SWEEP_FILE, f"{SWEEP_FILE}: {spectrum.solid}")
    if len(np.unique(sweep.angular_frequency)) < len(sweep.angular_frequency):
        yield Finding(
            "note", "sweep", SWEEP_FILE, f"{SWEEP_FILE} holds some frequencies more than once."
        )


def _inertia(sweep: LinearSweep) -> Iterator[Finding]:
    """Yield whether G' bends at high frequency as only a wrong inertia correction makes it."""
    if len(sweep.angular_frequency) < _FEWEST_FOR_INERTIA:
        return
    found = sweep_inertia(sweep)
    omega, size = sweep.angular_frequency, np.hypot(sweep.storage_modulus, sweep.loss_modulus)
    share = np.abs(found.inertia) * omega**2 / size
    if found.evidence < _STRONG_EVIDENCE or found.error_before < _VISIBLE_MISFIT:
        return
    if np.max(share) < _SWEEP_TOLERANCE:
        return
    usable = omega[share < _INERTIA_SHARE]
    remedy = (
        f'Give the study [model] modes = "lve" and sweep_rad_s = [{omega[0]:.4g}, '
        f"{np.max(usable):.4g}], or correct the inertia."
        if usable.size
        else "Correct the inertia."
    )
    text = (
        f"G' in {SWEEP_FILE} holds {-found.inertia:.3g} Pa s2 "
        f"(± {HALF_BAND * found.deviation:.2g}) "
        "times frequency squared, which no fluid has: a tool's inertia, or a correction for it "
        f"that is off. It makes {100 * np.max(share):.0f} % of the modulus at the highest "
        f"frequency; modes, solvent and elastic constant alone miss by "
        f"{percent_of(found.error_before)}, with it by "
        f"{percent_of(found.error_after)}. {remedy}"
    )
    yield Finding("warning", "sweep", SWEEP_FILE, text)


def against_linear_theory(
    runs: Sequence[Run], sweep: LinearSweep | None, spectrum: RelaxationSpectrum | None
) -> Iterator[Finding]:
    """Yield where runs and the linear sweep, or runs among themselves, do not fit together."""
    fastest = max((np.max(np.abs(run.rate)) for run in runs), default=0.0)
    runs = [run for run in runs if run.flow == "shear" and run.from_rest]
    start_ups = [run for run in runs if is_start_up(run)]
    if sweep is None or spectrum is None:
        return
    # weighted by what each mode adds to the viscosity
    mean_time = spectrum.mean_relaxation_time
    if runs and not spectrum.elastic_modulus and fastest * mean_time < 0.1:
        text = (
            f"The largest shear rate times the mean relaxation time ({mean_time:.3g} s) is "
            f"{fastest * mean_time:.2g}: every run is linear, and nothing nonlinear can be "
            "learned. Add faster runs."
        )
        yield Finding("warning", "rate", "", text)
    linear = {run.name: _linear_part(run, sweep, spectrum) for run in runs if run.flows}
    yield from _shared_gain(runs, linear, sweep, spectrum)
    for run in start_ups:
        yield from _duration(run, mean_time)
        yield from _small_strain(run, *linear[run.name])
        yield from _cox_merz(run, sweep, mean_time)


def _duration(run: Run, mean_time: float) -> Iterator[Finding]:
    strain = abs(run.rate[0]) * run.time[-1]
    # strongly sheared melts are steady after some strain, however slow they relax
    if run.time[-1] < mean_time and strain < 5.0:
        text = (
            f"{run.name} lasts {run.time[-1]:.3g} s and strains by {strain:.2g}; the mean "
            f"relaxation time is {mean_time:.3g} s. It does not reach its steady state, and slow "
            "modes hardly show. Run longer, or do not expect it to tell."
        )
        yield Finding("warning", "duration", run.name, text)


def _linear_stress(
    times: Float[np.ndarray, " n"], rates: Float[np.ndarray, " n"], spectrum: RelaxationSpectrum
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
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Return the first stresses and those of linear theory, in their order.

    Used is what comes before the strain from rest exceeds its limit for the first time.
    """
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


def _gain(
    run: Run, stress: Float[np.ndarray, " n"], linear: Float[np.ndarray, " n"]
) -> tuple[float, float] | None:
    """Return the logarithm of a run's gain against the sweep and its error; None if it is no gain.

    It is one if its ratio to linear theory does not rise or fall while the run is linear, as it
    does after a slow start, and if nothing but noise is left with it.
    """
    if len(stress) < _FEWEST_RATIOS or np.any(stress * linear <= 0):
        return None
    ratios = np.log(stress / linear)
    gain, half = float(np.median(ratios)), len(ratios) // 2
    drift = abs(float(np.median(ratios[half:]) - np.median(ratios[:half])))
    left = rms(stress - np.exp(gain) * linear)
    size = rms(stress)
    if drift > _STEADY_RATIO or left > max(_STEADY_RATIO * size, 2.0 * stress_noise(run)):
        return None
    # lines between samples lose (ωh)²/12 of a wave; what they miss in the middle is (ωh)²/2
    bends = rms(np.diff(run.rate, 2))
    coarse = bends / rms(run.rate) / 6.0
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
    yield from _unlike_gains(gains, errors)
    shared = float(np.median(gains))
    scatter = 1.4826 * float(np.median(np.abs(gains - shared))) / np.sqrt(len(gains))
    warned = abs(shared) >= np.log1p(_SHARED_TOLERANCE)
    if warned and len(gains) >= _FEWEST_GAINS:
        doubt = max(scatter, spectrum.best_error / np.sqrt(len(sweep.angular_frequency)))
    else:
        # so few do not show how they scatter: each answers for itself, and for the sweep's misfit
        doubt = max(scatter, float(np.max(errors)), spectrum.relative_error)
    if abs(shared) < 3.0 * doubt or np.min(gains) < 0 < np.max(gains):
        return
    if not warned and (abs(shared) < np.log1p(_NOTED_GAIN) or len(gains) < _FEWEST_GAINS):
        return
    which = {1: "the one run that tells", 2: "both runs that tell"}.get(
        len(gains), f"all {len(gains)} runs that tell"
    )
    why = (
        "a gain, such as another gap, radius, temperature or filling than in the sweep"
        if warned
        else "within the usual error of gap and filling"
    )
    text = (
        f"In {which} it, the stress at small strain is {np.exp(shared):.3g} times what "
        f"{SWEEP_FILE} predicts: {why}. Correct it, or let the study fit it: [model] modes = "
        '"lve" with modulus_Pa = "fit".'
    )
    yield Finding("warning" if warned else "note", "gain", "", text)


def _unlike_gains(
    gains: Float[np.ndarray, " k"], errors: Float[np.ndarray, " k"]
) -> Iterator[Finding]:
    """Yield by how much the gains of runs differ, if by more than their errors leave open."""
    if len(gains) < _FEWEST_GAINS:
        return
    errors = np.hypot(errors, _STILL_LINEAR)
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
    yield Finding("note", "loading", "", text)


def _small_strain(
    run: Run, stress: Float[np.ndarray, " n"], linear: Float[np.ndarray, " n"]
) -> Iterator[Finding]:
    if len(stress) < _FEWEST_RATIOS:
        return
    ratio = float(np.median(stress / linear))
    if abs(ratio - 1.0) > _STRESS_TOLERANCE:
        text = (
            f"At strains below {_LINEAR_STRAIN:g} the stress in {run.name} is {ratio:.2g} times "
            f"what {SWEEP_FILE} predicts. Units, temperature, sample loading, a slow start or a "
            "soft instrument do that; the closed loop can distinguish some of them."
        )
        yield Finding("warning", "linear", run.name, text)


def _cox_merz(run: Run, sweep: LinearSweep, mean_time: float) -> Iterator[Finding]:
    rate = abs(run.rate[0])
    frequency = sweep.angular_frequency
    tail = run.stress[run.time > 0.8 * run.time[-1]]
    level = float(np.median(tail)) if len(tail) else 0.0
    steady = len(tail) >= 3 and np.ptp(tail) < 0.1 * abs(level)
    if rate * mean_time > _COX_MERZ_RATE or not steady:
        return
    if not frequency[0] <= rate <= frequency[-1]:
        return
    complex_viscosity = np.hypot(sweep.storage_modulus, sweep.loss_modulus) / frequency
    expected = np.exp(np.interp(np.log(rate), np.log(frequency), np.log(complex_viscosity)))
    ratio = abs(level) / rate / float(expected)
    if not 1 / _COX_MERZ_FACTOR < ratio < _COX_MERZ_FACTOR:
        text = (
            f"The steady viscosity in {run.name} is {ratio:.2g} times the complex viscosity of "
            f"{SWEEP_FILE} at the same rate (Cox–Merz rule). Slip, edge fracture, units or "
            "another sample do that; so do structured fluids."
        )
        yield Finding("warning", "Cox-Merz", run.name, text)
