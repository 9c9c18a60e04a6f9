"""A steady flow before a run is steady however fast the fluid relaxes; laws by scipy."""

import numpy as np
import pytest
from independent import PhanThienTanner, steps

from discover.forward.fluids import solve_batch
from discover.forward.grids import lay_out, make_grid
from discover.laws import Fluid, make_law
from discover.protocols import after_steady_flow, start_up

BEFORE, AFTER = 20.0, 0.1
TIMES = np.geomspace(1e-3, 60.0, 60)


@pytest.mark.parametrize(
    ("time", "epsilon"),
    [pytest.param(0.036, 5.8, marks=pytest.mark.slow), (0.014, 8.3), (0.9, 0.5)],
)
def test_the_stress_before_a_step_is_that_of_the_steady_flow(time, epsilon):
    fluid = Fluid(make_law("ptt_linear", {"epsilon": epsilon}), 1.0, time)
    flow = after_steady_flow(start_up(AFTER), BEFORE, end=float(TIMES[-1]))
    found = np.asarray(solve_batch(fluid, lay_out([flow], [TIMES], relaxation_time=time)))[0, :, 3]
    law = PhanThienTanner(extensibility=epsilon, relaxation_time=time)
    held = 200.0 * time
    exact = law.respond(steps([0.0, held], [BEFORE, AFTER]), held + TIMES).sigma12
    # in steps of a strain of one throughout, the first case is off by 35 %
    np.testing.assert_allclose(found, exact, atol=2e-5 * exact[0])


@pytest.mark.parametrize("time", [0.03, 0.1, 0.5])
def test_a_law_that_thins_is_followed_through_the_flow_before_whatever_its_time(time):
    """In steps of a strain of one it ran away where it relaxes in 0.1 s or less."""
    law = make_law("ptt_linear", {"epsilon": 10.0})
    flow = after_steady_flow(start_up(AFTER), BEFORE, end=float(TIMES[-1]))
    found = np.asarray(solve_batch(Fluid(law, 1.0, time), lay_out([flow], [TIMES])))[0, :, 3]
    law = PhanThienTanner(extensibility=10.0, relaxation_time=time)
    held = 200.0 * time
    exact = law.respond(steps([0.0, held], [BEFORE, AFTER]), held + TIMES).sigma12
    np.testing.assert_allclose(found, exact, atol=1e-3 * exact[0])


@pytest.mark.parametrize(("time", "most", "strain"), [(None, 1400, 0.25), (6.0, 450, 1.0)])
def test_steady_flow_before_a_run_takes_some_hundred_steps(time, most, strain):
    flow = after_steady_flow(start_up(AFTER), BEFORE, end=float(TIMES[-1]))
    grid, _ = make_grid(flow, TIMES, relaxation_time=time)
    before = np.diff(grid[grid <= 0.0])
    assert before.size < most
    assert np.max(before) <= strain / BEFORE + 1e-12
