"""Giesekus fluids behind an instrument, by scipy: nothing here is the software's own."""

import numpy as np
from independent import Giesekus, oscillation, start_up
from independent.flow import of_rate
from independent.noise import white

from discover.dataset import Dataset, Run
from discover.protocols.protocol import oscillatory_shear
from discover.protocols.protocol import start_up as commanded_start_up

MOBILITY, NOISE = 0.3, 0.01


def oscillations(gain: float, offset: float = 0.0) -> Dataset:
    """Return four oscillations whose stress is recorded with a gain, in 1 % noise."""
    times = np.linspace(0.0, 16.0, 81)
    rng, runs = np.random.default_rng(0), []
    for amplitude, frequency in ((1.0, 0.5), (2.0, 0.5), (1.0, 1.0), (2.0, 1.0)):
        flow = oscillation(amplitude, frequency)
        stress = gain * Giesekus(MOBILITY).respond(flow, times).sigma12 + offset
        recorded = white(stress, NOISE, rng)
        protocol = oscillatory_shear(amplitude, frequency)
        name = f"Wi {amplitude:g}, De {frequency:g}"
        runs.append(Run(name, times, protocol, np.asarray(flow.rate(times)), recorded))
    return Dataset("planted", tuple(runs))


def slow_start_ups(rise_time: float, noise: float = 0.0) -> Dataset:
    """Return start-ups of a motor that needs time, with the commanded rate as what is known."""
    times = np.geomspace(0.02, 8.0, 40)
    rng, runs = np.random.default_rng(1), []
    for rate in (0.5, 2.0):
        felt = of_rate(lambda t, r=rate: r * -np.expm1(-np.asarray(t) / rise_time), 8.0)
        stress = Giesekus(MOBILITY).respond(felt, times).sigma12
        stress = white(stress, noise, rng)
        commanded = np.asarray(start_up(rate).rate(times))
        runs.append(Run(f"{rate:g}", times, commanded_start_up(rate), commanded, stress))
    return Dataset("slow motor", tuple(runs))
