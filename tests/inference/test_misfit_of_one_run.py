"""A misfit that passes for correlated noise in one run does not where other runs show the noise."""

import numpy as np
import pytest
from independent import Giesekus, WhiteMetzner, oscillation, start_up
from independent.noise import white

import discover as dc
from discover.effects import library_term, make_effect
from discover.forward import DeclaredModel
from discover.inference.engine.fits import Fitter
from discover.inference.engine.posterior import posterior_of
from discover.inference.engine.problem import Problem
from discover.inference.engine.search import Search
from tensor_library.terms import parse_term

SCALE = {"modulus": 100.0, "relaxation_time": 1.0}
FLOWS = (
    (start_up(0.5), dc.start_up(0.5), np.linspace(0.1, 8.0, 80)),
    (start_up(2.0), dc.start_up(2.0), np.linspace(0.1, 8.0, 80)),
    (oscillation(2.0, 1.0), dc.oscillatory_shear(2.0, 1.0), np.linspace(0.1, 12.0, 120)),
)
TERMS = ("tr(sigma.gammadot)*sigma", "tr(sigma.gammadot.gammadot)*sigma")
STARTS = {"wall_slip": 0.006, TERMS[0]: 0.5, TERMS[1]: -0.17, "giesekus_mobility": 0.3}


def left_by(fluid, names, seed):
    """Return what some effects, fitted to a fluid by scipy with 1 % noise, leave, and a verdict."""
    runs = []
    for i, (flow, protocol, times) in enumerate(FLOWS):
        stress = fluid.respond(flow, times).sigma12
        noisy = white(stress, 0.01, np.random.default_rng([seed, i]))
        rates = np.asarray(flow.rate(times), dtype=float)
        runs.append(dc.Run(f"run_{i}", times, protocol, rates, noisy))
    effects = [make_effect("wall_slip"), make_effect("giesekus_mobility")]
    effects += [library_term(parse_term(term)) for term in TERMS]
    declared = DeclaredModel.named("ucm", {}, np.array([100.0]), np.array([1.0]))
    problem = Problem(declared, effects, runs, computed=True)
    start = problem.zero.copy()
    for name in names:
        start[problem.model.positions(name)[0]] = STARTS[name]
    fitter = Fitter(problem, problem.fitted)
    search = Search(fitter)
    (fit,) = search.add([fitter.start(names, start)])
    return fitter.misfit(fit), posterior_of(search).verdict


def test_slip_and_two_terms_do_not_explain_a_white_metzner_fluid():
    found = [left_by(WhiteMetzner(0.5, **SCALE), ("wall_slip", *TERMS), seed) for seed in range(4)]
    assert max(misfit for misfit, _ in found) < 0.017  # hardly more than the noise
    assert sum(verdict == "unexplained" for _, verdict in found) >= 3


@pytest.mark.parametrize("seed", range(4))
def test_the_law_that_made_the_runs_explains_them(seed):
    _, verdict = left_by(Giesekus(0.3, **SCALE), ("giesekus_mobility",), seed)
    assert verdict == "effects_added"
