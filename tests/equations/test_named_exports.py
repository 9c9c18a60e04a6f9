"""Laws with a name, in two modes whose constants differ, read back from every format.

The reference is each law as its authors write it, integrated by scipy; every text is read by what
would run it, and integrated by scipy too.
"""

import json
import re

import jax.numpy as jnp
import numpy as np
import pytest
from independent import StressLaw
from independent.homogeneous import UNIT
from independent.named import material
from readers import (
    by_json,
    by_python,
    by_rheotool,
    by_sympy,
    in_ufl,
    integrated,
    module_of,
    read_latex,
    shear_quantities,
    states,
    ufl_number,
    value,
)

from discover.equations import (
    FORMATS,
    Equation,
    NamedPart,
    equation_from_json,
    equation_to_json,
    law_parts,
    write_equation,
)
from discover.equations.markup import law_element
from discover.errors import InputError
from discover.laws import LAWS, make_law
from discover.laws.registry import starting_values
from tensor_library import LawTerm

MODULUS, TIME = (40.0, 5.0), (0.3, 1.5)
TIMES = np.linspace(0.1, 1.5, 8)
GRADIENTS = {"shear": 2.5 * UNIT["shear"], "extension": 0.6 * UNIT["uniaxial"]}
# of each mode; what is alike in both is written once in LaTeX
CONSTANTS = {
    "rolie_poly": tuple({"stretch_time_ratio": ratio, "beta": 0.7} for ratio in (0.3, 0.2)),
    "rolie_poly_fene": tuple(
        {"stretch_time_ratio": 0.3, "beta": 0.5, "maximum_stretch": most} for most in (2.0, 3.0)
    ),
    "xpp": tuple({"q": 4.0, "stretch_time_ratio": 0.25, "alpha": a} for a in (0.1, 0.2)),
    "white_metzner": ({"k": 0.8, "n": 0.4}, {"k": 0.5, "n": 0.4}),
    "saramito": ({"yield_strain": 0.4}, {"yield_strain": 0.2}),
    "giesekus_non_affine": ({"alpha": 0.2, "xi": 0.1}, {"alpha": 0.3, "xi": 0.1}),
    "ptt_exponential_non_affine": ({"epsilon": 0.2, "xi": 0.15}, {"epsilon": 0.1, "xi": 0.15}),
}  # fmt: skip
# of orientation and stretch, each integrated apart; their structure variable is a logarithm
POM_POMS = dict.fromkeys(
    ("pom_pom", "pom_pom_drag_strain"),
    ({"q": 4.0, "stretch_time_ratio": 0.3}, {"q": 5.0, "stretch_time_ratio": 0.3}),
)
OF_STRESS, CONSTANTS = CONSTANTS, CONSTANTS | POM_POMS
every_law = pytest.mark.parametrize("name", CONSTANTS)
of_stress = pytest.mark.parametrize("name", OF_STRESS)
of_variables = pytest.mark.parametrize("name", POM_POMS)


def equation(name, constants=None):
    return Equation((), MODULUS, TIME, named=NamedPart(name, constants or CONSTANTS[name]))


def reference(name, gradient):
    modes = zip(CONSTANTS[name], MODULUS, TIME, strict=True)
    return sum(material(name, *mode).held(gradient, TIMES) for mode in modes)


def by_name(text):
    """The name and the constants; the equation is the authors', in σ or in A = I + σ/G."""
    content = json.loads(text)["named"]

    def rates(k, stress, y, gradient):
        assert content["law"] != "rolie_poly_fene"  # where σ is not G (A − I)
        law = material(content["law"], content["constants"][k], MODULUS[k], TIME[k])
        if isinstance(law, StressLaw):
            return law.stress_change(stress, gradient), y
        change = law.change(np.eye(3) + stress / MODULUS[k], gradient)
        return MODULUS[k] * change.reshape(3, 3), y

    return rates


@every_law
def test_every_text_flows_as_the_law_in_shear_and_in_extension_and_json_gives_it_back(name):
    texts = {form: write_equation(equation(name), form) for form in FORMATS if form != "rheotool"}
    assert equation_from_json(json.loads(texts["json"])) == equation(name)
    variables = int(name in POM_POMS)
    if name == "giesekus_non_affine" or variables:
        with pytest.raises(InputError, match="rheoTool cannot take this law"):
            write_equation(equation(name), "rheotool")
    else:
        texts["rheotool"] = write_equation(equation(name), "rheotool")
    read = {"python": by_python(texts["python"], variables), "sympy": by_sympy(texts["sympy"])}
    if name != "rolie_poly_fene" and not variables:
        read["json"] = by_name(texts["json"])
    # with room for ten times as fast a retraction, and for the kinks of fading growth
    tolerance, allowed = (1e-9, 1e-5) if variables else (1e-8, 1e-6)
    for gradient in GRADIENTS.values():
        wanted = reference(name, gradient)
        scale = np.max(np.abs(wanted))
        found = {
            form: integrated(rates, gradient, TIMES, 2, variables, tolerance)
            for form, rates in read.items()
        }
        if "rheotool" in texts:
            found["rheotool"] = by_rheotool(texts["rheotool"], gradient, TIMES)
        for form, stress in found.items():
            assert np.max(np.abs(stress - wanted)) < allowed * scale, form


SOLVENT, TOGETHER = 2.5, {"epsilon": 0.2, "xi": 0.15}
TERMS = (
    LawTerm("sigma.gammadot+gammadot.sigma", 0.5 * TOGETHER["xi"]),
    LawTerm("(exp(epsilon*tr(sigma))-1)*sigma", 1.0, {"epsilon": TOGETHER["epsilon"]}),
)
# the rates of a mode, and the solvent's viscosity
READERS = {
    "python": (by_python, lambda text: module_of(text)["SOLVENT_VISCOSITY_PA_S"]),
    "sympy": (by_sympy, lambda text: module_of(text)["solvent_viscosity_Pa_s"]),
    "json": (by_json, lambda text: json.loads(text)["solvent_viscosity_Pa_s"]),
}


@pytest.mark.parametrize("form", [*READERS, "rheotool"])
def test_a_sum_of_terms_flows_as_its_law_in_every_mode_and_in_the_solvent(form):
    text = write_equation(Equation(TERMS, MODULUS, TIME, True, SOLVENT), form)
    # shear and extension at once, so that fewer components stay zero
    gradient = sum(GRADIENTS.values())
    rate = gradient + gradient.T
    if form == "rheotool":
        found = by_rheotool(text, gradient, TIMES)
    else:
        rates, solvent = READERS[form]
        found = integrated(rates(text), gradient, TIMES) + solvent(text) * rate

    def off(**constants):
        modes = (
            material("ptt_exponential_non_affine", constants, *mode)
            for mode in zip(MODULUS, TIME, strict=True)
        )
        wanted = sum(mode.held(gradient, TIMES) for mode in modes) + SOLVENT * rate
        return np.max(np.abs(found - wanted)) / np.max(np.abs(wanted))

    assert off(**TOGETHER) < 1e-5
    # negative control: a slip parameter that is a tenth off shows
    assert off(**TOGETHER | {"xi": 1.1 * TOGETHER["xi"]}) > 1e-3


def test_constants_that_are_exchanged_between_modes_would_show():
    """Negative control of the test above."""
    other = equation("xpp", CONSTANTS["xpp"][::-1])
    wanted = reference("xpp", GRADIENTS["extension"])
    found = integrated(by_python(write_equation(other, "python")), GRADIENTS["extension"], TIMES)
    assert np.max(np.abs(found - wanted)) > 1e-3 * np.max(np.abs(wanted))


def symmetric_states():
    return ((stress, gradient + gradient.T) for stress, gradient in states())


def extra_of(name, constants, stress, rate):
    law = make_law(name, constants)
    return np.asarray(law.extra_term(jnp.asarray(stress), jnp.asarray(rate)))


# a law with variables behind its stress is no function of the stress, and leaves as JSON alone
@pytest.mark.parametrize("name", [n for n in LAWS if not make_law(n, starting_values(n)).variables])
def test_ufl_says_every_law_that_has_a_name(name):
    pytest.importorskip("ufl")
    module = module_of(write_equation(equation(name, (starting_values(name),)), "ufl"))
    for stress, gradient in states():
        arguments = (in_ufl(g * x) for g, x in ((MODULUS[1], stress), (1, gradient)))
        expression = module["stress_rate"](*arguments, 1)
        place = [(i, j) for i in range(3) for j in range(3)]
        found = [ufl_number(expression, ij) for ij in place]
        scaled = TIME[1] * gradient
        d = scaled + scaled.T
        wanted = d + scaled @ stress + stress @ scaled.T - stress
        wanted = wanted - extra_of(name, starting_values(name), stress, d)
        wanted *= MODULUS[1] / TIME[1]
        off = np.abs(np.reshape(found, (3, 3)) - wanted)
        assert np.max(off) < 1e-10 * np.max(np.abs(wanted))


@of_stress
def test_latex_says_the_law_and_has_the_constants_of_each_mode(name):
    text = write_equation(equation(name), "latex")
    law = text.split("\\begin{equation}\n")[1].split("\n\\end{equation}")[0].strip()
    where, modes = (
        part.split("\n\\end{align}")[0].splitlines() for part in text.split("\\begin{align}\n")[1:]
    )
    for k, constants in enumerate(CONSTANTS[name]):
        numbers = [entry.split("&=") for entry in modes[k].split(r"\\")[0].split(", & ")]
        scale = [float(right.partition(r"\,")[0]) for _, right in numbers[:2]]
        assert scale == [MODULUS[k], TIME[k]]
        own = {
            read_latex(left.strip().replace(f"_{{{k + 1}}}", "")).name: float(right)
            for left, right in numbers[2:]
        }
        assert set(own.values()) == {
            v for n, v in constants.items() if v != CONSTANTS[name][1 - k][n]
        }
        lines = [line.removesuffix(r" \\").split(" &= ") for line in where]
        # constants stand last
        numbers = [line for line in lines if re.fullmatch(r"[\d.]+", line[1])]
        for stress, rate in symmetric_states():
            letters = {"sigma": stress, "gamma": rate, "I": np.eye(3), "e": np.e, **own}
            for left, right in [*numbers, *(line for line in lines if line not in numbers)]:
                letters[read_latex(left).name] = value(read_latex(right), letters)
            left = law.partition(" = ")[0].removeprefix(r"\overset{\nabla}{\boldsymbol{\sigma}} + ")
            found = value(read_latex(left), letters) - stress
            wanted = extra_of(name, constants, stress, rate)
            # nine digits
            np.testing.assert_allclose(found, wanted, atol=1e-7 * np.max(abs(wanted)))


def test_terms_are_added_to_a_law_with_a_name():
    law = make_law("rolie_poly", CONSTANTS["rolie_poly"][0])
    term = LawTerm("sigma.gammadot+gammadot.sigma", 0.1)
    both = Equation((term,), named=law_parts(law)[0])
    again = equation_from_json(equation_to_json(both))
    module = module_of(write_equation(again, "python"))
    for stress, rate in symmetric_states():
        wanted = extra_of("rolie_poly", CONSTANTS["rolie_poly"][0], stress, rate)
        wanted = wanted + 0.1 * (stress @ rate + rate @ stress)
        np.testing.assert_allclose(module["extra_term"](stress, rate), wanted, rtol=1e-12)
        by_law = again.law().extra_term(jnp.asarray(stress), jnp.asarray(rate))
        np.testing.assert_allclose(by_law, wanted, rtol=1e-12)
    with pytest.raises(InputError, match="cannot add terms to rolie_poly"):
        write_equation(again, "rheotool")
    assert "<msqrt>" in law_element(both.terms, True, both.named)
    assert "scalar" not in law_element(both.terms, True, both.named)


def test_a_law_of_the_users_own_that_nobody_wrote_out_is_kept_by_name_and_refused_as_text():
    from discover.laws import NamedLaw

    LAWS["of_this_test"] = NamedLaw("of this test", LAWS["xpp"].build, LAWS["xpp"].parameters)
    try:
        one = equation("of_this_test", CONSTANTS["xpp"][:1])
        assert equation_from_json(equation_to_json(one)) == one
        for form in ("python", "sympy", "ufl", "latex"):
            with pytest.raises(InputError, match="`written`"):
                write_equation(one, form)
    finally:
        del LAWS["of_this_test"]


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"law": "nobody"}, "Unknown law 'nobody'"),
        ({"constants": [{"q": 4.0}]}, "needs its parameter"),
        ({"constants": [{"q": -4.0, "stretch_time_ratio": 0.2, "alpha": 0.1}]}, "from 1 to 100"),
        ({"constants": [CONSTANTS["xpp"][0]] * 3}, "once for each"),
        ({"constants": []}, "named.constants"),
    ],
)
def test_a_name_or_a_constant_that_is_none_is_refused(change, word):
    content = equation_to_json(equation("xpp"))
    content["named"] |= change
    with pytest.raises(InputError, match=word):
        equation_from_json(content)


def test_the_integrator_in_the_text_carries_the_variable_along():
    module = module_of(write_equation(equation("pom_pom"), "python"))
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
    kept = np.diag(np.diag(tensor))
    kept[0, 1] = kept[1, 0] = tensor[0, 1]
    return kept


def own(name, constants, stress, y, rate):
    """Return h and the rate of y over 1/λ of the package's own law, of four components."""
    places = ([0, 1, 2, 0], [0, 1, 2, 1])
    state = jnp.asarray(np.append(stress[places], y))
    extra = np.asarray(make_law(name, constants).extra_term(state, jnp.asarray(rate[places])))
    return extra[:4], -y - extra[4]


@of_variables
def test_ufl_and_latex_say_stress_and_how_the_variable_changes(name):
    ufl = pytest.importorskip("ufl")
    module = module_of(write_equation(equation(name), "ufl"))
    for stress, y, d in of_flow_plane():
        s, variables = in_ufl(stress), [ufl.as_ufl(y)]
        extra = module["extra_term"](s, in_ufl(d), 1, variables)
        wanted, changing = own(name, CONSTANTS[name][1], stress, y, d)
        places = [(0, 0), (1, 1), (2, 2), (0, 1)]
        found = [ufl_number(extra, place) for place in places]
        np.testing.assert_allclose(found, wanted, atol=1e-12 * np.max(np.abs(wanted)))
        asked = in_ufl(MODULUS[1] * stress), in_ufl(d / 2)
        (rate,) = module["variables_rate"](*asked, 1, variables)
        _, changing = own(name, CONSTANTS[name][1], stress, y, TIME[1] * d)
        assert ufl_number(rate) == pytest.approx(changing / TIME[1], rel=1e-12)
    written = write_equation(equation(name), "latex")
    lines = written.split("\\begin{align}\n")[1].split("\n\\end{align}")[0].splitlines()
    equations = [line.removesuffix(r" \\").strip().split(" &= ") for line in lines]
    assert equations[0][0] == r"\dot{y}"
    for stress, y, d in of_flow_plane():
        letters = {"sigma": stress, "gamma": d, "I": np.eye(3), "y": y, "e": np.e}
        letters["q"] = CONSTANTS[name][0]["q"]
        # constants stand last, and each line is over those before it and the constants
        for left, right in [equations[-1], *equations[1:-1]]:
            letters[read_latex(left).name] = value(read_latex(right), letters)
        _, wanted = own(name, CONSTANTS[name][0], stress, y, d)
        assert value(read_latex(equations[0][1]), letters) == pytest.approx(wanted, rel=1e-12)
