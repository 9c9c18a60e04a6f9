"""First normal stress differences that no fluid can have, told without any law."""

from collections.abc import Iterator, Sequence

import numpy as np
from jaxtyping import Float

from discover.dataset.checking.among_runs import is_start_up
from discover.dataset.checking.finding import Finding
from discover.dataset.linear_viscoelasticity import (
    LinearSweep,
    RelaxationSpectrum,
    relaxation_spectrum,
)
from discover.dataset.run import Run
from discover.errors import InputError

# Elastic limit: N1 = σ12 γ where all modes are still elastic, less later. Beyond this factor of it,
# or below zero by as much, the transducer speaks, not the fluid
_ELASTIC_FACTOR = 2.0
_SMALL_STRAIN = 0.5
# Second-order behaviour, N1 ∝ rate², holds below about this Weissenberg number, and of what it
# foretells a modulus and a time that are off leave this factor open
_SLOW, _SECOND_ORDER_FACTOR = 0.3, 3.0
# Laun's rule is one of experience, and holds to some ten per cent where Cox's and Merz's does
_COX_MERZ, _LAUN_FACTOR = 1.15, 2.0
_STEADY = 0.1  # most change of the stress in the last fifth


def doubts_of_normal_stress(
    run: Run, sweep: LinearSweep | None, spectrum: RelaxationSpectrum | None
) -> Iterator[Finding]:
    """Yield why the N1 of a start-up of shear cannot be right.

    Parameters
    ----------
    run
        Any run; nothing is said of one that is no start-up of shear with its N1.
    sweep, spectrum
        The linear sweep and its modes, without which a run is held against itself alone.
    """
    normal = run.first_normal_stress_difference
    if normal is None:
        return
    for reason in _reasons(run, normal, sweep, spectrum):
        yield Finding("warning", "N1", run.name, f"N1 in {run.name} {reason}")


def impossible_normal_stress(runs: Sequence[Run], sweep: LinearSweep | None) -> dict[str, str]:
    """Return why the N1 of runs cannot be right, by the names of runs of which that is so."""
    there = [(run, n1) for run in runs if (n1 := run.first_normal_stress_difference) is not None]
    spectrum = _spectrum(sweep) if there and sweep is not None else None
    found = {run.name: next(_reasons(run, n1, sweep, spectrum), None) for run, n1 in there}
    return {name: f"it {why.rstrip('.')}" for name, why in found.items() if why is not None}


def _spectrum(sweep: LinearSweep) -> RelaxationSpectrum | None:
    try:
        return relaxation_spectrum(sweep)
    except InputError:  # the check of the folder says why
        return None


def _reasons(
    run: Run,
    normal: Float[np.ndarray, " n"],
    sweep: LinearSweep | None,
    spectrum: RelaxationSpectrum | None,
) -> Iterator[str]:
    in_shear = run.protocol.control == "rate" and run.flow == "shear" and run.from_rest
    if not (in_shear and is_start_up(run)):
        return
    reasons = (
        _early(run, normal),
        _negative_end(run, normal),
        None if spectrum is None else _second_order(run, normal, spectrum),
        None if sweep is None else _laun(run, normal, sweep),
    )
    yield from (reason for reason in reasons if reason is not None)


def _end(run: Run, values: Float[np.ndarray, " n"]) -> float:
    return float(np.median(values[-max(3, len(run) // 10) :]))


def _early(run: Run, normal: Float[np.ndarray, " n"]) -> str | None:
    """Hold N1 against what elasticity allows in start-up from rest: 0 ≤ N1 ≤ σ12 γ, about.

    With every mode elastic N1 = σ12 γ (Lodge & Meissner 1972, Rheol. Acta 11, 351); relaxation
    only lowers it.
    """
    strain = abs(run.rate[0]) * run.time
    limit = np.abs(run.stress) * strain
    small = strain < _SMALL_STRAIN
    bad = (normal > _ELASTIC_FACTOR * limit) | (normal < -0.5 * limit)
    if np.sum(small) < 5 or np.mean(bad[small]) <= 0.3:
        return None
    until = run.time[np.flatnonzero(bad & small)[-1]]
    return (
        f"cannot be right early: {100 * np.mean(bad[small]):.0f} % of its samples below strain "
        f"{_SMALL_STRAIN:g} (the last at {until:.4g} s) are negative or above "
        f"{_ELASTIC_FACTOR:g} times stress × strain, the elastic limit. Do not judge a law by them."
    )


def _negative_end(run: Run, normal: Float[np.ndarray, " n"]) -> str | None:
    end = _end(run, normal)
    if end >= 0 or abs(run.rate[0]) * run.time[-1] <= _SMALL_STRAIN:
        return None
    return (
        f"ends negative ({end:.3g} Pa). Few fluids do that; check its sign and the baseline of the "
        "normal force."
    )


def _second_order(
    run: Run, normal: Float[np.ndarray, " n"], spectrum: RelaxationSpectrum
) -> str | None:
    """Hold the last N1 of a slow run against N1 = 2 γ̇² Σ G_k λ_k²   [Coleman & Markovitz 1964]."""
    moment = spectrum.mean_relaxation_time * spectrum.zero_shear_viscosity
    rate = abs(run.rate[0])
    if spectrum.elastic_modulus or rate * spectrum.mean_relaxation_time > _SLOW:
        return None
    end, most = _end(run, normal), 2.0 * moment * rate**2
    if 0 <= end <= _SECOND_ORDER_FACTOR * most:
        return None
    return (
        f"ends at {end:.3g} Pa; at this slow rate the linear sweep foretells a value between 0 and "
        f"{most:.3g} Pa, quadratic in the rate. The normal force is below what the transducer "
        "resolves, or has a baseline."
    )


def _laun(run: Run, normal: Float[np.ndarray, " n"], sweep: LinearSweep) -> str | None:
    """Hold a steady N1 against Laun's rule where Cox's and Merz's holds of the same run.

    N1 = 2G′(1 + (G′/G″)²)^0.7 and σ12 = |G*| at ω = γ̇   [Laun 1986, J. Rheol. 30, 459].
    """
    omega, rate = sweep.angular_frequency, abs(run.rate[0])
    tail = np.abs(run.stress[run.time > 0.8 * run.time[-1]])
    if not omega[0] <= rate <= omega[-1] or len(tail) < 3:
        return None
    if np.ptp(tail) > _STEADY * np.median(tail):
        return None
    storage, loss = (
        float(np.exp(np.interp(np.log(rate), np.log(omega), np.log(np.maximum(values, 1e-300)))))
        for values in (sweep.storage_modulus, sweep.loss_modulus)
    )
    ratio = float(np.median(tail)) / np.hypot(storage, loss)
    if not 1.0 / _COX_MERZ < ratio < _COX_MERZ:
        return None
    end, rule = _end(run, normal), 2.0 * storage * (1.0 + (storage / loss) ** 2) ** 0.7
    if rule / _LAUN_FACTOR <= end <= rule * _LAUN_FACTOR:
        return None
    return (
        f"ends at {end:.3g} Pa where Laun's rule has {rule:.3g} Pa, though the stress of the same "
        "run follows the rule of Cox and Merz. A baseline, or a gap that gives way, does that."
    )
