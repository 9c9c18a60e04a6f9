"""Sparse regression where the known part misses a strong flow by its whole size."""

import numpy as np
import pytest
from independent import Giesekus, start_up
from independent.noise import white

import discover as dc

MODULI, TIMES, MOBILITY, NOISE = (100.0, 60.0, 20.0), (0.1, 1.0, 10.0), 0.3, 0.01


@pytest.mark.parametrize("rates", [(1.0,), (0.1, 1.0, 3.0)])
def test_a_term_that_is_no_small_change_of_the_known_part_is_found_by_itself(rates):
    # upper-convected Maxwell at Wi = 10 and more stands twice to five times above these records
    times, runs = np.linspace(0.02, 12.0, 80), []
    for i, rate in enumerate(rates):
        stress = sum(
            Giesekus(MOBILITY, modulus, time).respond(start_up(rate), times).sigma12
            for modulus, time in zip(MODULI, TIMES, strict=True)
        )
        noisy = white(stress, NOISE, np.random.default_rng(i))
        runs.append(dc.Run(f"{rate:g}", times, dc.start_up(rate), np.full(80, rate), noisy))
    model = dc.TensorSINDy(base=dc.Fluid(dc.make_law("ucm"), MODULI, TIMES)).fit(runs)
    assert [term.term for term in model.terms_] == ["sigma.sigma"]
    # 80 samples at 1 % determine the mobility to about 1 %
    assert model.terms_[0].coefficient == pytest.approx(MOBILITY, rel=0.05)
