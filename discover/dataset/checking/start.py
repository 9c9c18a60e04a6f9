"""Doubts about the state in which a run begins: it is taken as rest unless the study says more."""

from collections.abc import Iterator

import numpy as np

from discover.dataset.checking.runs import Finding, stress_noise
from discover.dataset.linear_viscoelasticity import LinearSweep, RelaxationSpectrum
from discover.dataset.run import Run
from discover.dataset.run_table import oscillation
from discover.protocols.kinematics import kinematics_of
from discover.statistics.noise.noise_model import rms

# A first stress below this share of the largest is near rest: start-ups are sampled so
_FAR_FROM_REST = 0.25
# Where a start-up's rise is seen, some samples lie below half of the largest stress: the share to
# which `check_run` counts them. A solvent's viscosity makes more than half of it in dilute fluids
# alone
_RISE_OVER = 0.5
# Of a stress, this share may be more than a viscosity makes of the rate, or a transient less
_NOTICEABLE, _TRANSIENT = 0.2, 0.05
_LINEAR_FACTOR = 2.0  # what thickening and another loading add to linear theory is less
_NOT_MADE = 0.05  # of the largest strain may be there before the first sample and not of the rate
_HARMONICS = np.array([1, 2, 3, 5, 7])


def doubts_of_start(
    run: Run, sweep: LinearSweep | None = None, spectrum: RelaxationSpectrum | None = None
) -> Iterator[Finding]:
    """Yield why a run that is taken as starting from rest cannot have started so, or does not show.

    From rest a fluid has no stress but what the flow until the first sample made: that of a
    viscosity at once, that of elasticity with the strain. A record is doubted if its first stress
    is large and (1) it is the largest, and falls whatever the rate does, as after a step of strain;
    or (2) the run is an oscillation of a fluid that is partly elastic, and its first cycle is
    already like the later ones; or (3) a linear sweep does not allow so much; or (4) the strain
    that was recorded with it says that the rate had been another before. Without a spectrum, which
    would say how fast the stress grows, nothing may show it where the run began late.
    """
    size, first = float(np.max(np.abs(run.stress))), abs(float(run.stress[0]))
    if run.protocol.control != "rate" or not run.from_rest or len(run) < 5:
        return
    if first < max(_FAR_FROM_REST * size, 1e-300, 5.0 * stress_noise(run)):
        return
    why = ""
    if _only_falls(run):
        why = "it falls from there whatever the rate does, as after a step of strain"
    elif _steady_alternation(run):
        why = "its first cycle is like the later ones, as in the periodic steady state"
    elif sweep is not None and spectrum is not None and _more_than_linear(run, sweep, spectrum):
        why = "the linear sweep allows less than half of that so early"
    elif _strained_before(run):
        why = "the strain recorded there is not what its rate had made by then"
    # of an oscillation that was recorded from its start on, the cycles have told
    told = run.time[0] == 0.0 and oscillation(run) is not None
    if why:
        text = (
            f"{run.name} is taken as starting from rest, but its first stress is {first:.3g} Pa, "
            f"{100 * first / size:.0f} % of the largest, and {why}. What came before it will look "
            "like a missing effect. Give the record from rest on, or say in runs.csv what came "
            "before (start, step_strain, rate_before); otherwise leave the run out."
        )
    elif spectrum is None and first >= _RISE_OVER * size and not told and not _no_memory(run):
        text = (
            f"{run.name} is taken as starting from rest, but does not show it: its first stress, "
            f"at {run.time[0]:.3g} s, is {100 * first / size:.0f} % of the largest, and nothing "
            "before it was recorded. Sample the start, or say in runs.csv what came before (start, "
            "rate_before), which would look like a missing effect. A solvent's viscosity makes "
            "stress at once: where it is most of the fluid's, nothing is wrong."
        )
    else:
        return
    yield Finding("warning", "start", run.name, text)


def _no_memory(run: Run) -> bool:
    """Whether a power law of the rate, where it changes, makes the stress at every sample."""
    rate, stress = np.abs(run.rate), run.stress * np.sign(run.rate)
    use = (rate > 0.0) & (stress > 0.0)
    if np.ptp(run.rate) < _NOTICEABLE * np.max(rate) or np.count_nonzero(use) < 3:
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


def _strained_before(run: Run) -> bool:
    if run.strain is None or run.rate_is_measured:
        return False
    off = abs(run.strain[0] - run.rate[0] * run.time[0])
    return bool(off > _NOT_MADE * float(np.max(np.abs(run.strain))))


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
    alike = early < max(3.0 * scatter, _TRANSIENT * size) and scatter < _NOTICEABLE * size
    return alike and abs(viscosity.imag) > _NOTICEABLE * abs(viscosity)


def _more_than_linear(run: Run, sweep: LinearSweep, spectrum: RelaxationSpectrum) -> bool:
    """Hold the first stress against Tr γ̇ (Σ G_k λ_k (1 − exp(−t/λ_k)) + η), η of what is faster.

    Tr is Trouton's ratio of the flow, 1 in shear.
    """
    modes = spectrum.modulus * spectrum.relaxation_time
    # what is faster than the sweep, a solvent too, is at most its smallest dynamic viscosity
    fast = float(np.min(sweep.loss_modulus / sweep.angular_frequency))
    linear = fast + float(-np.expm1(-float(run.time[0]) / spectrum.relaxation_time) @ modes)
    trouton = float(kinematics_of(run.flow).viscous)
    allowed = _LINEAR_FACTOR * trouton * abs(float(run.rate[0])) * linear
    return abs(float(run.stress[0])) > allowed + 5.0 * stress_noise(run)
