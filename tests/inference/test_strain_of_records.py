"""The strain that a free function depends on: of what flowed, and of a step before the record."""

import numpy as np
import pytest

import discover as dc
from discover.forward import DeclaredModel
from discover.inference.engine import Problem
from discover.inference.engine.closed_forms import integrated_rate
from discover.inference.engine.variables import variables

TIMES = np.linspace(0.1, 4.0, 40)


def run(step: float, rate: float, duration: float = 0.0) -> dc.Run:
    flow = dc.after_step_strain(dc.start_up(rate), step, first=float(TIMES[0]), duration=duration)
    stress = step * np.exp(-TIMES)
    return dc.Run(f"{step:g}", TIMES, flow, np.full(len(TIMES), rate), stress)


@pytest.mark.parametrize("duration", [0.0, 0.2])
def test_a_step_of_strain_before_the_record_counts_as_strain(duration):
    # in closed form: the step, and a constant rate times time from then on
    np.testing.assert_allclose(integrated_rate(run(2.0, 3.0, duration)), 2.0 + 3.0 * TIMES)


def test_a_steady_flow_before_a_record_adds_no_strain_and_every_variable_is_a_number():
    flow = dc.after_steady_flow(dc.start_up(0.0), rate=5.0, end=4.0)
    one = dc.Run("a", TIMES, flow, np.zeros(len(TIMES)), np.exp(-TIMES), rate_before=5.0)
    np.testing.assert_array_equal(integrated_rate(one), 0.0)
    problem = Problem(DeclaredModel.maxwell([1.0], [1.0]), [], [run(0.5, 0.0), run(2.0, 0.0)])
    found = {one.slot: one for one in variables(problem.fitted)}
    assert found["network"].largest == 2.0
    for one in found.values():
        columns = one.columns(problem.fitted.recorded)
        assert np.all(np.isfinite(columns))
