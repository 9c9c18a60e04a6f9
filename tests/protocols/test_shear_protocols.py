"""Rates, strains and stresses that are imposed: integrals, jumps and waves."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad

from discover import protocols
from discover.errors import InputError
from discover.forward.grid import stress_grid
from discover.protocols.control import jumps_at_start

FLOWS = {
    "oscillatory": protocols.oscillatory_shear(2.0, 0.7, 0.3),
    "start-up": protocols.start_up(1.5),
    "steps": protocols.step_rates([0.0, 1.0, 2.5], [1.0, -2.0, 0.5]),
    "measured": protocols.measured_rate([0.2, 0.9, 3.0], [0.0, 1.0, 0.4]),
}


@pytest.mark.parametrize("flow", FLOWS.values(), ids=FLOWS.keys())
def test_strain_is_the_integral_of_the_rate(flow):
    def rate(t):
        return protocols.shear_rates(flow, np.array([t])).item()

    times = np.array([0.1, 0.95, 2.5, 4.0])
    expected = [quad(rate, 0, t, points=[0.2, 0.9, 1.0], limit=200)[0] for t in times]
    assert protocols.strains(flow, times) == pytest.approx(expected, abs=1e-6)


def test_a_step_takes_its_new_rate_at_the_jump_and_the_paper_has_eight_flows_and_three():
    flow = FLOWS["steps"]
    rates = [float(flow.rate(jnp.array(t))) for t in (0.0, 0.999, 1.0, 2.499, 2.5, 9.0)]
    assert rates == [1.0, 1.0, -2.0, -2.0, 0.5, 0.5]
    training, tests = protocols.paper_training_protocols(), protocols.paper_test_protocols()
    assert len(training) == 8
    assert set(tests) == {"laos_3_1.5", "laos_2_1", "startup_2"}
    assert float(training["laos_2_0.25"].rate(jnp.array(0.0))) == 2.0


@pytest.mark.parametrize(
    "make",
    [
        lambda: protocols.oscillatory_shear(1.0, 0.0),
        lambda: protocols.oscillatory_shear(float("nan"), 1.0),
        lambda: protocols.start_up(float("inf")),
        lambda: protocols.step_rates([0.0, 0.0], [1.0, 2.0]),
        lambda: protocols.step_rates([0.0, 1.0], [1.0]),
        lambda: protocols.measured_rate([0.0, 2.0, 1.0], [1.0, 1.0, 1.0]),
        lambda: protocols.measured_rate([], []),
    ],
)
def test_a_wrong_protocol_is_refused(make):
    with pytest.raises(InputError):
        make()


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
    found = protocols.imposed_stress(TIMES, staircase + wobble)
    assert jumps_at_start(found)
    # after the last sample at the old stress; the first one ends at 0
    assert [t for t in jumps(found) if t > 0.05] == [3.0, 6.0, 9.0, 12.0]


def test_a_jump_after_rest_is_none_at_the_start_and_times_in_decades_are_none():
    later = protocols.imposed_stress(TIMES, np.where(TIMES > 5.0, 20.0, 0.0))
    assert jumps(later) == [5.0]
    assert not jumps_at_start(later)
    decades = np.geomspace(1e-3, 100.0, 60)  # as short at first as a jump is at the end
    found = protocols.imposed_stress(decades, np.sqrt(decades))
    assert not jumps_at_start(found)
    # a jump would add its own steps, and those that follow it
    assert len(stress_grid(found, decades)) < 2 * len(found.table_times)


def test_a_wave_of_stress_is_smooth_between_its_samples_on_both_sides_of_a_jump():
    def truth(times):
        return 5.0 * np.sin(2.0 * times) + np.where(times > 7.55, 10.0, 0.0)

    found = protocols.imposed_stress(TIMES, truth(TIMES))
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
    found = protocols.imposed_stress(TIMES, stress)
    assert not jumps_at_start(found)
    assert jumps(found) == []
