"""Steps that grow where the flow has become steady, against full tensors by scipy."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from independent import Giesekus, JohnsonSegalman, Structured, WhiteMetzner, steps

from discover.dataset import Run
from discover.effects import named_effects
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.forward.grid import STRAIN_STEP, make_grid
from discover.forward.of_fluids import bare_run, observed, observed_in
from discover.laws import Fluid, make_law
from discover.laws.expansion import law_of_terms
from discover.protocols import measured_rate, oscillatory_shear, shear_rates, start_up, step_rates
from tensor_library.law_terms import LawTerms

TIME = 0.4
RATES = [0.0, 1.0], [0.1, 20.0]
FLOW, RECORD = step_rates(*RATES), steps(*RATES)
# held for half a minute, and sampled evenly in the logarithm of the time since the step
TIMES = np.append(0.5, RATES[0][1] + np.geomspace(2e-3, 30.0, 60))


@dataclass(frozen=True)
class Carreau(WhiteMetzner):
    """White–Metzner law with Carreau's function of the rate."""

    def time_at(self, rate):
        thinning = 1.0 + (self.factor * self.relaxation_time * rate) ** 2
        return self.relaxation_time / thinning ** (0.5 * (1.0 - self.exponent))


LAWS = {
    "giesekus": ({"alpha": 0.3}, Giesekus(0.3)),
    "white_metzner": ({"k": 1.0, "n": 0.5}, Carreau(0.5, 1.0)),
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


def test_oscillations_and_unsteady_rates_keep_their_steps():
    times = np.linspace(0.0, 20.0, 400)
    for flow in (
        oscillatory_shear(4.0, 1.0),
        measured_rate(times, 4.0 * np.cos(times)),
        measured_rate(times, np.geomspace(10.0, 0.01, times.size)),
    ):
        plain, _ = make_grid(flow, times)
        grown, _ = make_grid(flow, times, relaxation_time=1e-3)
        np.testing.assert_array_equal(grown, plain)


def test_no_step_is_longer_than_the_method_is_stable_for():
    grid, index = make_grid(FLOW, TIMES, relaxation_time=TIME)
    np.testing.assert_array_equal(grid[index], TIMES)
    fast = grid[:-1] >= RATES[0][1]
    assert np.max(np.diff(grid)[fast]) <= 1.0 / RATES[1][1] + 1e-12
    # and some are as long
    assert np.max(np.diff(grid)[fast]) > 0.9 / RATES[1][1]


def test_a_structure_slower_than_the_relaxation_is_followed_in_long_steps():
    name, critical, build_up, slowness, share = (
        "thixotropic_relaxation_two_times", 0.7, 1.5, 8.0, 0.3,
    )  # fmt: skip
    declared = DeclaredModel.named("giesekus", {"alpha": 0.2}, 100.0, TIME)
    model = AugmentedModel(declared, [named_effects()[name]])
    theta = model.zero()
    theta[model.positions(name)] = 1.0 / critical, build_up, slowness, share
    run = Run("step", TIMES, FLOW, shear_rates(FLOW, TIMES), np.ones(len(TIMES)))
    batch = make_batch([run])
    exact = Structured(
        critical, (build_up, slowness * build_up), 2.0 / 3.0, share, by_stress=False,
        in_modulus=False, modulus=100.0, relaxation_time=TIME, mobility=0.2,
    ).respond(RECORD, TIMES).sigma12  # fmt: skip
    assert (
        batch.parts[0].times.shape[1] // 2 < 0.6 * make_grid(FLOW, TIMES, strain_step=0.25)[0].size
    )
    # of second order in time at the jump: tests/effects/test_structure.py
    np.testing.assert_allclose(
        model.predict(theta, batch)[0], exact, atol=2e-3 * np.max(np.abs(exact))
    )
