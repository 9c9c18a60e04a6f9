"""Start-ups with white noise of fluids that share no code with ours."""

import numpy as np
from independent import start_up as flow_at
from independent.noise import white

import discover as dc


def run_at(rate, times, stress, name="", **more):
    """Return a start-up of this record, called by its rate unless it has a name."""
    rates = np.full(len(times), rate)
    return dc.Run(name or f"{rate:g}", times, dc.start_up(rate), rates, stress, **more)


def start_ups(law, rates, times, noise=0.01, seed=0, factor=1.0, names=None):
    """Return a start-up at each rate, with noise of one seed drawn in turn."""
    lot, runs = np.random.default_rng(seed), []
    for rate, name in zip(rates, names or [""] * len(rates), strict=True):
        stress = white(factor * law.respond(flow_at(rate), times).sigma12, noise, lot)
        runs.append(run_at(rate, times, stress, name))
    return dc.Dataset("start-ups", tuple(runs))
