"""A run that weighs twice as much has residuals twice as large, whoever fits it."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

import discover as dc
from discover.dataset.run import Loading
from discover.errors import InputError
from discover.forward import make_batch
from discover.learners.tbnn_ude.problem import make_problem as network_problem
from discover.protocols import imposed_stress, oscillations, steady_rates

TIMES = np.linspace(0.1, 4.0, 40)
PLAIN = dc.Run("a.csv", TIMES, dc.start_up(1.0), np.ones(40), 1.0 - np.exp(-TIMES))
TWICE = replace(PLAIN, name="b.csv", weight=2.0)
MODE = np.ones(1), np.ones(1)


WEIGHTS = {
    "the closed loop": lambda runs: make_batch(runs).weight,
    "the network": lambda runs: network_problem(runs, *MODE).records.weight,
}


@pytest.mark.parametrize("who", WEIGHTS)
def test_a_run_that_weighs_twice_has_residuals_twice_as_large(who):
    once, twice = np.asarray(WEIGHTS[who]([PLAIN, TWICE]))[:, :40] * np.ones((2, 40))
    np.testing.assert_allclose(twice, 2.0 * once, rtol=1e-12)


def of_every_kind(n):
    """A start-up, a heavier one, one of N1, a flow curve, creep and both moduli, n samples each."""
    times = np.linspace(0.1, 4.0, n)
    stress = 100.0 * (1.0 - np.exp(-times))
    up = dc.Run(
        "up", times, dc.start_up(1.0), np.ones(n), stress, first_normal_stress_difference=stress**2
    )
    rates = np.geomspace(0.1, 10.0, n)
    counted = np.arange(1.0, n + 1.0)
    held = imposed_stress(times, np.full(n, 40.0))
    swept = oscillations(rates, np.ones(n))
    sweep = dc.Run(
        "sweep", counted, swept, rates, stress, strain=rates, storage_modulus=stress,
        loss_modulus=1.0 + stress,
    )  # fmt: skip
    return [
        up,
        replace(up, name="heavier", weight=2.0, loading=Loading(0.03)),
        up.observing("N1"),
        dc.Run("curve", counted, steady_rates(rates), rates, rates**0.7),
        dc.Run("creep", times, held, rates, stress, strain=times),
        *sweep.records,
    ]


def of_the_network(runs):
    return network_problem(runs, *MODE, solvent_viscosity=5.0).records


def test_all_judge_the_same_records_by_the_same_weights_beside_a_solvent_too():
    runs = of_every_kind(20)
    of_network = of_the_network(runs)
    # the loop sums over runs where learners take the mean
    of_loop = np.asarray(make_batch(runs).weight)[:, :20] / np.sqrt(len(runs))
    np.testing.assert_allclose(of_loop, of_network.weight, rtol=1e-14)


def test_all_leave_the_same_of_the_same_predictions_where_runs_have_loadings_of_their_own():
    up, _, normal, curve = of_every_kind(20)[:4]
    own = Loading(0.05)
    runs = [replace(up, loading=own), replace(normal, loading=own), curve]
    of_network = of_the_network(runs)
    predicted = 1.04 * np.asarray(of_network.recorded)
    left = np.asarray(of_network.residual(jnp.asarray(predicted)))
    of_loop = make_batch(runs).records.residual(predicted[:, : max(map(len, runs))])
    np.testing.assert_allclose(
        of_loop / np.sqrt(len(runs)), left[:, : of_loop.shape[1]], rtol=1e-12
    )
    # negative control: without a loading of its own the first misses by far more, and the flow
    # curve by as much
    alone = np.asarray(replace(of_network, loadings=None).residual(jnp.asarray(predicted)))
    assert np.sum(alone[0] ** 2) > 1.5 * np.sum(left[0] ** 2)
    np.testing.assert_array_equal(alone[2], left[2])


@pytest.mark.parametrize("learner", [dc.TensorSINDy(), dc.TBNNUDE()])
def test_a_record_that_is_zero_throughout_is_refused(learner):
    with pytest.raises(InputError, match=r"b\.csv.*zero throughout"):
        learner.fit([PLAIN, replace(PLAIN, name="b.csv", stress=np.zeros(40))])


def test_weights_make_a_residual_the_relative_misfit():
    records = of_the_network(of_every_kind(20)[2:])  # those that weigh alike
    assert float(np.linalg.norm(records.residual(1.1 * records.recorded))) == pytest.approx(0.1)
