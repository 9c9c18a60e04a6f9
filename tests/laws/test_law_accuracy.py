"""Every named law against its independent material: at any state, and in four flows in time."""

import jax.numpy as jnp
import numpy as np
import pytest
from independent.authors import rolie_poly, stress, xpp
from independent.homogeneous import UNIT
from independent.named import CONSTANTS, material
from law_solutions import FLOWS, measured
from scipy.integrate import solve_ivp

from discover.dataset.run import Run
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.laws import make_law, registry
from discover.protocols import in_flow, start_up

KINKED = ("saramito",)
OF_STRESS = [law for law, constants in CONSTANTS.items() if not make_law(law, constants).variables]
"""Those with variables beside it: `test_pom_pom.py`, `test_rolie_poly_blend.py`."""

# all nine components, with a rotation about no axis of the strain; and those that four hold
ANY = np.array([[0.4, 1.0, -0.3], [0.2, -0.7, 0.5], [0.6, -0.4, 0.3]])
OF_FOUR = np.array([[0.4, 1.1, 0.0], [0.0, -0.3, 0.0], [0.0, 0.0, -0.1]])
FOUR = [0, 1, 2, 0], [0, 1, 2, 1]


def test_every_named_law_has_an_independent_material():
    built_in = registry._named_laws()  # without what another test registered
    assert set(CONSTANTS) == set(built_in)
    for law, constants in CONSTANTS.items():
        assert set(constants) == set(built_in[law].parameters)
        assert np.all(np.isfinite(material(law, constants).rest()))


@pytest.mark.parametrize("law", OF_STRESS)
def test_every_law_changes_as_its_independent_material_in_any_flow(law):
    """That programs follow it in time: below, and `tests/simulate/test_solvers.py`."""
    made, its, step = make_law(law, CONSTANTS[law]), material(law, CONSTANTS[law]), 1e-5
    for gradient in (ANY, OF_FOUR):
        along = solve_ivp(
            lambda _, y, gradient=gradient: its.change(y, gradient), (0, 2), its.rest(), "Radau",
            [0.1, 0.6, 2.0],
        )  # fmt: skip
        for state in along.y.T:
            stress, change = its.stress(state, gradient), its.change(state, gradient)
            # dσ/dt by the chain rule
            ahead, behind = (its.stress(state + d * change, gradient) for d in (step, -step))
            wanted = (ahead - behind) / (2 * step)
            found = np.asarray(made.stress_rate(jnp.asarray(stress), jnp.asarray(gradient)))
            # the difference errs by the square of the step; at a steady state nothing changes
            size = np.max(np.abs(wanted)) + np.max(np.abs(stress))
            np.testing.assert_allclose(found, wanted, atol=1e-6 * size)
            if gradient is OF_FOUR:
                even = jnp.asarray(0.5 * (stress + stress.T))  # to the last digit
                whole = made.stress_rate(even, jnp.asarray(gradient))[FOUR]
                short = made.stress_rate(even[FOUR], jnp.asarray(gradient[FOUR]))
                np.testing.assert_allclose(short, whole, rtol=1e-12, atol=1e-13 * size)


@pytest.mark.slow
@pytest.mark.parametrize("law", CONSTANTS)
def test_every_law_is_its_independent_solution(law):
    for flow in FLOWS:
        found = measured(law, flow)
        if flow == "imposed stress":
            # first order, from the stress at the end of each step
            assert found["error"] < 1e-3
            assert found["order"] > 0.9
            continue
        # a kink within a step errs by its second order
        assert found["error"] < (1e-4 if law in KINKED else 2e-5)
        assert law in KINKED or found["order"] is None or found["order"] > 3.5


RETRACTING = [
    (rolie_poly, {"stretch_time_ratio": 0.1, "beta": 0.7}),
    (xpp, {"q": 4.0, "stretch_time_ratio": 0.25, "alpha": 0.1}),
]


@pytest.mark.slow
@pytest.mark.parametrize(("law", "constants"), RETRACTING, ids=["rolie_poly", "xpp"])
@pytest.mark.parametrize(("kind", "rate"), [("shear", 2.0), ("uniaxial", 0.5)])
def test_fast_modes_of_a_retracting_law_need_no_small_steps(law, constants, kind, rate):
    """The trace of the fastest mode relaxes within 1e-5 of a step."""
    modulus, time = np.array([1000.0, 300.0, 50.0]), np.array([1e-4, 1e-2, 3.0])
    times = np.linspace(0.1, 4.0, 40)
    declared = DeclaredModel.named(law.__name__, constants, modulus, time)
    model = AugmentedModel(declared, [])
    run = Run("run", times, in_flow(start_up(rate), kind), np.full(40, rate), np.ones(40))
    found = model.predict(model.zero(), make_batch([run]))[0]
    gradient = rate * UNIT[kind]
    exact = sum(
        g * stress(law, constants, gradient, times, t) for g, t in zip(modulus, time, strict=True)
    )
    wanted = exact[:, 0, 1] if kind == "shear" else exact[:, 0, 0] - exact[:, 1, 1]
    # what the fixed steps of a fit cost, 1e-6 of other laws; a retraction is ten times as fast
    np.testing.assert_allclose(found, wanted, atol=2e-4 * np.max(np.abs(wanted)))
