"""Records that began before their first sample: no effect is named for what came before."""

from dataclasses import replace

import numpy as np
import pytest
from independent import Modes, UpperConvectedMaxwell
from independent.instruments import relaxation_as_run

from discover.loop import DeclaredModel, run_loop
from discover.dataset import Dataset, Run
from discover.dataset.checking.start import doubts_of_start
from discover.protocols import measured_rate

TIMES = np.geomspace(0.01, 5.0, 100)
RAMP = 0.02
MODES = Modes(UpperConvectedMaxwell(100.0, 1.0), UpperConvectedMaxwell(60.0, 0.1))
DECLARED = DeclaredModel.maxwell(100.0, 1.0)
TO_FIT = replace(DECLARED, fit_modulus=True, fit_relaxation_time=True)


def step(strain, told=True, times=TIMES):
    """Return the record of a ramp of strain that began at t = 0, read from the first sample on."""
    made = strain * -np.expm1(-times / RAMP)
    rate = strain / RAMP * np.exp(-times / RAMP)
    exact = relaxation_as_run(MODES, strain, RAMP, times).stress
    noise = 0.01 * np.sqrt(np.mean(exact**2))
    stress = exact + noise * np.random.default_rng(int(1e4 * strain)).standard_normal(len(times))
    flow = measured_rate(times, rate)
    return Run(f"step_{strain}", times, flow, rate, stress, strain=made if told else None)


def loop(*runs):
    return run_loop(
        Dataset("steps", runs), TO_FIT, effects=["relaxation_mode", "solvent_viscosity"],
        max_effects=2,
    )  # fmt: skip


def test_strain_that_was_there_before_the_first_sample_is_doubted():
    assert "strain recorded" in str(next(doubts_of_start(step(0.03)), ""))
    assert not list(doubts_of_start(step(0.03, told=False)))
    # sampled from the beginning on, the strain is what the rate made
    early = np.geomspace(1e-4, 5.0, 200)
    assert not list(doubts_of_start(step(0.03, times=early)))


@pytest.mark.slow
@pytest.mark.parametrize("told", [True, False])
def test_an_effect_that_may_be_what_came_before_is_not_believed(told):
    result = loop(step(0.03, told), step(0.06, told))
    assert "relaxation_mode" in [stage.effect for stage in result.stages]
    assert result.verdict == ("unexplained" if told else "effects_added")
    reason = "cannot have started from rest" in result.remaining["description"]
    assert reason == told
