"""Laws with a name, in two modes whose constants differ, read back from every format.

The reference is each law as its authors write it, integrated by scipy; every text is read by what
would run it, and integrated by scipy too.
"""

import json
import re

import jax.numpy as jnp
import numpy as np
import pytest
from independent import authors
from independent.homogeneous import UNIT
from readers import (
    by_python,
    by_rheotool,
    by_sympy,
    in_ufl,
    integrated,
    module_of,
    read_latex,
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
from discover.equations.spelling.markup import law_element
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
    "rolie_poly_fene": (
        {"stretch_time_ratio": 0.3, "beta": 0.5, "maximum_stretch": 2.0},
        {"stretch_time_ratio": 0.3, "beta": 0.5, "maximum_stretch": 3.0},
    ),
    "xpp": (
        {"q": 4.0, "stretch_time_ratio": 0.25, "alpha": 0.1},
        {"q": 4.0, "stretch_time_ratio": 0.25, "alpha": 0.2},
    ),
    "white_metzner": ({"k": 0.8, "n": 0.4}, {"k": 0.5, "n": 0.4}),
    "saramito": ({"yield_strain": 0.4}, {"yield_strain": 0.2}),
    "giesekus_non_affine": ({"alpha": 0.2, "xi": 0.1}, {"alpha": 0.3, "xi": 0.1}),
    "ptt_exponential_non_affine": ({"epsilon": 0.2, "xi": 0.15}, {"epsilon": 0.1, "xi": 0.15}),
}  # fmt: skip
every_law = pytest.mark.parametrize("name", CONSTANTS)


def equation(name, constants=None):
    return Equation((), MODULUS, TIME, named=NamedPart(name, constants or CONSTANTS[name]))


def reference(name, gradient):
    law = getattr(authors, name)
    modes = zip(MODULUS, TIME, CONSTANTS[name], strict=True)
    return sum(g * authors.stress(law, c, gradient, TIMES, time) for g, time, c in modes)


def by_name(text):
    """The name and the constants; the equation is the authors' in the stress, by A = I + σ."""
    content = json.loads(text)["named"]
    law = getattr(authors, content["law"])

    def rates(k, stress, y, gradient):
        assert content["law"] != "rolie_poly_fene"  # where σ is not A − I
        scaled, s = gradient * TIME[k], stress / MODULUS[k]
        a = np.eye(3) + s
        change = scaled @ a + a @ scaled.T + law(a, scaled, **content["constants"][k])
        return MODULUS[k] / TIME[k] * change, y

    return rates


READERS = {"python": by_python, "sympy": by_sympy, "json": by_name}


@every_law
def test_every_text_flows_as_the_law_in_shear_and_in_extension(name):
    texts = {form: write_equation(equation(name), form) for form in FORMATS if form != "rheotool"}
    if name == "giesekus_non_affine":
        with pytest.raises(InputError, match="rheoTool cannot take this law"):
            write_equation(equation(name), "rheotool")
    else:
        texts["rheotool"] = write_equation(equation(name), "rheotool")
    read = {form: reader(texts[form]) for form, reader in READERS.items()}
    if name == "rolie_poly_fene":
        del read["json"]
    for gradient in GRADIENTS.values():
        wanted = reference(name, gradient)
        scale = np.max(np.abs(wanted))
        found = {form: integrated(rates, gradient, TIMES) for form, rates in read.items()}
        if "rheotool" in texts:
            found["rheotool"] = by_rheotool(texts["rheotool"], gradient, TIMES)
        for form, stress in found.items():
            # rtol of the integrations, 1e-8, with room for ten times as fast a retraction
            assert np.max(np.abs(stress - wanted)) < 1e-6 * scale, form


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
        np.testing.assert_allclose(
            np.reshape(found, (3, 3)), wanted, atol=1e-10 * np.max(abs(wanted))
        )


@every_law
def test_latex_says_the_law_and_has_the_constants_of_each_mode(name):
    text = write_equation(equation(name), "latex")
    law = text.split("\\begin{equation}\n")[1].split("\n\\end{equation}")[0].strip()
    where, modes = (
        part.split("\n\\end{align}")[0].splitlines() for part in text.split("\\begin{align}\n")[1:]
    )
    for k, constants in enumerate(CONSTANTS[name]):
        numbers = [entry.split("&=") for entry in modes[k].split(r"\\")[0].split(", & ")]
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
            np.testing.assert_allclose(
                found, wanted, atol=1e-7 * np.max(abs(wanted))
            )  # nine digits


@every_law
def test_json_gives_back_the_constants_of_each_mode(name):
    one = equation(name)
    assert equation_from_json(json.loads(write_equation(one, "json"))) == one


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
