"""Runs of one batch, padded to one length: each is predicted as by itself."""

import numpy as np

from discover.dataset import Run
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.loop.measured_rates import with_rate_steps, with_step_instants
from discover.protocols import measured_rate, oscillatory_shear, shear_rates, start_up

MODULI, TIMES = np.array([50.0, 120.0, 30.0, 10.0]), np.array([3.0, 0.5, 0.05, 0.01])
DECLARED = DeclaredModel.maxwell(MODULI, TIMES)
AMPLITUDES = {"giesekus_mobility": 0.3, "instrument_inertia": 2.0, "tool_compliance": 1e-4}


def record(name, flow, end, count):
    time = np.linspace(end / count, end, count)
    return Run(name, time, flow, shear_rates(flow, time), np.ones(count))


MANY = [
    record("fast", start_up(5.0), 8.0, 60),
    record("slow", start_up(0.5), 8.0, 60),
    record("turned", oscillatory_shear(3.0, 1.2), 8.0, 50),
]


def test_a_rate_that_steps_between_samples_still_steps_there():
    time = np.linspace(0.05, 3.0, 60)
    run, *others = (
        Run(f"to_{level}", time, measured_rate(time, rate), rate, np.ones(60))
        for level in (3.0, 0.5)
        for rate in [np.where(time < 1.52, 1.0, level)]
    )
    declared, [run, *others], _ = with_step_instants(
        DECLARED, [with_rate_steps(one) for one in (run, *others)], []
    )
    assert run.rate_steps
    batch = make_batch([run])
    expected = AugmentedModel(declared, []).predict(np.array([0.0, 0.0, 0.3, 0.7]), batch)
    both = AugmentedModel(declared, []).predict(
        np.array([0.0, 0.0, 0.3, 0.7]), make_batch([run, *others])
    )
    np.testing.assert_allclose(both[:1], expected, rtol=1e-10)
