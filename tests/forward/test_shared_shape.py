"""Runs laid out in a shared shape: one program, and what each predicts stays the same."""

from dataclasses import fields

import jax.numpy as jnp
import numpy as np
import pytest

from discover.dataset import Run
from discover.effects import make_effect
from discover.forward import AugmentedModel, DeclaredModel, TransientFlows, make_batch
from discover.laws import Fluid, UpperConvectedMaxwell
from discover.loop.measured_rates import with_places, with_rate_steps
from discover.programs.program_cache import Compiled
from discover.protocols import measured_rate, oscillatory_shear, shear_rates, start_up
from discover.simulate import simulate

MODULI, TIMES = np.array([50.0, 120.0, 30.0, 10.0]), np.array([3.0, 0.5, 0.05, 0.01])
DECLARED = DeclaredModel.maxwell(MODULI, TIMES)
IN_SOLVENT = DeclaredModel.maxwell(MODULI, TIMES, solvent_viscosity=5.0)
AMPLITUDES = {"giesekus_mobility": 0.3, "instrument_inertia": 2.0, "tool_compliance": 1e-4}


def record(name, flow, end, count):
    time = np.linspace(end / count, end, count)
    return Run(name, time, flow, shear_rates(flow, time), np.ones(count))


MANY = [
    record("fast", start_up(5.0), 8.0, 60),
    record("slow", start_up(0.5), 8.0, 60),
    record("turned", oscillatory_shear(3.0, 1.2), 8.0, 50),
]
FEW = [record("short", start_up(2.0), 1.0, 12)]


def model_of():
    model = AugmentedModel(IN_SOLVENT, [*map(make_effect, AMPLITUDES)])
    theta = model.zero()
    for name, value in AMPLITUDES.items():
        theta[model.positions(name)[0]] = value
    return model, theta


@pytest.mark.parametrize("runs", [FEW, MANY + FEW + MANY[:1]])
def test_runs_in_a_shared_shape_are_predicted_as_in_their_own(runs, monkeypatch):
    model, theta = model_of()
    found = model.predict(theta, make_batch(runs))
    monkeypatch.setattr(TransientFlows, "in_shared_shape", lambda flows: flows)
    expected = model.predict(theta, make_batch(runs))
    assert found.shape == expected.shape
    # the same steps; sums of modes may be taken in another order
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-12 * np.max(expected))


class OwnLag(type(make_effect("transducer_lag"))):
    """What somebody wrote in JAX, and never said that NumPy does."""

    def recorded_stress(self, values, record):
        return jnp.asarray(record.stress) * jnp.exp(-values[0])


def test_fewer_shorter_and_more_runs_ask_for_no_program_of_their_own(monkeypatch):
    model, theta = model_of()
    model.predict(theta, make_batch(MANY))
    made, programs = Compiled._made, []
    monkeypatch.setattr(Compiled, "_made", lambda self, *of: programs.append(1) or made(self, *of))
    for runs in (FEW, MANY[:2], [*MANY, *MANY], [*MANY, *MANY, *MANY]):
        model.predict(theta, make_batch(runs))
    assert not programs
    # negative control: an effect that is not in NumPy
    lag = make_effect("transducer_lag")
    values = {field.name: getattr(lag, field.name) for field in fields(lag)}
    own = AugmentedModel(IN_SOLVENT, [OwnLag(**{**values, "name": "own_lag"})])
    own.predict(np.where(own.first_trial > 0, 0.01, 0.0), make_batch(MANY))
    assert programs


def test_a_rate_that_steps_between_samples_still_steps_there():
    time = np.linspace(0.05, 3.0, 60)
    run, *others = (
        Run(f"to_{level}", time, measured_rate(time, rate), rate, np.ones(60))
        for level in (3.0, 0.5)
        for rate in [np.where(time < 1.52, 1.0, level)]
    )
    declared, [run, *others], _ = with_places(
        DECLARED, [with_rate_steps(one) for one in (run, *others)], []
    )
    assert run.rate_steps
    batch = make_batch([run])
    expected = AugmentedModel(declared, []).predict(np.array([0.0, 0.0, 0.3, 0.7]), batch)
    both = AugmentedModel(declared, []).predict(
        np.array([0.0, 0.0, 0.3, 0.7]), make_batch([run, *others])
    )
    np.testing.assert_allclose(both[:1], expected, rtol=1e-10)


def test_weights_of_steps_follow_the_times_that_are_tried():
    model, flow = AugmentedModel(DECLARED, []), start_up(2.0)
    run = record("a", flow, 8.0, 60)
    batch = make_batch([run], strain_step=0.05)
    for factor in (1.0, 2.0, 1.0):
        theta = model.zero()
        theta[1] = np.log(factor)
        fluid = Fluid(UpperConvectedMaxwell(), jnp.asarray(MODULI), jnp.asarray(factor * TIMES))
        reference = simulate(fluid, flow, run.time).shear_stress
        # fixed fourth-order steps of 0.05 strain
        np.testing.assert_allclose(model.predict(theta, batch)[0], reference, rtol=1e-4)
