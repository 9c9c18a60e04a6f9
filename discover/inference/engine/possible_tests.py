"""Tests that could be run next, in the range of rates and times of those that were fitted."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from discover.dataset import Run
from discover.protocols import (
    FlowProtocol,
    after_steady_flow,
    after_step_strain,
    imposed_stress,
    in_flow,
    oscillatory_shear,
    start_up,
    steady_rates,
    step_rates,
)
from discover.protocols.kinematics import FOLLOWED
from discover.protocols.protocol import shear_rates

BEYOND = 3.0
"""How far the slowest and fastest test lie beyond the rates that were fitted."""

_SAMPLES = 101
_STATES = 25
_SHORTEST = 1e-3  # of a test: its first sample

# Strain of a start-up, which may be longer where relaxation asks for it; Hencky strain of extension
_STRAIN, _LONGEST_STRAIN, _HENCKY = 20.0, 100.0, 3.0
_RELAXED = 3.0

_AMPLITUDES, _CYCLES = (1.0, 5.0), 5.0
_STEPS = (0.5, 3.0)


@dataclass(frozen=True)
class PossibleTest:
    """A test that could be run.

    `title`: in words, with numbers. `run`: it, with zeros for what would be recorded.
    """

    title: str
    run: Run


def possible_tests(runs: Sequence[Run], relaxation_time: float) -> list[PossibleTest]:
    """Return tests of every kind, the simplest to run first; none without a run at a given rate.

    `relaxation_time`: the longest, in s.
    """
    at_rate = [run for run in runs if run.protocol.control in FOLLOWED]
    rates = [float(np.max(np.abs(run.rate))) for run in at_rate]
    rates = [rate for rate in rates if rate > 0.0]
    if not rates:
        return []
    slowest, fastest = min(rates), max(rates)
    whole = _duration(fastest, relaxation_time)
    even = np.linspace(0.0, whole, _SAMPLES)
    found = [
        _start_up(rate, _duration(rate, relaxation_time))
        for rate in sorted({slowest / BEYOND, slowest, fastest, BEYOND * fastest})
    ]
    found += [
        _test(
            f"start-up of shear at {fastest:.3g} 1/s, reversed after {0.5 * whole:.3g} s",
            step_rates([0.0, 0.5 * whole], [fastest, -fastest]),
            even,
        ),
        _test(
            f"start-up of shear at {fastest:.3g} 1/s, stopped for {whole / 3:.3g} s and begun "
            "again",
            step_rates([0.0, whole / 3, 2 * whole / 3], [fastest, 0.0, fastest]),
            even,
        ),
    ]
    after = np.geomspace(_SHORTEST * relaxation_time, _RELAXED * relaxation_time, _SAMPLES)
    stopped = after_steady_flow(start_up(0.0), fastest, end=float(after[-1]))
    found.append(_test(f"relaxation after steady shear at {fastest:.3g} 1/s", stopped, after))
    for strain in _STEPS:
        begun = after_step_strain(start_up(0.0), strain, first=float(after[0]))
        found.append(_test(f"relaxation after a step of strain of {strain:g}", begun, after))
    for amplitude in _AMPLITUDES:
        frequency = fastest / amplitude
        times = np.linspace(0.0, 2.0 * np.pi * _CYCLES / frequency, _SAMPLES)
        title = f"oscillatory shear of amplitude {amplitude:g} at {frequency:.3g} rad/s, from rest"
        found.append(_test(title, oscillatory_shear(fastest, frequency), times))
    states = np.geomspace(slowest / BEYOND, BEYOND * fastest, _STATES)
    found.append(
        _test(
            f"flow curve from {states[0]:.3g} to {states[-1]:.3g} 1/s",
            steady_rates(states),
            np.arange(1.0, _STATES + 1.0),
        )
    )
    if any(run.protocol.control == "stress" for run in runs):
        found += _creep(at_rate, relaxation_time)
    fast = _start_up(fastest, whole).run
    normal = replace(fast, first_normal_stress_difference=np.zeros(len(fast)))
    found.append(
        PossibleTest(f"N1 in start-up of shear at {fastest:.3g} 1/s", normal.observing("N1"))
    )
    for kind in ("uniaxial", "planar", "biaxial"):
        for rate in sorted({slowest, fastest}):
            found.append(
                _test(
                    f"start-up of {kind} extension at {rate:.3g} 1/s",
                    in_flow(start_up(rate), kind),
                    np.linspace(0.0, _HENCKY / rate, _SAMPLES),
                )
            )
    return found


def _duration(rate: float, relaxation_time: float) -> float:
    wanted = max(_STRAIN / rate, _RELAXED * relaxation_time)
    return min(wanted, _LONGEST_STRAIN / rate)


def _start_up(rate: float, duration: float) -> PossibleTest:
    times = np.geomspace(_SHORTEST * duration, duration, _SAMPLES)
    return _test(f"start-up of shear at {rate:.3g} 1/s", start_up(rate), times)


def _test(title: str, protocol: FlowProtocol, times: np.ndarray) -> PossibleTest:
    run = Run(
        title, times, protocol, np.asarray(shear_rates(protocol, times)), np.zeros(len(times))
    )
    return PossibleTest(title, run)


def _creep(runs: Sequence[Run], relaxation_time: float) -> list[PossibleTest]:
    """Return creep at the stress that the runs reach; none where they reach none."""
    stresses = [float(np.max(np.abs(run.stress))) for run in runs if run.flow == "shear"]
    rates = [float(np.max(np.abs(run.rate))) for run in runs if run.flow == "shear"]
    if not stresses or min(stresses) == 0.0:
        return []
    fastest = int(np.argmax(rates))
    stress = 0.5 * stresses[fastest]
    times = np.geomspace(_SHORTEST * relaxation_time, _RELAXED * relaxation_time, _SAMPLES)
    imposed = np.full(_SAMPLES, stress)
    # only sets the pace of integration, which a creep of unknown speed must not make endless
    strain = np.minimum(rates[fastest] * times, _STRAIN)
    run = Run(
        "creep", times, imposed_stress(times, imposed), np.zeros(_SAMPLES), imposed, strain=strain
    )
    return [PossibleTest(f"creep at {stress:.3g} Pa", run)]
