"""Exports of laws with states of their own, of laws with a name, and in a solver."""

import json

import jax.numpy as jnp
import numpy as np
import pytest
from independent import Giesekus, Structured, Thixotropic
from independent.homogeneous import UNIT
from readers import followed, in_ufl, module_of, shear_quantities, ufl_number

from discover.effects import make_effect
from discover.equations import (
    Box,
    Equation,
    NamedPart,
    StatePart,
    equation_from_json,
    equation_to_json,
    law_terms,
    write_equation,
)
from discover.equations import Tested as Where
from discover.equations.formats.in_a_solver import in_a_solver
from discover.errors import InputError
from discover.laws import TensorBasisNetwork
from tensor_library import LawTerm

ALPHA, MODULUS, TIME = 0.2, 100.0, 1.5
CRITICAL = {"inverse_critical_rate": 0.5, "build_up_time": 2.0}
BY_STRESS = {"inverse_critical_stress": 0.02, "build_up_time": 2.0, "exponent": 1.5}
TIMES = np.linspace(0.1, 4.0, 14)
GRADIENTS = {"shear": 2.0 * UNIT["shear"], "extension": 0.4 * UNIT["uniaxial"]}
SCALE = {"modulus": MODULUS, "relaxation_time": TIME, "mobility": ALPHA}
CASES = {
    "thixotropy": (
        {"breakdown": 0.3, "build_up_time": 4.0},
        Thixotropic(Giesekus(ALPHA, MODULUS, TIME), 0.3, 4.0),
    ),
    "thixotropic_modulus": (
        CRITICAL | {"exponent": 0.7},
        Structured(2.0, (2.0,), 0.7, in_modulus=True, **SCALE),
    ),
    "thixotropic_modulus_by_stress": (
        BY_STRESS,
        Structured(50.0, (2.0,), 1.5, by_stress=True, in_modulus=True, **SCALE),
    ),
    "thixotropic_relaxation": (CRITICAL | {"exponent": 1.3}, Structured(2.0, (2.0,), 1.3, **SCALE)),
    "thixotropic_relaxation_by_stress": (
        BY_STRESS,
        Structured(50.0, (2.0,), 1.5, by_stress=True, **SCALE),
    ),
    "thixotropic_relaxation_two_times": (
        CRITICAL | {"slowness": 5.0, "slow_share": 0.3},
        Structured(2.0, (2.0, 10.0), 2.0 / 3.0, 0.3, **SCALE),
    ),
}
HEAT = 1e-6, 3.0
named = pytest.mark.parametrize("name", CASES)


def equation_of(name, values):
    terms = (LawTerm("sigma.sigma", ALPHA),)
    return Equation(terms, (MODULUS,), (TIME,), states=(StatePart(name, values),))


def written(name, form):
    return module_of(write_equation(equation_of(name, CASES[name][0]), form))


def reference(name, gradient):
    law = CASES[name][1]
    # Moore's structure is broken by the shear rate alone, as a number or as a flow's intensity
    rate = gradient if isinstance(law, Structured) else gradient[0, 1]
    return law.held(rate, TIMES, 1e-10)


def integrated(module, gradient):
    def change(y, gradient):
        stress, structure = y[:9].reshape(1, 3, 3), y[9:]
        rates = module["stress_rate"](stress, gradient, structure)
        return np.append(rates, module["structure_rate"](stress, gradient, structure))

    start = np.append(np.zeros(9), module["STRUCTURE_AT_REST"])
    found = followed(change, start, gradient, TIMES, rtol=1e-10, atol=1e-10)
    totals = (module["total_stress"](y[:9].reshape(1, 3, 3), gradient, y[9:]) for y in found)
    return np.array([*totals])


@pytest.mark.parametrize("kind", GRADIENTS)
@named
def test_the_text_in_python_flows_as_the_fluid(name, kind):
    if name == "thixotropy" and kind == "extension":
        pytest.skip("the reference has a shear rate alone")
    wanted = reference(name, GRADIENTS[kind])
    found = integrated(written(name, "python"), GRADIENTS[kind])
    np.testing.assert_allclose(found, wanted, atol=1e-7 * np.max(np.abs(wanted)))


def test_a_structure_with_another_time_would_show():
    """Negative control of the test above."""
    module, wanted = written("thixotropy", "python"), reference("thixotropy", GRADIENTS["shear"])
    module["STRUCTURE"]["thixotropy"]["build_up_time"] = 5.0
    found = integrated(module, GRADIENTS["shear"])
    assert np.max(np.abs(found - wanted)) > 1e-3 * np.max(np.abs(wanted))


@named
def test_the_integrator_in_the_text_carries_the_structure_along(name):
    times = np.concatenate([[0.0], TIMES])
    found = np.transpose(written(name, "python")["simulate_shear"](lambda t: 2.0, times))[1:]
    wanted = shear_quantities(reference(name, GRADIENTS["shear"])).T
    # steps of a fiftieth of the shortest time, of fourth order
    np.testing.assert_allclose(found, wanted, atol=1e-5 * np.max(wanted))


def states(levels, number=4):
    generator = np.random.default_rng(2)
    for _ in range(number):
        gradient = generator.normal(size=(3, 3))
        root = 0.5 * generator.normal(size=(3, 3)) + np.eye(3)
        yield (
            MODULUS * (root @ root.T - np.eye(3)),
            gradient - np.trace(gradient) / 3.0 * np.eye(3),
            generator.uniform(0.2, 1.0, levels),
        )


def by_python(name, stress, gradient, structure):
    module = written(name, "python")
    asked = stress[None], gradient, structure
    parts = "stress_rate", "structure_rate", "total_stress"
    rate, *others = (module[part](*asked) for part in parts)
    return rate[0], *others


@named
def test_sympy_and_ufl_say_what_python_says(name):
    module = written(name, "sympy")
    (modulus, time), structure = module["modes"][0], module["structure"]
    for stress, gradient, levels in states(len(structure)):
        at = dict(zip(structure, levels, strict=True))
        factor, slow = (float(module[f].subs(at)) for f in ("modulus_factor", "time_factor"))
        s, d = stress / modulus, gradient + gradient.T
        size = np.sqrt(0.5 * np.sum(d * d))
        work = 0.5 * factor * np.sum(stress * d) / size
        at |= {module["shear_rate"]: size, module["shear_stress"]: work}
        at |= dict(zip(module["gradient_symbols"], (slow * time * gradient).ravel(), strict=True))
        parts = (s[0, 0], s[0, 1], s[0, 2], s[1, 1], s[1, 2], s[2, 2])
        at |= dict(zip(module["stress_symbols"], parts, strict=True))
        rate = np.array(module["stress_rate"].subs(at)).astype(float) * modulus / (slow * time)
        wanted, structured, total = by_python(name, stress, gradient, levels)
        np.testing.assert_allclose(rate, wanted, rtol=1e-10, atol=1e-8)
        found = [float(one.subs(at)) for one in module["structure_rate"]]
        np.testing.assert_allclose(found, structured, rtol=1e-10)
        np.testing.assert_allclose(factor * stress, total, rtol=1e-12, atol=1e-9)
    ufl = pytest.importorskip("ufl")
    module = written(name, "ufl")
    for stress, gradient, levels in states(len(module["STRUCTURE_AT_REST"]), 2):
        s, flow = in_ufl(stress), in_ufl(gradient)
        structure = [ufl.as_ufl(float(level)) for level in levels]
        wanted, structured, total = by_python(name, stress, gradient, levels)
        rate, sum_ = module["stress_rate"](s, flow, 0, structure), None
        sum_ = module["total_stress"]([s], flow, structure)
        for place in ((0, 0), (0, 1), (1, 2), (2, 2)):
            assert ufl_number(rate, place) == pytest.approx(wanted[place], rel=1e-9, abs=1e-7)
            assert ufl_number(sum_, place) == pytest.approx(total[place], rel=1e-9, abs=1e-7)
        found = [ufl_number(one) for one in module["structure_rate"]([s], flow, structure)]
        np.testing.assert_allclose(found, structured, rtol=1e-10)


@named
def test_json_brings_it_back_and_latex_has_the_equation_of_the_state_and_its_numbers(name):
    values = CASES[name][0]
    text = json.dumps(equation_to_json(equation_of(name, values)))
    assert equation_from_json(json.loads(text)) == equation_of(name, values)
    values = CASES[name][0]
    written = write_equation(equation_of(name, values), "latex")
    effect = make_effect(name)
    assert effect.equation in written
    for parameter in effect.parameters:
        assert f"{parameter.symbol} = {values[parameter.name]:g}" in written
    assert effect.equation in equation_of(name, values).latex()


@pytest.mark.parametrize("warmed", ["viscous_heating", "softening_by_work"])
def test_two_states_at_once_multiply(warmed):
    constants = dict(zip((p.name for p in make_effect(warmed).parameters), HEAT, strict=True))
    both = (StatePart("thixotropy", CASES["thixotropy"][0]), StatePart(warmed, constants))
    module = module_of(write_equation(Equation((), (MODULUS,), (TIME,), states=both), "python"))
    assert module["structure_factors"](np.array([0.5, 0.2])) == pytest.approx((0.5, np.exp(-0.2)))
    stress, gradient = MODULUS * np.ones((1, 3, 3)), UNIT["shear"]
    (_, warming) = module["structure_rate"](stress, gradient, np.array([0.5, 0.2]))
    assert warming == pytest.approx(1e-6 * 0.5 * MODULUS - 0.2 / 3.0)


def test_rheotool_a_simulation_of_one_mode_and_a_network_are_refused_in_words():
    equation = equation_of("thixotropy", CASES["thixotropy"][0])
    with pytest.raises(InputError, match="exported to rheoTool: it has a structure variable"):
        write_equation(equation, "rheotool")
    with pytest.raises(InputError, match="no law of one mode carries"):
        equation.fluid()
    import equinox as eqx
    import jax

    network = TensorBasisNetwork.initialise(jax.random.key(0))
    with pytest.raises(InputError, match="projection"):
        law_terms(network)
    constants = jnp.zeros(8).at[3].set(0.2)
    network = eqx.tree_at(
        lambda n: (n.network_mask, n.constants), network, (jnp.zeros(8), constants)
    )
    assert law_terms(network) == (LawTerm("sigma.sigma", float(constants[3])),)


@pytest.mark.parametrize(
    ("effect", "values", "said"),
    [
        ("wall_slip", {"slip": 0.1}, "has no state"),
        ("thixotropy", {"breakdown": 0.1}, "build_up_time"),
        ("nothing", {}, "nothing"),
    ],
)
def test_what_is_no_state_is_refused(effect, values, said):
    with pytest.raises(InputError, match=said):
        StatePart(effect, values)


WI = 3.0
# oscillation so fast that start-up goes furthest
TESTED = Where(Box((0.5, WI), (20.0, 20.0)))


def test_eigenvalue_and_largest_step_are_those_of_start_up_and_of_what_the_flow_quickens():
    """σ12 = Wi (1 − e^−t), σ11 = 2 Wi² (1 − (1 + t) e^−t)   [Bird, Armstrong & Hassager 1987]."""
    found = in_a_solver(Equation((), (10.0,), (2.0,), tested=TESTED))
    t = np.linspace(0.0, 10.0, 200)
    s12, s11 = WI * (1 - np.exp(-t)), 2 * WI**2 * (1 - (1 + t) * np.exp(-t))
    wanted = min(
        np.linalg.eigvalsh([[1 + a, b], [b, 1.0]])[0] for a, b in zip(s11, s12, strict=True)
    )
    # rtol 1e-6 of the integration, of an eigenvalue that is a small difference of large numbers
    assert found.smallest_eigenvalue == pytest.approx(wanted, rel=1e-3)
    # four eigenvalues of -1 that are one Jordan block come out within the fourth root of 1e-16
    assert found.largest_step == pytest.approx(4.0, rel=1e-3)
    # white & Metzner's relaxation rate in shear is that of the rate alone
    k, n, times = 0.8, 0.4, (2.0, 0.3)
    named = NamedPart("white_metzner", ({"k": k, "n": n},))
    equation = Equation((), (10.0, 5.0), times, tested=TESTED, named=named)
    found = in_a_solver(equation)
    assert found.limiting_mode == 2
    rate = WI / equation.mean_relaxation_time * times[1]
    quickened = (1 + (k * rate) ** 2) ** ((1 - n) / 2)
    assert found.largest_step == pytest.approx(2 * times[1] / quickened, rel=1e-3)


def test_a_law_that_loses_its_conformation_and_one_that_runs_away_say_so():
    # h = 3 γ̇ turns the sign of σ around; h = −tr(σ) σ lets the trace grow on itself
    beyond = Equation((LawTerm("gammadot", 3.0),), tested=TESTED)
    text = write_equation(beyond, "python")
    assert "no conformation any more" in text
    runaway = Equation((LawTerm("tr(sigma)*sigma", -1.0),), tested=TESTED)
    assert "mode 1 diverges" in write_equation(runaway, "ufl")
    # negative controls: UCM does neither, and without a box nothing is said
    text = write_equation(Equation((), tested=TESTED), "python")
    assert "smallest eigenvalue" in text
    assert "conformation any" not in text
    assert "smallest eigenvalue" not in write_equation(Equation(()), "python")


@pytest.mark.parametrize(
    ("terms", "modulus", "times", "wi"),
    [
        ((LawTerm("sigma.sigma", -1e300),), (1.0,), (1.0,), 3.0),
        ((), (1.0,) * 1000, tuple(np.geomspace(1e-9, 1e9, 1000)), 3.0),
        ((LawTerm("sigma.sigma", 0.3),), (1.0,), (1.0,), 1e308),
    ],
    ids=["coefficient", "modes", "rate"],
)
def test_a_check_that_would_not_end_is_given_up_and_said(terms, modulus, times, wi, monkeypatch):
    # the same limit as in use, reached sooner
    monkeypatch.setattr("discover.equations.formats.in_a_solver._MOST_EVALUATIONS", 3000)
    tested = Where(Box((0.5, wi), (20.0, 20.0)))
    equation = Equation(terms, modulus, times, tested=tested)
    text = write_equation(equation, "python")
    assert "not checked" in text or "diverges" in text
