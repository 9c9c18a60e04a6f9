"""Doubts about sweeps by themselves, and about runs held against linear viscoelasticity."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from discover.dataset.checking.runs import Finding, found, is_start_up, steady_stress, stress_noise
from discover.dataset.linear_viscoelasticity import LinearSweep, RelaxationSpectrum
from discover.dataset.load import SWEEP_FILE
from discover.dataset.mode_search import BEYOND, relative_moduli, solved
from discover.dataset.run import Run
from discover.statistics import HALF_BAND
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
_SHARED_GAIN = np.log(1.07)
# Of a gain: samples of a run, change of the ratio within it, and runs that show how they scatter
_FEWEST_RATIOS, _STEADY_RATIO, _FEWEST_GAINS = 5, 0.05, 3
_CLEAR_OF_ZERO = 0.3  # where the stress passes through zero its ratio says nothing
# Units that are taken for others, and what then makes the numbers right
_MISTAKEN: dict[str, dict[str, float]] = {
    "a stress in kPa that is read in Pa": {"stress": 1e3},
    "a stress in MPa that is read in Pa": {"stress": 1e6},
    "a stress in dyn/cm2 that is read in Pa": {"stress": 0.1},
    "a shear rate in 1/min that is read in 1/s": {"rate": 1.0 / 60.0},
    "a shear rate in %/s that is read in 1/s": {"rate": 0.01},
    "a time in ms that is read in s": {"time": 1e-3},
    "a time in min that is read in s": {"time": 60.0},
    "a time in h that is read in s": {"time": 3600.0},
}
# Share of the small strains that then agree with the sweep, which as they stand do not, and by how
# much the stress changes among them: a level alone may agree by chance. Damping functions are 0.9
# and more up to that strain, and units differ by 10 at least
_AGREE, _RISE, _UNIT_STRAIN = 0.8, 3.0, 0.5
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
        yield found("strain_in_percent", run.name, low=low, high=high)
    for name, values in (("G′", storage), ("G″", loss)):
        if count := np.count_nonzero(values <= 0.0):
            yield found("not_positive", run.name, count=count, name=name)
    if linear is None:
        return
    omega, known = run.angular_frequency, linear.angular_frequency
    small = (omega >= known[0]) & (omega <= known[-1]) & (strain <= _SMALL)
    if np.any(small):
        expected = magnitude_at(linear, omega[small])
        factor = float(np.median(np.hypot(storage[small], loss[small]) / expected))
        if abs(np.log(factor)) > _APART:
            yield found("other_modulus", run.name, strain=_SMALL, factor=factor)


def magnitude_at(sweep: LinearSweep, frequency):
    """Return |G*| in Pa at frequencies in rad/s, on straight lines between those of a sweep."""
    size = np.log(np.hypot(sweep.storage_modulus, sweep.loss_modulus))
    return np.exp(np.interp(np.log(frequency), np.log(sweep.angular_frequency), size))


def doubts_of_sweep(sweep: LinearSweep, spectrum: RelaxationSpectrum) -> Iterator[Finding]:
    """Doubts about a linear sweep; that modes fit G′ and G″ stands for Kramers–Kronig."""
    if spectrum.best_error > _SWEEP_TOLERANCE:
        yield found("contradiction", SWEEP_FILE, percent=100 * spectrum.best_error)
    yield from _inertia(sweep)
    if spectrum.solid:
        yield found("solid", SWEEP_FILE, what=spectrum.solid)
    if len(np.unique(sweep.angular_frequency)) < len(sweep.angular_frequency):
        yield found("repeated", SWEEP_FILE)


def _inertia(sweep: LinearSweep) -> Iterator[Finding]:
    """Yield that G' bends at high frequency as only a wrong inertia correction makes it."""
    omega, size = sweep.angular_frequency, np.hypot(sweep.storage_modulus, sweep.loss_modulus)
    if len(omega) < _FEWEST_FOR_INERTIA:
        return
    term = sweep_inertia(sweep)
    share = np.abs(term.inertia) * omega**2 / size
    seen = term.evidence >= _STRONG_EVIDENCE and term.error_before >= _VISIBLE_MISFIT
    if not seen or np.max(share) < _SWEEP_TOLERANCE:
        return
    usable, remedy = omega[share < _INERTIA_SHARE], "Correct the inertia."
    if usable.size:
        window = f"[{omega[0]:.4g}, {np.max(usable):.4g}]"
        remedy = f'Give the study [model] modes = "lve" and sweep_rad_s = {window}, or correct the '
        remedy += "inertia."
    yield found(
        "inertia", SWEEP_FILE, inertia=-term.inertia, half=HALF_BAND * term.deviation,
        percent=100 * np.max(share), before=percent_of(term.error_before),
        after=percent_of(term.error_after), remedy=remedy,
    )  # fmt: skip


class SweepInertia(NamedTuple):
    """What a term −I ω² in G′ does for a sum of Maxwell modes."""

    inertia: float  # I in Pa s²: positive, the tool's was not all subtracted; negative, too much
    deviation: float  # its standard deviation
    error_before: float  # root mean square of the misfit of G′ and G″ over |G*|, without the term
    error_after: float  # with it
    evidence: float  # lowering of the Bayesian information criterion


def sweep_inertia(sweep: LinearSweep) -> SweepInertia:
    """Return how much of G′ is inertia: the torque is G* − I ω² times strain [Krieger 1990]."""
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
    number = fastest * mean_time
    if runs and not spectrum.elastic_modulus and number < 0.1:
        yield found("all_linear", time=mean_time, number=number)
    if units := _mistaken_units([run for run in runs if run.flows], sweep, spectrum):
        yield found("mistaken_unit", SWEEP_FILE, units=" or ".join(units))
        return
    gains: list[float] = []  # of runs whose ratio to linear theory stays, as logarithms
    for run in (run for run in runs if run.flows):
        stress, predicted = _linear_part(run, sweep, spectrum)
        known = stress / predicted if len(stress) >= _FEWEST_RATIOS else np.ones(2)
        ratio, (early, late) = float(np.median(known)), map(np.median, np.array_split(known, 2))
        if len(stress) >= _FEWEST_RATIOS and abs(early - late) < _STEADY_RATIO * ratio:
            gains.append(float(np.log(ratio)))
        if is_start_up(run):
            yield from _of_start_up(run, ratio, sweep, mean_time)
    shared, scatter = (float(np.median(gains)), float(np.std(gains))) if gains else (0.0, 0.0)
    if len(gains) >= _FEWEST_GAINS and abs(shared) > max(_SHARED_GAIN, scatter):
        yield found("gain", count=len(gains), factor=np.exp(shared))


def _mistaken_units(
    runs: Sequence[Run], sweep: LinearSweep, spectrum: RelaxationSpectrum
) -> list[str]:
    def agreement(**factors: float) -> float:
        parts = [_linear_part(run, sweep, spectrum, _UNIT_STRAIN, **factors) for run in runs]
        stress, linear = map(np.concatenate, zip(*parts, strict=True))
        if len(stress) < _FEWEST_RATIOS or np.ptp(np.log(np.abs(linear))) < np.log(_RISE):
            return 0.0
        return float(np.mean(np.abs(stress / linear - 1.0) < _STRESS_TOLERANCE))

    if not runs or agreement() > 1.0 - _AGREE:
        return []
    return [unit for unit, factors in _MISTAKEN.items() if agreement(**factors) >= _AGREE]


def _of_start_up(run: Run, ratio: float, sweep: LinearSweep, mean_time: float) -> Iterator[Finding]:
    rate, frequency = abs(run.rate[0]), sweep.angular_frequency
    # strongly sheared melts are steady after some strain, however slow they relax
    if run.time[-1] < mean_time and (strain := rate * run.time[-1]) < 5.0:
        yield found("too_short", run.name, lasts=run.time[-1], strain=strain, time=mean_time)
    if abs(ratio - 1.0) > _STRESS_TOLERANCE:
        yield found("off_linear_theory", run.name, strain=_LINEAR_STRAIN, factor=ratio)
    level = steady_stress(run)
    inside = frequency[0] <= rate <= frequency[-1]
    if rate * mean_time <= _COX_MERZ_RATE and level is not None and inside:
        ratio = level / float(magnitude_at(sweep, rate))
        if not 1 / _COX_MERZ_FACTOR < ratio < _COX_MERZ_FACTOR:
            yield found("cox_merz", run.name, factor=ratio)


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
    run: Run, sweep: LinearSweep, spectrum: RelaxationSpectrum, limit: float = _LINEAR_STRAIN,
    stress: float = 1.0, rate: float = 1.0, time: float = 1.0,
) -> tuple[Values, Values]:  # fmt: skip
    """Stresses, times a factor, and those of linear theory until the strain exceeds a limit."""
    rates, times = rate * np.append(run.rate[0], run.rate), time * np.append(0.0, run.time)
    strain = np.abs(np.cumsum(0.5 * (rates[1:] + rates[:-1]) * np.diff(times)))
    n = int(np.argmax(np.append(strain, np.inf) >= limit))
    linear = _linear_stress(times[: n + 1], rates[: n + 1], spectrum)
    size = np.abs(linear)
    use = size > 5 * stress * stress_noise(run)
    use &= size > _CLEAR_OF_ZERO * np.maximum.accumulate(size)
    # times shorter than those of the sweep are extrapolation
    use &= times[1 : n + 1] > 1.0 / np.max(sweep.angular_frequency)
    return stress * run.stress[:n][use], linear[use]
