import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad

from discover.errors import InputError
from discover.protocols import (
    measured_rate,
    oscillatory_shear,
    paper_test_protocols,
    paper_training_protocols,
    shear_rates,
    stack_protocols,
    start_up,
    step_rates,
    strains,
)

FLOWS = {
    "oscillatory": oscillatory_shear(2.0, 0.7, 0.3),
    "start-up": start_up(1.5),
    "steps": step_rates([0.0, 1.0, 2.5], [1.0, -2.0, 0.5]),
    "measured": measured_rate([0.2, 0.9, 3.0], [0.0, 1.0, 0.4]),
}


@pytest.mark.parametrize("flow", FLOWS.values(), ids=FLOWS.keys())
def test_strain_is_the_integral_of_the_rate(flow):
    for t in (0.1, 0.95, 2.5, 4.0):
        expected, _ = quad(
            lambda s: float(flow.rate(jnp.array(s))), 0, t, points=[0.2, 0.9, 1.0], limit=200
        )
        assert float(flow.strain(jnp.array(t))) == pytest.approx(expected, abs=1e-6)


def test_a_step_takes_its_new_rate_at_the_jump():
    flow = FLOWS["steps"]
    rates = [float(flow.rate(jnp.array(t))) for t in (0.0, 0.999, 1.0, 2.499, 2.5, 9.0)]
    assert rates == [1.0, 1.0, -2.0, -2.0, 0.5, 0.5]


def test_a_batch_gives_the_rates_of_its_members():
    flows = list(FLOWS.values())
    times = jnp.linspace(0.0, 5.0, 23)
    batch = jax.jit(jax.vmap(lambda flow: jax.vmap(flow.rate)(times)))(stack_protocols(flows))
    for together, flow in zip(batch, flows, strict=True):
        np.testing.assert_allclose(together, jax.vmap(flow.rate)(times), atol=1e-14)


def test_the_paper_trains_on_eight_flows_and_tests_on_three_others():
    training, tests = paper_training_protocols(), paper_test_protocols()
    assert len(training) == 8
    assert set(tests) == {"laos_3_1.5", "laos_2_1", "startup_2"}
    assert float(training["laos_2_0.25"].rate(jnp.array(0.0))) == 2.0


@pytest.mark.parametrize(
    "make",
    [
        lambda: oscillatory_shear(1.0, 0.0),
        lambda: oscillatory_shear(float("nan"), 1.0),
        lambda: start_up(float("inf")),
        lambda: step_rates([0.0, 0.0], [1.0, 2.0]),
        lambda: step_rates([0.0, 1.0], [1.0]),
        lambda: measured_rate([0.0, 2.0, 1.0], [1.0, 1.0, 1.0]),
        lambda: measured_rate([], []),
    ],
)
def test_a_wrong_protocol_is_refused(make):
    with pytest.raises(InputError):
        make()


@pytest.mark.parametrize("flow", FLOWS.values(), ids=FLOWS.keys())
@pytest.mark.parametrize("n", [1, 33])
def test_many_samples_at_once_are_what_each_is_alone(flow, n):
    times = np.linspace(0.0, 3.0, n)
    for together, alone in ((shear_rates, flow.rate), (strains, flow.strain)):
        np.testing.assert_allclose(
            together(flow, times), [float(alone(jnp.asarray(t))) for t in times], atol=1e-14
        )
