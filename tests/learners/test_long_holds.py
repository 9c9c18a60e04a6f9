"""Rates that are held for thousands of relaxation times; records by scipy."""

import numpy as np
import pytest
from independent import Giesekus, steps

import discover as dc
from discover.protocols import step_rates
from tensor_library.library import build_library

MODULUS, TIME, MOBILITY = 2.0, 0.02, 0.4
BASE = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME)
LIBRARY = build_library(degree=0)


def records():
    """Giesekus at a low rate for 2 s, then held at a high one for a minute."""
    generator, runs = np.random.default_rng(0), []
    for rate in (10.0, 40.0, 100.0):
        flow, law = ([0.0, 2.0], [1.0, rate]), Giesekus(MOBILITY, MODULUS, TIME)
        times = np.append(np.geomspace(2e-3, 1.9, 15), 2.0 + np.geomspace(2e-3, 60.0, 40))
        exact = law.respond(steps(*flow), times).sigma12
        off = 0.01 * np.sqrt(np.mean(exact**2)) * generator.standard_normal(times.size)
        rates = np.where(times < 2.0, 1.0, rate)
        runs.append(dc.Run(f"to_{rate:g}", times, step_rates(*flow), rates, exact + off))
    return runs


@pytest.mark.slow
def test_the_sparse_law_is_found_on_whole_holds():
    found = dc.TensorSINDy(LIBRARY, base=BASE, max_terms=2).fit(records())
    assert [term.term for term in found.terms_] == ["sigma.sigma"]
    low, high = found.terms_[0].ci95
    assert low < MOBILITY < high
