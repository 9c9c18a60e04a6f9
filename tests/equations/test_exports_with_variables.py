"""A law with a structure variable, in two modes, read back from every format with its equation.

The reference is the pom-pom law in orientation and stretch, each integrated apart by scipy; every
text is read by what would run it, and integrated by scipy too.
"""

import jax.numpy as jnp
import numpy as np
import pytest
from independent import PomPom
from independent.homogeneous import UNIT
from readers import (
    by_python,
    by_sympy,
    followed,
    in_ufl,
    integrated,
    module_of,
    read_latex,
    shear_quantities,
    states,
    ufl_number,
    value,
)

from discover.equations import Equation, NamedPart, write_equation
from discover.errors import InputError
from discover.laws import make_law
from discover.laws.textbook.pom_pom import _FADES

MODULUS, TIME = (40.0, 5.0), (0.3, 1.5)
TIMES = np.linspace(0.1, 1.5, 8)
CONSTANTS = ({"q": 4.0, "stretch_time_ratio": 0.3}, {"q": 5.0, "stretch_time_ratio": 0.3})
GRADIENTS = {"shear": 2.5 * UNIT["shear"], "extension": 0.6 * UNIT["uniaxial"]}
both = pytest.mark.parametrize("name", ["pom_pom", "pom_pom_drag_strain"])


def text(name, form, constants=CONSTANTS):
    return write_equation(Equation((), MODULUS, TIME, named=NamedPart(name, constants)), form)


def reference(name, gradient):
    total = 0.0
    for g, time, c in zip(MODULUS, TIME, CONSTANTS, strict=True):
        law = PomPom(
            c["q"], c["stretch_time_ratio"] * time, g, time, name == "pom_pom_drag_strain", _FADES
        )
        states = followed(law.change, law.rest(), gradient, TIMES, rtol=1e-9, atol=1e-11)
        total = total + np.array([law.stress(y, 0.0) for y in states])
    return total


def flowing(rates, gradient):
    # the kinks of fading growth cost an integration of 1e-9 some digits
    return integrated(rates, gradient, TIMES, variables=1, tolerance=1e-9)


@both
@pytest.mark.parametrize("form", ["python", "sympy"])
def test_a_text_flows_as_the_law_in_shear_and_in_extension(name, form):
    rates = by_python(text(name, form), 1) if form == "python" else by_sympy(text(name, form))
    for gradient in GRADIENTS.values():
        wanted = reference(name, gradient)
        assert np.max(np.abs(flowing(rates, gradient) - wanted)) < 1e-5 * np.max(np.abs(wanted))


def test_constants_that_are_exchanged_between_modes_would_show():
    """Negative control of the test above."""
    rates = by_python(text("pom_pom", "python", CONSTANTS[::-1]), 1)
    gradient = 3.0 * UNIT["uniaxial"]
    wanted = reference("pom_pom", gradient)
    assert np.max(np.abs(flowing(rates, gradient) - wanted)) > 1e-3 * np.max(np.abs(wanted))


def test_the_integrator_in_the_text_carries_the_variable_along():
    module = module_of(text("pom_pom", "python"))
    times = np.concatenate([[0.0], TIMES])
    found = np.transpose(module["simulate_shear"](lambda t: 2.5, times))[1:]
    wanted = shear_quantities(reference("pom_pom", GRADIENTS["shear"])).T
    # steps of a fiftieth of the shortest time, of fourth order
    np.testing.assert_allclose(found, wanted, atol=1e-4 * np.max(wanted))


def of_flow_plane():
    """Return stresses, variables and rates of deformation without what no four components hold."""
    for y, (stress, gradient) in zip((0.3, -1.1, 0.8), states(), strict=True):
        yield in_flow_plane(stress), y, in_flow_plane(gradient + gradient.T)


def in_flow_plane(tensor):
    """Return a tensor without what no four components hold."""
    kept = np.diag(np.diag(tensor))
    kept[0, 1] = kept[1, 0] = tensor[0, 1]
    return kept


def own(name, constants, stress, y, rate):
    """Return h and the rate of y over 1/λ of the package's own law, of four components."""
    places = ([0, 1, 2, 0], [0, 1, 2, 1])
    state = jnp.asarray(np.append(stress[places], y))
    extra = np.asarray(make_law(name, constants).extra_term(state, jnp.asarray(rate[places])))
    return extra[:4], -y - extra[4]


@both
def test_ufl_says_stress_and_variable(name):
    ufl = pytest.importorskip("ufl")
    module = module_of(text(name, "ufl"))
    for stress, y, d in of_flow_plane():
        s, variables = in_ufl(stress), [ufl.as_ufl(y)]
        extra = module["extra_term"](s, in_ufl(d), 1, variables)
        wanted, changing = own(name, CONSTANTS[1], stress, y, d)
        places = [(0, 0), (1, 1), (2, 2), (0, 1)]
        found = [ufl_number(extra, place) for place in places]
        np.testing.assert_allclose(found, wanted, atol=1e-12 * np.max(np.abs(wanted)))
        asked = in_ufl(MODULUS[1] * stress), in_ufl(d / 2)
        (rate,) = module["variables_rate"](*asked, 1, variables)
        _, changing = own(name, CONSTANTS[1], stress, y, TIME[1] * d)
        assert ufl_number(rate) == pytest.approx(changing / TIME[1], rel=1e-12)


@both
def test_latex_says_how_the_variable_changes(name):
    written = text(name, "latex")
    lines = written.split("\\begin{align}\n")[1].split("\n\\end{align}")[0].splitlines()
    equations = [line.removesuffix(r" \\").strip().split(" &= ") for line in lines]
    assert equations[0][0] == r"\dot{y}"
    for stress, y, d in of_flow_plane():
        letters = {"sigma": stress, "gamma": d, "I": np.eye(3), "y": y, "e": np.e}
        letters["q"] = CONSTANTS[0]["q"]
        # constants stand last, and each line is over those before it and the constants
        for left, right in [equations[-1], *equations[1:-1]]:
            letters[read_latex(left).name] = value(read_latex(right), letters)
        _, wanted = own(name, CONSTANTS[0], stress, y, d)
        assert value(read_latex(equations[0][1]), letters) == pytest.approx(wanted, rel=1e-12)


def test_rheotool_says_that_it_has_no_such_law():
    with pytest.raises(InputError, match="the law pom_pom: rheoTool has no such law"):
        text("pom_pom", "rheotool")
