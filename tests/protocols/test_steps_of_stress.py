"""Steps of an imposed stress: told from a stress that only goes fast, small ones too."""

import numpy as np
import pytest

from discover.forward.grids.stress_grid import stress_grid
from discover.protocols import imposed_stress
from discover.protocols.control import jumps_at_start

TIMES = np.linspace(0.1, 15.0, 150)
LEVELS = np.array([6.0, 14.0, 24.0, 36.0, 60.0])


def jumps(protocol) -> list[float]:
    """Times after which the stress is another within a thousandth of a sample."""
    times = np.asarray(protocol.table_times)
    return [round(float(t), 2) for t in times[:-1][np.diff(times) < 1e-3]]


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_a_staircase_of_stress_is_made_of_jumps(noise):
    staircase = LEVELS[np.minimum((TIMES - 0.05) // 3.0, 4).astype(int)]
    wobble = noise * staircase * np.random.default_rng(0).standard_normal(150)
    found = imposed_stress(TIMES, staircase + wobble)
    assert jumps_at_start(found)
    # after the last sample at the old stress; the first one ends at 0
    assert [t for t in jumps(found) if t > 0.05] == [3.0, 6.0, 9.0, 12.0]


def test_a_jump_after_rest_is_none_at_the_start_and_times_in_decades_are_none():
    later = imposed_stress(TIMES, np.where(TIMES > 5.0, 20.0, 0.0))
    assert jumps(later) == [5.0]
    assert not jumps_at_start(later)
    decades = np.geomspace(1e-3, 100.0, 60)  # as short at first as a jump is at the end
    found = imposed_stress(decades, np.sqrt(decades))
    assert not jumps_at_start(found)
    # a jump would add its own steps, and those that follow it
    assert len(stress_grid(found, decades)) < 2 * len(found.table_times)


def test_a_wave_of_stress_is_smooth_between_its_samples_on_both_sides_of_a_jump():
    def truth(times):
        return 5.0 * np.sin(2.0 * times) + np.where(times > 7.55, 10.0, 0.0)

    found = imposed_stress(TIMES, truth(TIMES))
    assert jumps(found) == [7.5]
    dense = np.linspace(0.1, 15.0, 3001)
    dense = dense[np.abs(dense - 7.55) > 0.06]
    missed = np.interp(dense, found.table_times, found.table_rates) - truth(dense)
    straight = np.interp(dense, TIMES, truth(TIMES)) - truth(dense)
    # 31 samples a cycle: straight lines cut 1 − cos of half the phase between them off its crests
    assert np.max(np.abs(straight)) == pytest.approx(5.0 * (1.0 - np.cos(0.1)), rel=0.02)
    assert np.max(np.abs(missed)) < 0.5 * np.max(np.abs(straight))
    # and the impulse of each crest is kept
    crest = dense < 1.5
    lost = [np.trapezoid(each[crest], dense[crest]) for each in (missed, straight)]
    assert abs(lost[0]) < 0.05 * abs(lost[1])


@pytest.mark.parametrize(
    "stress",
    [60.0 * np.sin(TIMES), 60.0 * np.sin(12.0 * TIMES), 4.0 * TIMES, 30.0 * TIMES**0.5],
    ids=["slow wave", "five samples a cycle", "ramp", "bent ramp"],
)
def test_a_stress_that_only_goes_fast_does_not_jump(stress):
    found = imposed_stress(TIMES, stress)
    assert not jumps_at_start(found)
    assert jumps(found) == []
