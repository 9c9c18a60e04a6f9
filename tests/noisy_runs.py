"""Records with white noise, drawn in turn, of fluids that share no code with ours."""

import numpy as np
from independent import oscillation
from independent import start_up as flow_at
from independent.noise import white

import discover as dc

THREE_DECADES = np.geomspace(0.1, 100.0, 31)


def run_at(rate, times, stress, name="", **more):
    """Return a start-up of this record, called by its rate unless it has a name."""
    rates = np.full(len(times), rate)
    return dc.Run(name or f"{rate:g}", times, dc.start_up(rate), rates, stress, **more)


def run_of_wave(amplitude, frequency, times, stress, name=""):
    """Return an oscillation of the rate from rest with this record."""
    flow, rates = dc.oscillatory_shear(amplitude, frequency), amplitude * np.cos(frequency * times)
    return dc.Run(name or f"{amplitude:g}_{frequency:g}", times, flow, rates, stress)


def sweep(
    modulus, time, solvent=0.0, elastic=0.0, noise=0.0, seed=0, inertia=0.0,
    omega=THREE_DECADES,
):  # fmt: skip
    """Return a linear sweep of modes, a solvent, an elastic constant and inertia left in it."""
    x = 1j * omega[:, None] * np.asarray(time)
    moduli = (x / (1.0 + x)) @ np.asarray(modulus) + elastic
    moduli = moduli + 1j * omega * solvent - inertia * omega**2
    off = 1.0 + noise * np.random.default_rng(seed).standard_normal((2, len(omega)))
    return dc.LinearSweep(omega, moduli.real * off[0], moduli.imag * off[1])


def start_ups(law, rates, times, noise=0.01, seed=0, factor=1.0, names=None):
    """Return a start-up at each rate."""
    lot, runs = np.random.default_rng(seed), []
    for rate, name in zip(rates, names or [""] * len(rates), strict=True):
        stress = white(factor * law.respond(flow_at(rate), times).sigma12, noise, lot)
        runs.append(run_at(rate, times, stress, name))
    return dc.Dataset("start-ups", tuple(runs))


def waves(law, amplitudes, times, noise=0.01, seed=0, factor=1.0):
    """Return an oscillation for each pair of an amplitude in 1/s and a frequency in rad/s."""
    lot, runs = np.random.default_rng(seed), []
    for pair in amplitudes:
        stress = white(factor * law.respond(oscillation(*pair), times).sigma12, noise, lot)
        runs.append(run_of_wave(*pair, times, stress))
    return dc.Dataset("oscillations", tuple(runs))
