"""Start-ups of fluids of several Giesekus modes by scipy, with white noise."""

from collections.abc import Sequence

import numpy as np
from independent import multimode_giesekus
from independent import start_up as flow

from discover.dataset import Run
from discover.protocols import start_up

NOISE = 0.01
"""Relative size."""


def noisy_start_ups(
    mobilities: Sequence[float],
    moduli: Sequence[float],
    relaxation_times: Sequence[float],
    rates: Sequence[float],
    longest: float,
    seed: int,
) -> list[Run]:
    """Return a run at each rate, which lasts `longest` over the root of the rate, in s."""
    generator, runs = np.random.default_rng(seed), []
    fluid = multimode_giesekus(mobilities, moduli, relaxation_times)
    for rate in rates:
        times = np.geomspace(0.02, longest, 50) / np.sqrt(rate)
        stress = fluid.respond(flow(rate), times).sigma12
        size = NOISE * np.sqrt(np.mean(stress**2))
        stress = stress + size * generator.standard_normal(len(times))
        runs.append(Run(f"{rate}", times, start_up(rate), np.full(len(times), rate), stress))
    return runs
