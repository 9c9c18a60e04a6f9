"""Runs in words and numbers, one line each."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.optimize import fminbound

from discover.dataset.run import SLOWEST_RATE, Run
from discover.protocols.control import jumps_at_start
from discover.protocols.kinematics import STATES

# share of the squared rate that its first harmonic must make up; the rest are higher harmonics,
# many where the stress was commanded, and noise
_PERIODIC = 0.7
_ONE_CYCLE = 0.95  # one cycle alone: a step to the other side, which is none, has 0.81
_VARYING = "varying rate"


def run_line(run: Run) -> dict[str, Any]:
    """Return what a reader asks first of a run; frequency (rad/s) and amplitude where it swings."""
    flow = _flow(run)
    wave = oscillation(run) if flow in (_VARYING, "given stress") else None
    if wave and flow == _VARYING:
        flow = "oscillation" if run.from_rest else "periodic steady state"
    normal = (run.first_normal_stress_difference, run.second_normal_stress_difference)
    return {
        "run": run.name,
        "flow": flow,
        "samples": len(run),
        # of states, time counts the samples
        "duration_s": None if run.protocol.control in STATES else float(run.time[-1]),
        "largest_rate_1_s": float(np.max(np.abs(run.rate))),
        "frequency_rad_s": wave[0] if wave else None,
        "strain_amplitude": wave[1] / wave[0] if wave else None,
        "largest_stress_Pa": float(np.max(np.abs(run.stress))),
        "N1": normal[0] is not None,
        "N2": normal[1] is not None,
    }


def _flow(run: Run) -> str:
    if run.protocol.control == "steady":
        return "flow curve"
    if run.protocol.control == "oscillation":
        linear = str(run.metadata.get("test", "")).startswith("linear")
        return "frequency sweep" if linear else "amplitude sweep"
    if run.protocol.control == "stress":
        return "creep" if jumps_at_start(run.protocol) else "given stress"
    if not run.flows:
        return "rest"
    size = max(float(np.max(np.abs(run.rate))), abs(run.rate_before), SLOWEST_RATE)
    jumps = np.count_nonzero(np.abs(np.diff(run.rate)) > 1e-6 * size)
    if jumps > len(run) // 4:
        return _VARYING
    if jumps:
        return "steps of rate"
    if abs(run.rate[0]) <= 1e-6 * size or np.max(np.abs(run.rate)) <= SLOWEST_RATE:
        return "cessation" if run.rate_before or run.from_rest else "relaxation after a step strain"
    kind = "step of rate" if run.rate_before else "start-up"
    return kind if run.flow == "shear" else f"{run.flow} extension, {kind}"


def oscillation(run: Run) -> tuple[float, float] | None:
    """Return frequency (rad/s) and amplitude (1/s) of a rate that alternates about zero."""
    return wave_of(run.time, run.rate)


def wave_of(
    time: Float[np.ndarray, " n"], rate: Float[np.ndarray, " n"]
) -> tuple[float, float] | None:
    """Return frequency (rad/s) and amplitude (1/s) of a rate in samples, if it alternates."""
    clear = np.flatnonzero(np.abs(rate) > 0.1 * np.max(np.abs(rate)))  # noise turns often near zero
    turns = np.flatnonzero(np.diff(np.sign(rate[clear])) != 0)
    if not turns.size:
        return None
    least = _PERIODIC
    if turns.size == 1:  # one cycle alone, which begins and ends at rest
        about, least = 2.0 * np.pi / (time[-1] - time[0]) * (1.0 - 1.0 / len(time)), _ONE_CYCLE
    else:
        zeros = 0.5 * (time[clear[turns]] + time[clear[turns + 1]])
        about = np.pi * (turns.size - 1) / (zeros[-1] - zeros[0])

    def fitted(frequency: float) -> tuple[np.ndarray, np.ndarray]:
        angle = frequency * time
        waves = np.stack([np.cos(angle), np.sin(angle), np.ones_like(angle)], axis=1)
        found, *_ = np.linalg.lstsq(waves, rate, rcond=None)
        return found, rate - waves @ found

    def misfit(frequency: float) -> float:
        return float(np.sum(fitted(frequency)[1] ** 2))

    best = fminbound(misfit, 0.8 * about, 1.2 * about, xtol=1e-9 * about)
    frequency = np.asarray(best).item()
    found, left = fitted(frequency)
    amplitude = float(np.hypot(found[0], found[1]))
    if left @ left > (1.0 - least) * (rate @ rate) or abs(found[2]) > 0.2 * amplitude:
        return None
    return frequency, amplitude


_MATERIAL = ("material", "sample", "sample_label")


def temperature_of(runs: Iterable[Run]) -> float | None:
    """Temperature of runs in °C, rounded; None where they have several, or are shifted."""
    found = set()
    for run in runs:
        if run.temperature_C is None or run.clock_factor != 1.0:
            return None
        found.add(float(round(run.temperature_C, 0)))
    return found.pop() if len(found) == 1 else None


def material_and_temperature(runs: Iterable[Run], material: str = "", otherwise: str = "") -> str:
    """Material (a study's, of runs.csv, or `otherwise`) and temperature of runs in words."""
    names, temperatures = [], set()
    for run in runs:
        names += [str(run.metadata[key]) for key in _MATERIAL if run.metadata.get(key)][:1]
        temperatures |= set() if run.temperature_C is None else {round(run.temperature_C, 0)}
    parts = [material] if material else list(dict.fromkeys(names))
    if otherwise and not 0 < len(parts) <= 2:
        parts = [otherwise]
    if len(parts) > 2:  # names of fillings or files, which say nothing in a title
        parts = [f"{len(parts)} samples"]
    spelled = [f"{value:.0f}".replace("-", "−") for value in sorted(temperatures)]
    if len(spelled) > 2:
        spelled = [f"{spelled[0]} to {spelled[-1]}"]
    return ", ".join([*parts, *([f"{' and '.join(spelled)} °C"] if spelled else [])])
