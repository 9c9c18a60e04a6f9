"""Records that start periodic, in the learners: the state is solved for, as in the loop."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from differences import told_as_differences
from independent import Giesekus, oscillation

from discover.dataset import Run
from discover.laws import Fluid
from discover.learners.settings import as_runs
from discover.learners.tbnn_ude.problem import make_problem as training_problem
from discover.learners.tbnn_ude.session import without_network
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
    problem = training_problem([swing(2.0), up()], Fluid(modulus=MODULUS, relaxation_time=TIME))
    mobility = jnp.zeros(8).at[3].set(MOBILITY)
    law = eqx.tree_at(lambda law: law.constants, without_network(True), mobility)
    along = told_as_differences(problem, law, 1e-6, 1e-5)
    assert np.all(np.isfinite(along.recorded))


def test_only_what_does_not_relax_by_itself_waits():
    run = swing(1.0, cycles=0)
    assert as_runs([run], 1e4)[0].protocol.begins == run.protocol.begins
    waits = as_runs([run], TIME, relaxes=False)[0].protocol
    assert waits.begins < run.protocol.begins


@pytest.mark.slow
def test_a_slow_mode_is_learned_from_two_cycles():
    runs = [swing(strain, noise=0.01) for strain in (0.5, 2.0)]
    fitted = TensorSINDy(LIBRARY, base=Fluid(modulus=MODULUS, relaxation_time=TIME)).fit(runs)
    (term,) = fitted.result_.terms
    assert term.term == "sigma.sigma"
    low, high = term.ci95
    # within three half-widths
    assert abs(term.coefficient - MOBILITY) < 1.5 * (high - low)
