"""A steady flow before a run is steady however fast the fluid relaxes; laws by scipy."""

import numpy as np
import pytest
from independent import PhanThienTanner, steps

from discover.laws import Fluid, make_law
from discover.protocols import after_steady_flow, start_up
from discover.simulate import lay_out, make_grid, solve_batch

BEFORE, AFTER = 20.0, 0.1
TIMES = np.geomspace(1e-3, 60.0, 60)


@pytest.mark.parametrize(("time", "epsilon"), [(0.036, 5.8), (0.014, 8.3), (0.9, 0.5)])
def test_the_stress_before_a_step_is_that_of_the_steady_flow(time, epsilon):
    fluid = Fluid(make_law("ptt_linear", {"epsilon": epsilon}), 1.0, time)
    flow = after_steady_flow(start_up(AFTER), BEFORE, end=float(TIMES[-1]))
    found = np.asarray(solve_batch(fluid, lay_out([flow], [TIMES], relaxation_time=time)))[0, :, 3]
    law = PhanThienTanner(extensibility=epsilon, relaxation_time=time)
    held = 200.0 * time
    exact = law.respond(steps([0.0, held], [BEFORE, AFTER]), held + TIMES).sigma12
    # in steps of a strain of one throughout, the first case is off by 35 %
    np.testing.assert_allclose(found, exact, atol=2e-5 * exact[0])


def test_steady_flow_before_a_run_takes_no_more_than_some_hundred_steps():
    flow = after_steady_flow(start_up(AFTER), BEFORE, end=float(TIMES[-1]))
    grid, _ = make_grid(flow, TIMES)
    before = np.diff(grid[grid <= 0.0])
    assert before.size < 450
    assert np.max(before) <= 1.0 / BEFORE + 1e-12
