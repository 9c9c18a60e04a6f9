"""Learners on flow curves: steady states in the place of a rate in time."""

import numpy as np
import pytest
from differences import nearly_giesekus, told_as_differences
from independent import Giesekus, start_up

import discover as dc
from discover.learners.tbnn_ude.problem import make_problem as make_training_problem
from discover.protocols.control import steady_rates
from tensor_library.library import build_library

LIBRARY = build_library(degree=0)
RATES = np.geomspace(0.1, 20.0, 24)
SLOW = RATES[RATES < 2.0]  # in faster flow the stress of a trial law bends too fast for differences
MOBILITY, NOISE = 0.3, 0.01


def flow_curve(noise=0.0, rates=RATES):
    """Where start-ups of a Giesekus fluid end by scipy, with noise in proportion."""
    material = Giesekus(MOBILITY)
    stress = [material.respond(start_up(r), np.linspace(0.0, 40.0, 3)).sigma12[-1] for r in rates]
    off = 1.0 + noise * np.random.default_rng(0).standard_normal(rates.size)
    counted = np.arange(1.0, rates.size + 1.0)
    return dc.Run("flow_curve.csv", counted, steady_rates(rates), rates, np.array(stress) * off)


def start(rate=2.0):
    times = np.linspace(0.05, 8.0, 40)
    stress = Giesekus(MOBILITY).respond(start_up(rate), times).sigma12
    return dc.Run("start.csv", times, dc.start_up(rate), np.full(times.size, rate), stress)


@pytest.mark.slow
def test_the_network_is_told_of_steady_states_as_their_differences_say():
    problem = make_training_problem([flow_curve(rates=SLOW), start()], dc.Fluid())
    along = told_as_differences(problem, nearly_giesekus(MOBILITY), 1e-5, 1e-6)
    assert np.all(np.isfinite(along.states))


@pytest.mark.slow
@pytest.mark.parametrize("known", [0.0, MOBILITY])
def test_a_flow_curve_alone_gives_the_mobility_that_made_it_and_nothing_that_is_known(known):
    base = dc.Fluid(dc.make_law("giesekus", {"alpha": known}), 1.0, 1.0)
    sindy = dc.TensorSINDy(base=base, library=LIBRARY).fit([flow_curve(NOISE)])
    terms = {term.term: term for term in sindy.terms_}
    if known:  # the control
        assert not terms
        return
    assert list(terms) == ["sigma.sigma"]
    low, high = terms["sigma.sigma"].ci95
    assert low <= MOBILITY <= high
    assert high - low < 0.05
