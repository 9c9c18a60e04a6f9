"""What a run from rest cannot have, told without any law: its first stress, its N1."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.integrate import cumulative_trapezoid

from discover.dataset import linear_viscoelasticity as linear
from discover.dataset.checking import runs as run_checks
from discover.dataset.checking.runs import Finding, found
from discover.dataset.linear_viscoelasticity import LinearSweep, RelaxationSpectrum
from discover.dataset.run import Run
from discover.dataset.run_table import oscillation
from discover.errors import InputError
from discover.protocols.kinematics import kinematics_of
from discover.statistics.noise_model import rms

# Beyond this factor of what elasticity allows, or below zero by half as much, the transducer
# speaks, not the fluid
_ELASTIC_FACTOR = 2.0
_SMALL_STRAIN = 0.5
_EARLY_STRAIN = 1.0  # laws part from linear theory in N1 by less than the factor until here
_MOSTLY_ELASTIC = 0.5  # share of σ12 γ in N1 below which a stress may be viscous and say nothing
# Means of so many samples miss what is allowed by so many of their standard errors: in a record of
# some hundred samples noise alone does in fewer than one of a hundred
_AVERAGED, _STANDARD_ERRORS = 9, 4.0
_NOTICEABLE = 0.005  # share of the largest N1; what is off by less matters to no fit
_FEWEST_LEFT = 10
# Second-order behaviour, N1 ∝ rate², holds below about this Weissenberg number, and of what it
# predicts a modulus and a time that are off leave this factor open
_SLOW, _SECOND_ORDER_FACTOR = 0.3, 3.0

# A first stress below this share of the largest is near rest: start-ups are sampled so
_FAR_FROM_REST = 0.25
# Where a start-up's rise is seen, some samples lie below half of the largest stress: the share to
# which `check_run` counts them. A solvent's viscosity makes more than half of it in dilute fluids
# alone
_RISE_OVER = 0.5
# Of a stress, this share may be more than a viscosity makes of the rate, or a transient less
_LARGE_PART, _TRANSIENT = 0.2, 0.05
_LINEAR_FACTOR = 2.0  # what thickening and another loading add to linear theory is less
_NOT_MADE = 0.05  # of the largest strain may be there before the first sample and not of the rate
_HARMONICS = np.array([1, 2, 3, 5, 7])

Values = Float[np.ndarray, " n"]


def doubts_of_normal_stress(run: Run, spectrum: RelaxationSpectrum | None) -> Iterator[Finding]:
    """Doubts about the N1 of a start-up of shear; nothing of any other run."""
    for fault in _faults(run, spectrum):
        yield found("normal_stress", run.name, why=fault.why)


class _Fault(NamedTuple):
    """Why an N1 cannot be right."""

    why: str  # the rest of a sentence that begins with the record, and what to do
    until: float = np.inf  # time in s from which on the record may be right, if ever


def sound_normal_stress(
    runs: Sequence[Run], sweep: LinearSweep | None
) -> tuple[dict[str, float], dict[str, str]]:
    """Time in s from which N1 may be right, and why it never is, by name of the run."""
    there = [run for run in runs if run.first_normal_stress_difference is not None]
    spectrum = None
    if there and sweep is not None:
        with suppress(InputError):  # the check of the folder says why
            spectrum = linear.relaxation_spectrum(sweep)
    late: dict[str, float] = {}
    never: dict[str, str] = {}
    for run in there:
        faults = list(_faults(run, spectrum))
        lasting = [fault for fault in faults if fault.until == np.inf]
        if lasting:
            never[run.name] = f"it {lasting[0].why.rstrip('.')}"
        elif faults:
            late[run.name] = faults[0].until
    return late, never


def _faults(run: Run, spectrum: RelaxationSpectrum | None) -> Iterator[_Fault]:
    normal = run.first_normal_stress_difference
    in_shear = run.protocol.control == "rate" and run.flow == "shear" and run.from_rest
    if normal is None or not (in_shear and run_checks.is_start_up(run)):
        return
    if (early := _early(run, normal)) is not None:
        yield early
    rate, end = abs(float(run.rate[0])), float(np.median(normal[-max(3, len(run) // 10) :]))
    if end < 0 and rate * run.time[-1] > _SMALL_STRAIN:
        yield _Fault(
            f"ends negative ({end:.3g} Pa). Few fluids do that; check its sign and the baseline of "
            "the normal force."
        )
    if spectrum is not None:
        yield from _second_order(rate, end, spectrum)


def _averaged(values: Values, width: int) -> Float[np.ndarray, " _"]:
    """Return means over so many samples around each; at an end those of the last whole window."""
    means = np.mean(np.lib.stride_tricks.sliding_window_view(values, width), axis=1)
    return np.pad(means, (width // 2, width - 1 - width // 2), mode="edge")


def _early(run: Run, normal: Values) -> _Fault | None:
    """Hold N1 against what elasticity allows in start-up from rest.

    With every mode elastic N1 = σ12 γ [Lodge & Meissner 1972, Rheol. Acta 11, 351], less with
    relaxation. At small strain N1 = 2 γ̇ (t σ12 − ∫ σ12 dt) whatever G and solvent [Bird, Armstrong
    & Hassager 1987, vol. 1, ch. 6].
    """
    rate = abs(float(run.rate[0]))
    strain, stress = rate * run.time, run.stress * np.sign(run.rate[0])
    early = strain < _EARLY_STRAIN
    if np.sum(early) < 5:
        return None
    most = np.abs(stress) * strain
    grown = cumulative_trapezoid(np.append(0.0, stress), np.append(0.0, run.time))
    memory = 2.0 * (strain * stress - rate * grown)
    least = np.where(
        early & (memory >= _MOSTLY_ELASTIC * most), memory / _ELASTIC_FACTOR, -0.5 * most
    )
    # of the noise of N1, and of the stress in what it predicts
    noise = run_checks.local_noise(run.time, normal), run_checks.local_noise(run.time, stress)
    error = np.hypot(noise[0], noise[1] * strain)
    width = min(_AVERAGED, int(np.sum(early)))
    excess = np.maximum(
        _averaged(normal - _ELASTIC_FACTOR * most, width), _averaged(least - normal, width)
    )
    allowed = _STANDARD_ERRORS * error / np.sqrt(width)
    bad = excess > np.maximum(allowed, _NOTICEABLE * np.max(np.abs(normal)))
    if not bad[early].any():
        return None
    # on from there as long as it is wrong
    last = int(np.flatnonzero(bad & early)[-1])
    last += int(np.argmin(np.append(bad[last:], False))) - 1
    until = float(run.time[last])
    lasts = len(run) - last - 1 < _FEWEST_LEFT
    rest = "Nothing is left of it."
    rest = rest if lasts else "These samples are neither fitted nor used as a test."
    return _Fault(
        f"cannot be right early, up to {until:.4g} s (strain {strain[last]:.2g}): by more than "
        f"its noise it is negative, above {_ELASTIC_FACTOR:g} times stress × strain, the elastic "
        "limit, or below half of what the stress predicts. The normal force lags, gives way or "
        f"has a baseline. {rest}",
        np.inf if lasts else until,
    )


def _second_order(rate: float, end: float, spectrum: RelaxationSpectrum) -> Iterator[_Fault]:
    """Hold the last N1 of a slow run against N1 = 2 γ̇² Σ G_k λ_k²   [Coleman & Markovitz 1964]."""
    mean_time = spectrum.mean_relaxation_time
    most = 2.0 * mean_time * spectrum.zero_shear_viscosity * rate**2
    slow = not spectrum.elastic_modulus and rate * mean_time <= _SLOW
    if slow and not 0 <= end <= _SECOND_ORDER_FACTOR * most:
        yield _Fault(
            f"ends at {end:.3g} Pa; at this slow rate the linear sweep predicts a value between 0 "
            f"and {most:.3g} Pa, quadratic in the rate. The normal force is below what the "
            "transducer resolves, or has a baseline."
        )


def doubts_of_start(
    run: Run, sweep: LinearSweep | None = None, spectrum: RelaxationSpectrum | None = None
) -> Iterator[Finding]:
    """Yield why a run that is taken as starting from rest cannot have started so, or does not show.

    A large first stress is doubted that (1) falls whatever the rate does; (2) belongs to an elastic
    fluid's steady oscillation; (3) is more than a sweep allows; (4) has a strain not of the rate.
    """
    size, first = float(np.max(np.abs(run.stress))), abs(float(run.stress[0]))
    of_rest = run.protocol.control == "rate" and run.from_rest and len(run) > 4
    noise = run_checks.stress_noise(run) if of_rest else 0.0
    if not of_rest or first < max(_FAR_FROM_REST * size, 1e-300, 5.0 * noise):
        return
    why = ""
    if _only_falls(run):
        why = "it falls from there whatever the rate does, as after a step of strain"
    elif _steady_alternation(run):
        why = "its first cycle is like the later ones, as in the periodic steady state"
    elif sweep is not None and spectrum is not None and _more_than_linear(run, sweep, spectrum):
        why = "the linear sweep allows less than half of that so early"
    elif run.strain is not None and not run.rate_is_measured:
        off = abs(run.strain[0] - run.rate[0] * run.time[0])
        if off > _NOT_MADE * np.max(np.abs(run.strain)):
            why = "the strain recorded there is not what its rate had made by then"
    # of an oscillation that was recorded from its start on, the cycles have told
    told = run.time[0] == 0.0 and oscillation(run) is not None
    if why:
        yield found("not_from_rest", run.name, first=first, percent=100 * first / size, why=why)
    # without a spectrum, which would say how fast the stress grows, nothing may show it
    elif spectrum is None and first >= _RISE_OVER * size and not told and not _no_memory(run):
        percent = 100 * first / size
        yield found("start_not_shown", run.name, time=run.time[0], percent=percent)


def _no_memory(run: Run) -> bool:
    """Whether a power law of the rate, where it changes, makes the stress at every sample."""
    rate, stress = np.abs(run.rate), run.stress * np.sign(run.rate)
    use = (rate > 0.0) & (stress > 0.0)
    if np.ptp(run.rate) < _LARGE_PART * np.max(rate) or np.count_nonzero(use) < 3:
        return False
    power = np.polynomial.Polynomial.fit(np.log(rate[use]), np.log(stress[use]), 1)
    left = stress[use] - np.exp(power(np.log(rate[use])))
    lost = stress[~use]
    return bool(left @ left + lost @ lost < _TRANSIENT**2 * (stress @ stress))


def _only_falls(run: Run) -> bool:
    stress = run.stress * np.sign(run.stress[0])
    tail = float(np.median(stress[-max(3, len(run) // 10) :]))
    if np.max(stress) > 1.1 * stress[0] or tail > 0.5 * stress[0]:
        return False
    rate = run.rate
    power = float(rate @ rate)
    viscosity = max(float(rate @ run.stress) / power, 0.0) if power > 0.0 else 0.0
    left = run.stress - viscosity * rate
    return bool(left @ left > 0.5 * (run.stress @ run.stress))


def _steady_alternation(run: Run) -> bool:
    wave = oscillation(run)
    if wave is None:
        return False
    period = 2.0 * np.pi / wave[0]
    time = run.time - run.time[0]
    later = time > period
    n = len(_HARMONICS)
    if time[-1] < 2.0 * period or np.count_nonzero(later) < 4 * n:
        return False
    angles = wave[0] * run.time[:, None] * _HARMONICS
    waves = np.hstack([np.cos(angles), np.sin(angles), np.ones((len(run), 1))])
    found, *_ = np.linalg.lstsq(waves[later], run.stress[later], rcond=None)
    rates, *_ = np.linalg.lstsq(waves, run.rate, rcond=None)
    left = run.stress - waves @ found
    scatter, early = rms(left[later]), rms(left[time < 0.25 * period])
    viscosity = complex(found[0], -found[n]) / complex(rates[0], -rates[n])
    size = float(np.max(np.abs(run.stress)))
    alike = early < max(3.0 * scatter, _TRANSIENT * size) and scatter < _LARGE_PART * size
    return alike and abs(viscosity.imag) > _LARGE_PART * abs(viscosity)


def _more_than_linear(run: Run, sweep: LinearSweep, spectrum: RelaxationSpectrum) -> bool:
    """Whether the first stress is above Trouton's ratio × γ̇ (Σ G_k λ_k (1 − e^(−t/λ_k)) + η)."""
    modes = spectrum.modulus * spectrum.relaxation_time
    # what is faster than the sweep, a solvent too, is at most its smallest dynamic viscosity
    fast = float(np.min(sweep.loss_modulus / sweep.angular_frequency))
    linear = fast + float(-np.expm1(-float(run.time[0]) / spectrum.relaxation_time) @ modes)
    trouton = float(kinematics_of(run.flow).viscous)
    allowed = _LINEAR_FACTOR * trouton * abs(float(run.rate[0])) * linear
    return abs(float(run.stress[0])) > allowed + 5.0 * run_checks.stress_noise(run)
