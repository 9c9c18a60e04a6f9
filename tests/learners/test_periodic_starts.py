"""Records that start periodic, in the learners: the state is solved for, as in the loop."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from independent import Giesekus, oscillation

from discover.dataset import Run
from discover.laws import TensorBasisNetwork
from discover.learners.runs import as_runs
from discover.learners.tbnn_ude.problem import make_problem as training_problem
from discover.learners.tbnn_ude.variational import Rebuild, states_and_jacobian
from discover.learners.tensor_sindy import TensorSINDy
from discover.protocols import after_alternation, oscillatory_shear, shear_rates, start_up
from tensor_library.library import build_library

MODULUS, TIME, MOBILITY, FREQUENCY = 100.0, 20.0, 0.3, 1.0
PERIOD = 2.0 * np.pi / FREQUENCY
LIBRARY = build_library(degree=0)


def swing(strain, samples=65, cycles=None, noise=0.0):
    times = np.linspace(0.0, PERIOD, samples)
    rate = oscillatory_shear(strain * FREQUENCY, FREQUENCY)
    protocol = after_alternation(rate, PERIOD, times)
    flow = oscillation(strain * FREQUENCY, FREQUENCY)  # after so many cycles from rest, by scipy
    later = (45 if cycles is None else cycles) * PERIOD + times
    stress = Giesekus(MOBILITY, MODULUS, TIME).respond(flow, later).sigma12
    size = noise * np.sqrt(np.mean(stress**2))
    stress = stress + size * np.random.default_rng(int(10 * strain)).standard_normal(samples)
    return Run(f"strain {strain:g}", times, protocol, shear_rates(rate, times), stress)


def up():
    times = np.linspace(0.5, 20.0, 40)
    return Run("up", times, start_up(1.0), np.ones(40), np.ones(40))


@pytest.mark.slow
def test_weights_of_a_network_move_its_periodic_state_as_differences_do():
    problem = training_problem([swing(2.0), up()], np.array([MODULUS]), np.array([TIME]))
    law = TensorBasisNetwork.initialise(jax.random.key(0), width=4)
    # σ·σ is the fourth of the eight
    numbers = jnp.zeros(8).at[3].set(MOBILITY), jnp.zeros(8)
    law = eqx.tree_at(lambda law: (law.constants, law.network_mask), law, numbers)
    rebuild = Rebuild.of_constants(law, np.ones(8, bool), np.ones(8))
    along, jacobian = states_and_jacobian(rebuild.start, rebuild, problem)
    assert np.all(np.isfinite(along.recorded))
    step = 1e-5
    for i in (1, 3):
        moved = [
            states_and_jacobian(rebuild.start + s * step * jnp.eye(8)[i], rebuild, problem)[
                0
            ].recorded
            for s in (1, -1)
        ]
        difference = (moved[0] - moved[1]) / (2.0 * step)
        np.testing.assert_allclose(
            jacobian[0, :, i], difference[0], atol=1e-5 * np.max(np.abs(difference))
        )


def test_only_what_does_not_relax_by_itself_waits():
    run = swing(1.0, cycles=0)
    assert as_runs([run], 1e4)[0].protocol.begins == run.protocol.begins
    waits = as_runs([run], TIME, relaxes=False)[0].protocol
    assert waits.begins < run.protocol.begins


@pytest.mark.slow
def test_a_slow_mode_is_learned_from_two_cycles():
    runs = [swing(strain, noise=0.01) for strain in (0.5, 2.0)]
    fitted = TensorSINDy(LIBRARY, modulus=MODULUS, relaxation_time=TIME).fit(runs)
    (term,) = fitted.result_.terms
    assert term.term == "sigma.sigma"
    low, high = term.ci95
    # within three half-widths
    assert abs(term.coefficient - MOBILITY) < 1.5 * (high - low)
