"""A run that weighs twice as much has residuals twice as large, whoever fits it."""

from dataclasses import replace

import numpy as np
import pytest

import discover as dc
from discover.forward import make_batch
from discover.learners.tbnn_ude.problem import data_scale
from discover.learners.tbnn_ude.problem import make_problem as network_problem
from discover.learners.trajectories.problem import make_problem
from tensor_library.library import build_library

TIMES = np.linspace(0.1, 4.0, 40)
PLAIN = dc.Run("a.csv", TIMES, dc.start_up(1.0), np.ones(40), 1.0 - np.exp(-TIMES))
TWICE = replace(PLAIN, name="b.csv", weight=2.0)
MODE = np.ones(1), np.ones(1)

WEIGHTS = {
    "the closed loop": lambda runs: make_batch(runs).weight,
    "sparse regression": lambda runs: make_problem(runs, build_library(), *MODE).weight[..., 0],
    "the network": lambda runs: data_scale(network_problem(runs, *MODE)),
}


@pytest.mark.parametrize("who", WEIGHTS)
def test_a_run_that_weighs_twice_has_residuals_twice_as_large(who):
    once, twice = np.asarray(WEIGHTS[who]([PLAIN, TWICE]))[:, :40] * np.ones((2, 40))
    np.testing.assert_allclose(twice, 2.0 * once, rtol=1e-12)
