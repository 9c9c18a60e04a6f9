"""A loop beside a sweep excuses what its moduli can change, and no mode beyond it: closed forms."""

import numpy as np
import pytest

from discover.loop import DeclaredModel, run_loop
from discover.dataset import Dataset, LinearSweep, Run, relaxation_spectrum
from discover.protocols import start_up

TIMES = np.geomspace(0.02, 8.0, 80)
MODES = ((20.0, 10.0), (60.0, 1.0))


def spectrum():
    """Modes that a sweep of 0.02 to 2 rad/s with 2 % of noise tells."""
    lot, omega = np.random.default_rng(3), np.geomspace(0.02, 2.0, 24)
    moduli = sum(g * 1j * omega * t / (1 + 1j * omega * t) for g, t in MODES)
    rough = 1 + 0.02 * lot.standard_normal((2, len(omega)))
    return relaxation_spectrum(LinearSweep(omega, moduli.real * rough[0], moduli.imag * rough[1]))


def verdict(further=()):
    """Return what a loop says of start-ups with 0.5 % of noise, with modes beyond the sweep."""
    lot, told, runs = np.random.default_rng(1), spectrum(), []
    for rate in (0.3, 1.0, 3.0):
        exact = sum(g * t * rate * -np.expm1(-TIMES / t) for g, t in (*MODES, *further))
        stress = exact + 0.005 * np.sqrt(np.mean(exact**2)) * lot.standard_normal(len(TIMES))
        rates = np.full(len(TIMES), rate)
        runs.append(Run(f"{rate:g}", TIMES, start_up(rate), rates, stress))
    declared = DeclaredModel.maxwell(
        told.modulus,
        told.relaxation_time,
        linear_error=told.relative_error,
        linear_pattern=told.pattern,
        modulus_covariance=told.modulus_covariance,
    )
    return run_loop(
        Dataset("runs", tuple(runs)), declared, effects=["giesekus_mobility"], explanations=1
    )


def test_a_mode_beyond_the_sweep_is_not_put_down_to_its_error():
    assert verdict().verdict == "no_effect_needed"
    found = verdict([(20.0, 0.1)])
    assert found.error_after.fit < 1.5 * spectrum().relative_error  # which would excuse it
    assert found.verdict == "unexplained"
    assert "the error of the sweep does not excuse" in found.remaining["description"]
