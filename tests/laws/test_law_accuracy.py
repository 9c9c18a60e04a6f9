"""Every named law against its independent material: at any state, and in four flows in time.

Four flows: scipy (Radau, 1e-10) follows each law on full tensors in start-up of shear at a
Weissenberg number of 3, in an oscillation of the rate of amplitude 2 and frequency 1, in uniaxial
extension at a Hencky rate of 0.8, and under a shear stress that rises to 0.6 G beside a solvent of
a tenth of the viscosity. An error is the largest over the largest value; the order of the steps
follows from steps four times and twice as long (at a given stress, half and a quarter as long).
"""

import jax.numpy as jnp
import numpy as np
import pytest
from independent.homogeneous import UNIT
from independent.named import CONSTANTS, material
from scipy.integrate import solve_ivp

from discover.dataset.run import Run
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.forward.grid import STRAIN_STEP
from discover.forward.of_fluids import observed_in
from discover.laws import Fluid, make_law, registry
from discover.protocols import (
    FlowProtocol,
    imposed_stress,
    in_flow,
    oscillatory_shear,
    start_up,
    steady_rates,
)

SHEAR_RATE, AMPLITUDE, FREQUENCY, HENCKY_RATE = 3.0, 2.0, 1.0, 0.8
STRESS, RISE, SOLVENT = 0.6, 1.0, 0.1
TIMES = {
    # no closer than the coarsest steps, for every sample is a step
    "start-up": np.linspace(0.2, 6.0, 30),
    "oscillation": np.linspace(0.4, 9.2, 23),
    "extension": np.linspace(0.3, 3.0, 10),
    "imposed stress": np.linspace(0.02, 4.0, 200),
}
FLOWS: dict[str, FlowProtocol] = {
    "start-up": start_up(SHEAR_RATE),
    "oscillation": oscillatory_shear(AMPLITUDE, FREQUENCY),
    "extension": in_flow(start_up(HENCKY_RATE), "uniaxial"),
    "imposed stress": imposed_stress(
        TIMES["imposed stress"], STRESS * np.minimum(TIMES["imposed stress"] / RISE, 1.0)
    ),
}
FLOOR = 3e-8
"""Relative error of scipy here, with tolerances of 1e-10."""


def exact(law: str, flow: str) -> np.ndarray:
    """Return what scipy says is observed: three columns, or one."""
    made, times = material(law, CONSTANTS[law]), TIMES[flow]
    if flow == "imposed stress":
        return _crept(made, times)
    kind = "uniaxial" if flow == "extension" else "shear"

    def gradient(t):
        if flow == "oscillation":
            return AMPLITUDE * np.cos(FREQUENCY * t) * UNIT[kind]
        return (HENCKY_RATE if flow == "extension" else SHEAR_RATE) * UNIT[kind]

    states = _solved(lambda t, y: made.change(y, gradient(t)), made.rest(), times)
    s = np.array([made.stress(y, gradient(t)) for t, y in zip(times, states, strict=True)])
    first = s[:, 0, 0] - s[:, 1, 1]
    if flow == "extension":
        return first[:, None]
    return np.stack([s[:, 0, 1], first, s[:, 1, 1] - s[:, 2, 2]], axis=1)


def _crept(made, times: np.ndarray) -> np.ndarray:
    size = len(made.rest())

    def change(t, y):
        # none of these materials has a stress that depends on the rate itself
        left = STRESS * min(t / RISE, 1.0) - made.stress(y[:size], 0.0)[0, 1]
        rate = left / SOLVENT
        return np.append(made.change(y[:size], rate * UNIT["shear"]), rate)

    start = np.append(made.rest(), 0.0)
    rising = _solved(change, start, times[times <= RISE])
    level = times[times > RISE]
    after = _solved(change, rising[-1], level, begins=float(times[times <= RISE][-1]))
    return np.concatenate([rising, after])[:, -1:]


def _solved(change, start, times, begins: float = 0.0) -> np.ndarray:
    found = solve_ivp(change, (begins, times[-1]), start, "Radau", times, rtol=1e-10, atol=1e-12)
    if not found.success:
        raise ValueError(found.message)
    return found.y.T


def observed(law: str, flow: str, pieces: int = 1, coarser: float = 1.0) -> np.ndarray:
    """Return what the software says is observed, with steps cut in pieces, or longer ones."""
    made = make_law(law, CONSTANTS[law])
    solvent = SOLVENT if flow == "imposed stress" else 0.0
    how = {"pieces": pieces, "phase": 0.15 * coarser}
    fluid = Fluid(made, 1.0, 1.0, solvent)
    found = observed_in(fluid, FLOWS[flow], TIMES[flow], STRAIN_STEP * coarser, **how)
    return found if flow in ("start-up", "oscillation") else found[:, :1]


def measured(law: str, flow: str) -> dict[str, float | None]:
    """Return the error with the steps of a fit, and the order of the steps."""
    truth = exact(law, flow)
    size = np.max(np.abs(truth[:, :2]))  # N2 is measured by N1, for it is zero in some laws

    def error(*steps) -> float:
        return float(np.max(np.abs(observed(law, flow, *steps) - truth)) / size)

    pair = ((2, 1.0), (4, 1.0)) if flow == "imposed stress" else ((1, 4.0), (2, 4.0))
    coarse, fine = (error(*steps) for steps in pair)
    above = fine > FLOOR and coarse > FLOOR
    return {"error": error(), "order": float(np.log2(coarse / fine)) if above else None}


KINKED = ("saramito",)
# chains that retract in 0.02 λ, within a tenth of a step, where exponential methods of fourth order
# have the third   [Hochbruck & Ostermann 2005, SIAM J. Numer. Anal. 43, 1069]; of chains that
# retract in λ/4 the order is 4.0, and of these in steps a tenth as long
STIFF = ("rolie_poly_blend",)
OF_STRESS = [law for law, constants in CONSTANTS.items() if not make_law(law, constants).variables]
"""Those with variables beside it: below, and `test_rolie_poly_blend.py`."""

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
        least = 3.0 if law in STIFF else 3.5
        assert law in KINKED or found["order"] is None or found["order"] > least


ROLIE_POLY = "rolie_poly", {"stretch_time_ratio": 0.1, "beta": 0.7}
XPP = "xpp", {"q": 4.0, "stretch_time_ratio": 0.25, "alpha": 0.1}


@pytest.mark.parametrize(
    ("law", "constants", "kind", "rate"),
    [
        (*ROLIE_POLY, "uniaxial", 0.5),
        *(pytest.param(*case, marks=pytest.mark.slow)
          for case in ((*ROLIE_POLY, "shear", 2.0), (*XPP, "shear", 2.0), (*XPP, "uniaxial", 0.5))),
    ],
)  # fmt: skip
def test_fast_modes_of_a_retracting_law_need_no_small_steps(law, constants, kind, rate):
    """The trace of the fastest mode relaxes within 1e-5 of a step."""
    modulus, time = np.array([1000.0, 300.0, 50.0]), np.array([1e-4, 1e-2, 3.0])
    times = np.linspace(0.1, 4.0, 40)
    declared = DeclaredModel.named(law, constants, modulus, time)
    model = AugmentedModel(declared, [])
    run = Run("run", times, in_flow(start_up(rate), kind), np.full(40, rate), np.ones(40))
    found = model.predict(model.zero(), make_batch([run]))[0]
    gradient = rate * UNIT[kind]
    modes = zip(modulus, time, strict=True)
    exact = sum(material(law, constants, *mode).held(gradient, times) for mode in modes)
    wanted = exact[:, 0, 1] if kind == "shear" else exact[:, 0, 0] - exact[:, 1, 1]
    # what the fixed steps of a fit cost, 1e-6 of other laws; a retraction is ten times as fast
    np.testing.assert_allclose(found, wanted, atol=2e-4 * np.max(np.abs(wanted)))


ARMS, RATIO = 4.0, 0.3
OF_POM_POM = {"q": ARMS, "stretch_time_ratio": RATIO}


@pytest.mark.parametrize(
    "name", ["pom_pom_drag_strain", pytest.param("pom_pom", marks=pytest.mark.slow)]
)
def test_steady_shear_is_the_closed_form_that_has_a_maximum(name):
    """A is upper-convected Maxwell's: A11 = 1 + 2 Wi², A12 = Wi; McLeish & Larson 1998, eq. 39."""
    # at the fastest the logarithm of tr A used to run away, and a stress of a wrong sign was steady
    rates = np.array([0.1, 0.5, 1.0, 2.0, 5.0, 20.0, 1e3, 1e4, 1e5])
    run = Run("run", np.arange(1.0, 10.0), steady_rates(rates), rates, np.ones(9))
    model = AugmentedModel(DeclaredModel.named(name, OF_POM_POM, np.ones(1), np.ones(1)), [])
    found = np.asarray(model.predict(model.zero(), make_batch([run]))[0])
    turned = rates / (3.0 + 2.0 * rates**2)
    np.testing.assert_allclose(found, 3.0 * _stretch(name, rates * turned) ** 2 * turned, rtol=1e-7)
    assert found[-1] < np.max(found)


@pytest.mark.parametrize("name", ["pom_pom", "pom_pom_drag_strain"])
def test_steady_extension_hardens_to_the_square_of_the_arms(name):
    # nothing changes at the closed form; that steady states are found: in shear, above
    law = make_law(name, OF_POM_POM)
    for rate in (0.1, 0.3, 0.45, 20.0):
        along, across = 1.0 / (1.0 - 2.0 * rate), 1.0 / (1.0 + rate)
        turned = (along - across) / (along + 2.0 * across)
        if rate > 0.5:
            # chains are straight, and beyond (1 − 1/q)/θ stretched to their end
            along, across, turned = 1e9, 0.0, 1.0
        stretch = _stretch(name, np.array([rate * turned]))[0]
        shape = np.array([along, across, across, 0.0]) / (along + 2.0 * across)
        stress = 3.0 * stretch**2 * shape - np.array([1.0, 1.0, 1.0, 0.0])
        assert stress[0] - stress[1] == pytest.approx(3.0 * stretch**2 * turned)
        assert rate < 0.5 or stretch == pytest.approx(ARMS)
        state = np.append(stress, np.log((along + 2.0 * across) / 3.0))
        gradient = rate * np.array([1.0, -0.5, -0.5, 0.0])
        change = law.stress_rate(jnp.asarray(state), jnp.asarray(gradient))[:4]
        # sixty bisections, and a share of 1e-9 of A that is not yet straight
        np.testing.assert_allclose(change, 0.0, atol=1e-6 * rate * np.max(np.abs(stress)))


def _stretch(name, drawn):
    """Return the Λ at which (λ/λ_s) e^{ν(Λ−1)} (Λ − 1) = Λ L:S, at most q; bisected."""
    nu = 2.0 / (ARMS - 1.0) if name == "pom_pom_drag_strain" else 0.0
    low, high = np.ones_like(drawn), np.full_like(drawn, ARMS)
    for _ in range(60):
        middle = 0.5 * (low + high)
        grows = drawn > (1.0 - 1.0 / middle) * np.exp(nu * (middle - 1.0)) / RATIO
        low, high = np.where(grows, middle, low), np.where(grows, high, middle)
    return low
