"""Extension, steps of strain and steady alternation, against scipy on full tensors."""

import jax.numpy as jnp
import numpy as np
import pytest
from independent.homogeneous import UNIT, GiesekusFluid

from discover.dataset.records.thinning import thin_run
from discover.dataset.run import Run
from discover.errors import InputError
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.forward.of_fluids import observed_in
from discover.laws import Fluid, make_law
from discover.protocols import (
    after_alternation,
    after_steady_flow,
    after_step_strain,
    another_between_samples,
    in_flow,
    kinematics_of,
    measured_rate,
    oscillatory_shear,
    recorded_at,
    shear_rates,
    start_up,
)
from discover.simulate import simulate

MODULUS, TIME, SOLVENT, MOBILITY = np.array([100.0, 20.0]), np.array([0.2, 3.0]), 5.0, 0.3
TIMES = np.linspace(0.05, 4.0, 30)
BY_SCIPY = GiesekusFluid((100.0, 20.0), (0.2, 3.0), MOBILITY, SOLVENT)


def fluid():
    return Fluid(make_law("giesekus", {"alpha": MOBILITY}), MODULUS, TIME, SOLVENT)


def in_the_loop(protocols, times=TIMES):
    ones = np.ones(len(times))
    runs = [Run(str(i), times, protocol, ones, ones) for i, protocol in enumerate(protocols)]
    law = make_law("giesekus", {"alpha": MOBILITY})
    declared = DeclaredModel(law, MODULUS, TIME, solvent_viscosity=SOLVENT)
    model = AugmentedModel(declared, [])
    return model.predict(model.zero(), make_batch(runs, strain_step=0.05))


@pytest.mark.parametrize(
    "kind",
    ["uniaxial", *(pytest.param(kind, marks=pytest.mark.slow) for kind in ("biaxial", "planar"))],
)
def test_the_start_of_an_extension_is_that_of_scipy_by_every_path(kind):
    protocol = in_flow(start_up(0.6), kind)
    exact = BY_SCIPY.recorded(kind, lambda _: 0.6, TIMES)
    adaptive = recorded_at(protocol, simulate(fluid(), protocol, TIMES).components)
    fixed = observed_in(fluid(), protocol, TIMES)[:, 0]
    # rtol 1e-8 of a mode; the fixed grid is good to 1e-6 in shear and the loop's steps to 1e-5
    np.testing.assert_allclose(adaptive, exact, rtol=1e-6)
    np.testing.assert_allclose(fixed, exact, rtol=1e-5)
    np.testing.assert_allclose(in_the_loop([protocol])[0], exact, rtol=1e-4)


def test_relaxation_after_a_step_of_strain_is_that_of_scipy():
    held = after_step_strain(start_up(0.0), 2.0, TIMES[0])
    begins, length = float(held.begins), -float(held.begins)
    assert length < 2e-3 * TIMES[0]
    exact = BY_SCIPY.recorded(
        "shear", lambda t: 2.0 / length if t < 0.0 else 0.0, TIMES, begins, jumps=[0.0]
    )
    found = recorded_at(held, simulate(fluid(), held, TIMES).components)
    np.testing.assert_allclose(found, exact, rtol=1e-5)
    np.testing.assert_allclose(in_the_loop([held])[0], exact, rtol=1e-3)


@pytest.mark.parametrize("kind", ["shear", "uniaxial"])
def test_a_smooth_or_thinned_rate_stays_in_its_flow_and_after_what_came_before(kind):
    times = np.linspace(0.0, 3.0, 61)
    rates = 0.5 + 0.1 * np.sin(times)
    sampled = in_flow(measured_rate(times, rates), kind)
    begun = after_steady_flow(sampled, 2.0, 3.0)
    for protocol in (sampled, begun):
        smooth = another_between_samples(protocol, times)
        assert smooth.flow == kind
        assert float(smooth.begins) == float(protocol.begins)
        at = np.array([-0.5, 0.0, 1.025, 2.975])
        wanted = shear_rates(protocol, at)
        # a sample apart by 0.05 s: straight lines miss 0.1 * 0.05^2 / 8 of this wave
        np.testing.assert_allclose(shear_rates(smooth, at), wanted, atol=1e-4)
    run = Run("a", times, sampled, rates, np.ones(61))
    assert thin_run(run, 30).flow == kind


def test_troutons_ratios_are_those_of_a_solvent_and_work_is_that_of_equivalent_shear():
    ratios = {"shear": 1.0, "uniaxial": 3.0, "planar": 4.0, "biaxial": 6.0}
    assert {kind: float(kinematics_of(kind).viscous) for kind in ratios} == ratios
    pull = in_flow(start_up(0.5), "uniaxial")
    stress = simulate(fluid(), pull, np.array([0.0]))
    assert recorded_at(pull, stress.components) == pytest.approx([3.0 * SOLVENT * 0.5])
    stress = jnp.array([3.0, -1.0, 0.5, 0.7])
    for kind, unit in UNIT.items():
        flow = kinematics_of(kind)
        full = np.array([[3.0, 0.7, 0.0], [0.7, -1.0, 0.0], [0.0, 0.0, 0.5]])
        work = float(np.sum(full * unit))
        assert float(flow.intensity * flow.equivalent_shear_stress(stress)) == pytest.approx(work)


def test_what_cannot_have_come_before_and_an_unknown_flow_are_refused():
    for nonsense, word in (
        (lambda: after_steady_flow(start_up(1.0), 0.0, 5.0), "must not be 0"),
        (lambda: after_steady_flow(start_up(1.0), 2.0, 0.0), "end must be a positive time"),
        (lambda: after_step_strain(start_up(0.0), np.nan, 0.1), "strain must be finite"),
        (lambda: after_step_strain(start_up(0.0), 1.0, -0.1), "first must be"),
        (lambda: after_alternation(start_up(1.0), 0.0, TIMES), "period must be"),
        (lambda: after_steady_flow(oscillatory_shear(1.0, 1.0), 2.0, 5.0), "has no beginning"),
        (lambda: in_flow(start_up(1.0), "triaxial"), "shear, uniaxial, planar, biaxial"),
    ):
        with pytest.raises(InputError, match=word):
            nonsense()
