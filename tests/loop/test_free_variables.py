"""Of what a free function of the record may be one: where the tool stands, and in its cycle."""

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson

import discover as dc
from discover.closed_loop.beyond.free_variables import Variables, columns, spline

TIMES = np.linspace(0.05, 12.0, 121)


def run(rate):
    rate = rate + 0.0 * TIMES
    strain = cumulative_simpson(rate, x=TIMES, initial=0.0)
    return dc.Run("run", TIMES, dc.start_up(1.0), rate, 1.0 + 0.0 * TIMES, strain=strain)


def at(slot, *runs):
    return Variables(runs, len(TIMES)).at(slot, np.ones((len(runs), len(TIMES))))


def test_the_phase_begins_where_the_rate_is_largest_and_a_start_up_has_none():
    phase = at("phase", run(2.0 * np.cos(1.3 * TIMES - 0.4)), run(1.0))
    np.testing.assert_allclose(phase[0], np.mod(1.3 * TIMES - 0.4, 2.0 * np.pi), atol=2e-3)
    assert np.all(np.isnan(phase[1]))


def test_a_curve_in_the_cycle_closes_and_leaves_start_ups_alone():
    values = at("phase", run(2.0 * np.cos(TIMES)), run(1.0))
    splines = spline("phase", 6, values.ravel())
    ends = splines.transform(np.array([[0.0], [2.0 * np.pi]]))
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-12)
    changed = columns("phase", splines, values, np.full(values.shape, 7.0))
    assert not np.any(changed[1])
    np.testing.assert_allclose(changed[0].sum(axis=1), 1.0)  # B-splines add up to one


def test_a_factor_is_one_on_the_stress():
    values = at("gap", run(2.0 * np.cos(TIMES)))
    changed = columns("gap", spline("gap", 6, values.ravel()), values, np.full(values.shape, 7.0))
    np.testing.assert_allclose(changed.sum(axis=-1), 7.0)


@pytest.mark.parametrize(
    ("rate", "told"),
    [(1.0, set()), (2.0 * np.cos(TIMES), {"gap", "phase"}), (1.0 - 0.25 * TIMES, {"gap"})],
    ids=["forward", "waves", "turns back"],
)
def test_nothing_is_asked_that_the_runs_cannot_tell(rate, told):
    # where no tool turns back a wobble of the gap is a loss by strain
    slots = set(Variables([run(rate)], len(TIMES)).slots)
    assert slots & {"gap", "phase"} == told
    assert {"recorded_stress", "drift", "rate", "network", "position"} <= slots
