"""Lissajous curves are of one cycle, whether a rate was commanded by a formula or measured."""

import numpy as np
import pytest

from discover.comparison.flows import Flow
from discover.protocols import measured_rate, oscillatory_shear
from discover.report.plots.comparison.flows import last_cycle

TIMES = np.linspace(0.0, 31.4, 1001)


@pytest.mark.parametrize("measured", [True, False])
def test_the_last_cycle_is_one_period_long(measured):
    rate = 2.0 * np.cos(1.5 * TIMES)
    noisy = rate + 0.02 * np.random.default_rng(0).standard_normal(TIMES.size)
    flow = measured_rate(TIMES, noisy) if measured else oscillatory_shear(2.0, 1.5)
    seen = noisy if measured else rate
    last = last_cycle(Flow("a", "held_out", flow, TIMES, seen, {}, oscillatory=True))
    period = 2.0 * np.pi / 1.5
    assert np.ptp(TIMES[last]) == pytest.approx(1.02 * period, rel=0.03)
    assert last[-1]


def test_a_rate_that_does_not_oscillate_is_shown_whole():
    rate = np.full(TIMES.size, 2.0)
    flow = Flow("a", "held_out", measured_rate(TIMES, rate), TIMES, rate, {}, oscillatory=True)
    assert np.all(last_cycle(flow))
