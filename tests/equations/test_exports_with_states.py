"""A structure of the whole fluid leaves with its equation, and is read back from every format.

The references are `independent.structured` and `independent.thixotropic`, on full tensors by scipy.
"""

import json

import jax.numpy as jnp
import numpy as np
import pytest
import sympy
from independent import Giesekus, Structured, Thixotropic
from independent.homogeneous import UNIT
from readers import in_ufl, module_of, ufl_number
from scipy.integrate import solve_ivp

from discover.effects import StateEffect, make_effect, named_effects
from discover.equations import (
    Equation,
    StatePart,
    equation_from_json,
    equation_to_json,
    write_equation,
)
from discover.errors import InputError
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
HEAT = {"heating": 1e-6, "heat_loss_time": 3.0}
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
    found = solve_ivp(
        lambda t, y: law.change(y, rate),
        (0, TIMES[-1]), law.rest(), "LSODA", TIMES, rtol=1e-10, atol=1e-10,
    )  # fmt: skip
    return np.array([law.stress(y, rate) for y in found.y.T])


def integrated(module, gradient):
    def change(t, y):
        stress, structure = y[:9].reshape(1, 3, 3), y[9:]
        rates = module["stress_rate"](stress, gradient, structure)
        return np.append(rates, module["structure_rate"](stress, gradient, structure))

    start = np.append(np.zeros(9), module["STRUCTURE_AT_REST"])
    found = solve_ivp(change, (0, TIMES[-1]), start, "LSODA", TIMES, rtol=1e-10, atol=1e-10)
    return np.array(
        [module["total_stress"](y[:9].reshape(1, 3, 3), gradient, y[9:]) for y in found.y.T]
    )


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
    s = reference(name, GRADIENTS["shear"])
    wanted = np.stack([s[:, 0, 1], s[:, 0, 0] - s[:, 1, 1], s[:, 1, 1] - s[:, 2, 2]], axis=1)
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
    return (
        module["stress_rate"](*asked)[0],
        module["structure_rate"](*asked),
        module["total_stress"](*asked),
    )


@named
def test_sympy_says_what_python_says(name):
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


@named
def test_ufl_says_what_python_says(name):
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
def test_json_brings_it_back(name):
    equation = equation_of(name, CASES[name][0])
    text = json.dumps(equation_to_json(equation))
    assert equation_from_json(json.loads(text)) == equation


@named
def test_latex_has_the_equation_of_the_state_and_its_numbers(name):
    values = CASES[name][0]
    written = write_equation(equation_of(name, values), "latex")
    effect = make_effect(name)
    assert effect.equation in written
    for parameter in effect.parameters:
        assert f"{parameter.symbol} = {values[parameter.name]:g}" in written
    assert effect.equation in equation_of(name, values).latex()


STATES = [name for name, e in named_effects().items() if isinstance(e, StateEffect)]


@pytest.mark.parametrize("name", STATES)
def test_what_is_written_is_what_is_integrated(name):
    effect = make_effect(name)
    written, generator = effect.written(), np.random.default_rng(3)
    for _ in range(5):
        values = generator.uniform(0.1, 0.9, len(effect.parameters))
        rate, stress = generator.uniform(0.1, 3.0, 2)
        levels = generator.uniform(0.1, 1.0, effect.levels)
        state = jnp.asarray(levels if effect.levels > 1 else levels[0])
        told = dict(zip((p.name for p in effect.parameters), values, strict=True))
        told |= dict(zip(effect.level_names, levels, strict=True))
        told |= {"shear_rate": rate, "shear_stress": stress}
        at = {sympy.Symbol(key, real=True): value for key, value in told.items()}
        source, decay = effect.source_and_decay(jnp.asarray(values), rate, stress)
        wanted = np.atleast_1d(source - decay * state)
        found = [float(one.subs(at)) for one in written.rates]
        np.testing.assert_allclose(found, wanted, rtol=1e-10)
        for factor in ("modulus_factor", "time_factor"):
            own = float(sympy.sympify(getattr(written, factor)).subs(at))
            exact = float(getattr(effect, factor)(jnp.asarray(values), state))
            assert own == pytest.approx(exact, rel=1e-12)


def test_two_states_at_once_multiply():
    both = (StatePart("thixotropy", CASES["thixotropy"][0]), StatePart("viscous_heating", HEAT))
    module = module_of(write_equation(Equation((), (MODULUS,), (TIME,), states=both), "python"))
    assert module["structure_factors"](np.array([0.5, 0.2])) == pytest.approx((0.5, np.exp(-0.2)))
    stress, gradient = MODULUS * np.ones((1, 3, 3)), UNIT["shear"]
    (_, warming) = module["structure_rate"](stress, gradient, np.array([0.5, 0.2]))
    assert warming == pytest.approx(1e-6 * 0.5 * MODULUS - 0.2 / 3.0)


def test_rheotool_and_a_simulation_of_one_mode_are_refused_in_words():
    equation = equation_of("thixotropy", CASES["thixotropy"][0])
    with pytest.raises(InputError, match="gives the whole fluid a state: rheoTool has it not"):
        write_equation(equation, "rheotool")
    with pytest.raises(InputError, match="no law of one mode carries"):
        equation.fluid()


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
