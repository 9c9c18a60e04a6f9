"""First normal stress differences that no fluid can have, told without any law."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.integrate import cumulative_trapezoid

from discover.dataset.checking.runs import Finding, is_start_up, local_noise, steady_stress
from discover.dataset.linear_viscoelasticity import (
    LinearSweep,
    RelaxationSpectrum,
    relaxation_spectrum,
)
from discover.dataset.run import Run
from discover.errors import InputError

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
# Laun's rule is one of experience, and holds to some ten per cent where Cox's and Merz's does
_COX_MERZ, _LAUN_FACTOR = 1.15, 2.0

Values = Float[np.ndarray, " n"]


def doubts_of_normal_stress(
    run: Run, sweep: LinearSweep | None, spectrum: RelaxationSpectrum | None
) -> Iterator[Finding]:
    """Yield why the N1 of a start-up of shear cannot be right; nothing of any other run.

    `sweep`, `spectrum`: without them a run is held against itself alone.
    """
    for fault in _faults(run, sweep, spectrum):
        yield Finding("warning", "N1", run.name, f"N1 in {run.name} {fault.why}")


class _Fault(NamedTuple):
    """Why an N1 cannot be right."""

    why: str  # the rest of a sentence that begins with the record, and what to do
    until: float = np.inf  # time in s from which on the record may be right, if ever


def sound_normal_stress(
    runs: Sequence[Run], sweep: LinearSweep | None
) -> tuple[dict[str, float], dict[str, str]]:
    """Return from when on, in s, the N1 of runs may be right, and why of those that never are.

    By name of the run. Runs without N1, or of which nothing can be said, are in neither.
    """
    there = [run for run in runs if run.first_normal_stress_difference is not None]
    spectrum = None
    if there and sweep is not None:
        with suppress(InputError):  # the check of the folder says why
            spectrum = relaxation_spectrum(sweep)
    late: dict[str, float] = {}
    never: dict[str, str] = {}
    for run in there:
        faults = list(_faults(run, sweep, spectrum))
        lasting = [fault for fault in faults if fault.until == np.inf]
        if lasting:
            never[run.name] = f"it {lasting[0].why.rstrip('.')}"
        elif faults:
            late[run.name] = faults[0].until
    return late, never


def _faults(
    run: Run, sweep: LinearSweep | None, spectrum: RelaxationSpectrum | None
) -> Iterator[_Fault]:
    normal = run.first_normal_stress_difference
    in_shear = run.protocol.control == "rate" and run.flow == "shear" and run.from_rest
    if normal is None or not (in_shear and is_start_up(run)):
        return
    if (early := _early(run, normal)) is not None:
        yield early
    rate, end = abs(float(run.rate[0])), float(np.median(normal[-max(3, len(run) // 10) :]))
    if end < 0 and rate * run.time[-1] > _SMALL_STRAIN:
        yield _Fault(
            f"ends negative ({end:.3g} Pa). Few fluids do that; check its sign and the baseline of "
            "the normal force."
        )
    lasting = (
        None if spectrum is None else _second_order(rate, end, spectrum),
        None if sweep is None else _laun(run, rate, end, sweep),
    )
    yield from (_Fault(why) for why in lasting if why is not None)


def _averaged(values: Values, width: int) -> Float[np.ndarray, " _"]:
    """Return means over so many samples around each; at an end those of the last whole window."""
    means = np.mean(np.lib.stride_tricks.sliding_window_view(values, width), axis=1)
    return np.pad(means, (width // 2, width - 1 - width // 2), mode="edge")


def _early(run: Run, normal: Values) -> _Fault | None:
    """Hold N1 against what elasticity allows in start-up from rest.

    With every mode elastic N1 = σ12 γ (Lodge & Meissner 1972, Rheol. Acta 11, 351); relaxation
    only lowers it. At small strain any fluid with memory has N1 = 2 γ̇² ∫ s G(s) ds and
    σ12 = γ̇ ∫ G(s) ds (Bird, Armstrong & Hassager 1987, vol. 1, ch. 6), so that
    N1 = 2 γ̇ (t σ12 − ∫ σ12 dt), whatever its G and its solvent.
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
    error = np.hypot(local_noise(run.time, normal), local_noise(run.time, stress) * strain)
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
    return _Fault(
        f"cannot be right early, up to {until:.4g} s (strain {strain[last]:.2g}): by more than "
        f"its noise it is negative, above {_ELASTIC_FACTOR:g} times stress × strain, the elastic "
        "limit, or below half of what the stress predicts. The normal force lags, gives way or "
        "has a baseline. "
        + (
            "Nothing is left of it."
            if lasts
            else "These samples are neither fitted nor used as a test."
        ),
        np.inf if lasts else until,
    )


def _second_order(rate: float, end: float, spectrum: RelaxationSpectrum) -> str | None:
    """Hold the last N1 of a slow run against N1 = 2 γ̇² Σ G_k λ_k²   [Coleman & Markovitz 1964]."""
    moment = spectrum.mean_relaxation_time * spectrum.zero_shear_viscosity
    most = 2.0 * moment * rate**2
    if spectrum.elastic_modulus or rate * spectrum.mean_relaxation_time > _SLOW:
        return None
    return None if 0 <= end <= _SECOND_ORDER_FACTOR * most else (
        f"ends at {end:.3g} Pa; at this slow rate the linear sweep predicts a value between 0 and "
        f"{most:.3g} Pa, quadratic in the rate. The normal force is below what the transducer "
        "resolves, or has a baseline."
    )  # fmt: skip


def _laun(run: Run, rate: float, end: float, sweep: LinearSweep) -> str | None:
    """Hold a steady N1 against Laun's rule where Cox's and Merz's holds of the same run.

    N1 = 2G′(1 + (G′/G″)²)^0.7 and σ12 = |G*| at ω = γ̇   [Laun 1986, J. Rheol. 30, 459].
    """
    omega, steady = sweep.angular_frequency, steady_stress(run)
    if steady is None or not omega[0] <= rate <= omega[-1]:
        return None
    storage, loss = (
        float(np.exp(np.interp(np.log(rate), np.log(omega), np.log(np.maximum(values, 1e-300)))))
        for values in (sweep.storage_modulus, sweep.loss_modulus)
    )
    rule = 2.0 * storage * (1.0 + (storage / loss) ** 2) ** 0.7
    if not 1.0 / _COX_MERZ < steady / np.hypot(storage, loss) < _COX_MERZ:
        return None
    return None if rule / _LAUN_FACTOR <= end <= rule * _LAUN_FACTOR else (
        f"ends at {end:.3g} Pa where Laun's rule has {rule:.3g} Pa, though the stress of the same "
        "run follows the rule of Cox and Merz. A baseline, or a gap that gives way, does that."
    )  # fmt: skip
