"""A residual of the network is the relative misfit, and a record of nothing is refused."""

from dataclasses import replace

import numpy as np
import pytest

import discover as dc
from discover.errors import InputError
from discover.learners.tbnn_ude.problem import make_problem
from discover.protocols import imposed_stress, oscillations, steady_rates

TIMES = np.linspace(0.1, 4.0, 40)
PLAIN = dc.Run("a.csv", TIMES, dc.start_up(1.0), np.ones(40), 1.0 - np.exp(-TIMES))


def of_every_kind(n):
    """A run of N1, a flow curve, creep and both moduli, n samples each."""
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
        up.observing("N1"),
        dc.Run("curve", counted, steady_rates(rates), rates, rates**0.7),
        dc.Run("creep", times, held, rates, stress, strain=times),
        *sweep.records,
    ]


@pytest.mark.parametrize("learner", [dc.TensorSINDy(), dc.TBNNUDE()])
def test_a_record_that_is_zero_throughout_is_refused(learner):
    with pytest.raises(InputError, match=r"b\.csv.*zero throughout"):
        learner.fit([PLAIN, replace(PLAIN, name="b.csv", stress=np.zeros(40))])


def test_weights_make_a_residual_the_relative_misfit():
    records = make_problem(of_every_kind(20), dc.Fluid()).records
    assert float(np.linalg.norm(records.residual(1.1 * records.recorded))) == pytest.approx(0.1)
