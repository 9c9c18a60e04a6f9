"""Steps in time: they grow where a flow is steady, and are cut where chains retract."""

from dataclasses import replace

import numpy as np
import pytest
from independent import Giesekus, JohnsonSegalman, RoliePoly, Structured, steps
from independent.named import material
from vectors import vector_of

from discover.dataset import Run
from discover.effects import named_effects
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.forward.grid import STRAIN_STEP, make_grid
from discover.forward.of_fluids import bare_run, observed, observed_in, pieces_in_time
from discover.laws import Fluid, make_law
from discover.laws.expansion import law_of_terms
from discover.protocols import shear_rates, start_up, step_rates
from discover.simulate import simulate
from tensor_library.law_terms import LawTerms

TIME = 0.4
RATES = [0.0, 1.0], [0.1, 20.0]
FLOW, RECORD = step_rates(*RATES), steps(*RATES)
# held for half a minute, and sampled evenly in the logarithm of the time since the step
TIMES = np.append(0.5, RATES[0][1] + np.geomspace(2e-3, 30.0, 60))


THINNING = {"k": 1.0, "n": 0.5}
LAWS = {
    "giesekus": ({"alpha": 0.3}, Giesekus(0.3)),
    "white_metzner": (THINNING, material("white_metzner", THINNING)),
    # turns by six radians in a relaxation time while it comes to rest
    "johnson_segalman": ({"xi": 0.4}, JohnsonSegalman(0.4)),
}


def error(law, time, told):
    """Return the largest error over the largest stress, and the number of steps."""
    parameters, independent = LAWS[law]
    fluid = Fluid(make_law(law, parameters), 1.0, time)
    batch = make_batch([bare_run(FLOW, TIMES)], STRAIN_STEP, relaxation_time=told)
    s12, n1, n2 = observed([fluid], batch)[0, 0].T
    exact = replace(independent, relaxation_time=time).respond(RECORD, TIMES)
    pairs = (s12, exact.sigma12), (n1, exact.N1), (n2, exact.N2)
    size = max(np.max(np.abs(record)) for _, record in pairs)
    steps = batch.parts[0].times.shape[1] // 2
    return max(np.max(np.abs(a - b)) for a, b in pairs) / size, steps


@pytest.mark.parametrize(
    "law", [n if n == "giesekus" else pytest.param(n, marks=pytest.mark.slow) for n in LAWS]
)
def test_growing_steps_are_as_accurate_as_short_ones(law):
    grown, few = error(law, TIME, TIME)
    assert grown < 1e-6  # what the default grid promises
    assert few < make_grid(FLOW, TIMES)[0].size / 3


@pytest.mark.parametrize("how", [{"growth": 0.05}, {"relaxation_time": TIME}])
def test_steps_grow_from_the_last_jump_of_a_rate_as_from_any(how):
    # the same flow, once with an end of the table beyond the record
    ends = step_rates([*RATES[0], 100.0], [*RATES[1], RATES[1][-1]])
    (last, _), (held, _) = (make_grid(flow, TIMES, **how) for flow in (FLOW, ends))
    np.testing.assert_array_equal(last, held)


def test_what_a_law_adds_to_the_relaxation_does_not_make_steps_unstable():
    # h = 2σ: σ12 = Wi/3 (1 − e^(−3t/λ)); the rate turns the fluid by 0.4 in a relaxation time
    time, flow = 0.02, start_up(20.0)
    fluid = Fluid(law_of_terms(LawTerms({"sigma": 2.0}), True), 1.0, time)
    steady = 20.0 * time / 3.0
    times = np.append(0.0, np.geomspace(2e-3, 30.0, 60))

    def off(**limits):
        found = observed_in(fluid, flow, times, **limits)[:, 0]
        return np.max(np.abs(found / steady - (1.0 - np.exp(-3.0 * times / time))))

    assert off(relaxation_time=time) < 1e-4
    # the control: steps of many relaxation times are not stable
    assert not off(strain_step=20.0) < 0.1


def test_steps_that_grow_before_an_oscillation_has_died_out_are_seen_to_be_off():
    # the control: told an eighth of the relaxation time
    assert error("johnson_segalman", TIME, TIME / 8)[0] > 4e-6


def test_a_structure_slower_than_the_relaxation_is_followed_in_long_steps():
    name, critical, build_up = "thixotropic_relaxation_two_times", 0.7, 1.5
    slowness, share = 8.0, 0.3
    declared = DeclaredModel.named("giesekus", {"alpha": 0.2}, 100.0, TIME)
    model = AugmentedModel(declared, [named_effects()[name]])
    theta = vector_of(model, **{name: (1.0 / critical, build_up, slowness, share)})
    run = Run("step", TIMES, FLOW, shear_rates(FLOW, TIMES), np.ones(len(TIMES)))
    batch = make_batch([run])
    exact = Structured(
        critical, (build_up, slowness * build_up), 2.0 / 3.0, share, by_stress=False,
        in_modulus=False, modulus=100.0, relaxation_time=TIME, mobility=0.2,
    ).respond(RECORD, TIMES).sigma12  # fmt: skip
    steps = batch.parts[0].times.shape[1] // 2
    assert steps < 0.6 * make_grid(FLOW, TIMES, strain_step=0.25)[0].size
    found = model.predict(theta, batch)[0]
    # of second order in time at the jump: tests/effects/test_structure.py
    np.testing.assert_allclose(found, exact, atol=2e-3 * np.max(np.abs(exact)))


MODULUS, CHAIN_TIMES = (1000.0, 300.0, 100.0), (1e-3, 0.1, 10.0)
SAMPLES = np.linspace(0.5, 30.0, 60)
RUN = bare_run(start_up(0.3), SAMPLES)


def exact(ratio, rate):
    """Return σ12 of three modes in Pa, on full tensors, by an implicit method."""
    modes = zip(MODULUS, CHAIN_TIMES, strict=True)
    laws = [RoliePoly(0.5, ratio * t, modulus=g, relaxation_time=t) for g, t in modes]
    return sum(law.held(rate, SAMPLES) for law in laws)[:, 0, 1]


def fluid(ratio):
    law = make_law("rolie_poly", {"stretch_time_ratio": ratio, "beta": 0.5})
    return Fluid(law, MODULUS, CHAIN_TIMES)


def test_steps_much_longer_than_a_mode_and_its_retraction_follow_both():
    """The fastest mode relaxes in 1/500 of a step, and retracts in 1/5,000; it ran away."""
    wanted = exact(0.1, 0.3)
    found = observed_in(fluid(0.1), start_up(0.3), SAMPLES)[:, 0]
    np.testing.assert_allclose(found, wanted, atol=1e-3 * np.max(wanted))


@pytest.mark.slow
def test_steps_that_adapt_follow_them_to_the_tolerance():
    wanted = exact(0.1, 0.3)
    adapted = simulate(fluid(0.1), start_up(0.3), SAMPLES).shear_stress
    np.testing.assert_allclose(adapted, wanted, atol=1e-6 * np.max(wanted))


@pytest.mark.parametrize("ratio", [0.01, 0.5])
def test_steps_are_cut_until_cutting_them_changes_nothing(ratio):
    pieces = pieces_in_time(fluid(ratio), [RUN], 0.2)
    found = observed_in(fluid(ratio), start_up(0.3), SAMPLES, 0.2, pieces=pieces)[:, 0]
    wanted = exact(ratio, 0.3)
    # a change of 1e-4 on halving bounds the error of a method that converges
    assert np.linalg.norm(found - wanted) < 2e-4 * np.linalg.norm(wanted)
    assert pieces < 10
    # control: a law that does not retract keeps its steps
    assert pieces_in_time(Fluid(make_law("giesekus", {"alpha": 0.3}), 1.0, 1.0), [RUN], 0.2) == 1
