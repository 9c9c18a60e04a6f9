"""What Python text, SymPy, JSON and rheoTool say, each evaluated by what would run it."""

import ast
import json

import numpy as np
import pytest
import sympy
from readers import (
    in_ufl,
    module_of,
    rheotool_modes,
    sum_of_spelled,
    ufl_number,
    value,
)
from spelled_laws import BOTH_SIGNS, LIBRARY, LIBRARY_LAWS, NAMED_LAWS, STATES, agree, sum_of

from discover.equations import Equation, equation_from_json, write_equation
from discover.errors import InputError
from tensor_library import LawTerm, parse_term


def _by_python(equation):
    module = module_of(write_equation(equation, "python"))
    return [module["extra_term"](*state) for state in STATES]


def _by_sympy_text(equation):
    body = ast.parse(write_equation(equation, "sympy")).body
    assigned = [n for n in body if isinstance(n, ast.Assign) and n.targets[0].id == "extra_term"]
    code = compile(ast.Expression(assigned[0].value), "law", "eval")
    found = []
    for stress, rate in STATES:
        s, d = sympy.Matrix(stress), sympy.Matrix(rate)
        names = {"sympy": sympy, "unit": sympy.eye(3), "s": s, "d": d}
        found.append(eval(code, names).evalf())
    return found


def _by_sympy_expression(equation):
    expression = equation.sympy()
    letters = ({"sigma": s, "gammadot": d, "I": np.eye(3)} for s, d in STATES)
    return [value(expression, one, True) + np.zeros((3, 3)) for one in letters]


def _by_json(equation):
    """By the canonical spelling itself, read with the precedence of Python."""
    content = json.loads(write_equation(equation, "json"))
    assert equation_from_json(content) == equation
    terms = [(term["term"], term["coefficient"], term["inner"]) for term in content["terms"]]
    return [sum_of_spelled(terms, stress, rate) for stress, rate in STATES]


@pytest.mark.parametrize("read", [_by_python, _by_sympy_text, _by_sympy_expression, _by_json])
@pytest.mark.parametrize("name", BOTH_SIGNS)
def test_the_text_of_every_term_law_and_effect_says_it(name, read):
    spelled = BOTH_SIGNS[name]
    assert agree(read(spelled.equation), spelled.extra)


# the pieces of those of degree two are those of degree one, and powers
SPELLED_IN_UFL = [
    name for name in LIBRARY_LAWS if parse_term(name).degree < 2 or "^2" in name
] + [*NAMED_LAWS]  # fmt: skip


@pytest.mark.parametrize("name", SPELLED_IN_UFL)
def test_the_ufl_text_of_terms_laws_and_effects_says_them(name):
    pytest.importorskip("ufl")
    spelled = (LIBRARY_LAWS | NAMED_LAWS)[name]
    module = module_of(write_equation(spelled.equation, "ufl"))
    stress, rate = STATES[1]
    extra = module["extra_term"](in_ufl(stress), in_ufl(rate))
    found = [[ufl_number(extra, (i, j)) for j in range(3)] for i in range(3)]
    assert agree(found, spelled.extra[1])


def _physical_rate(equation, stress, gradient):
    """dτ/dt beside the convected terms, in Pa/s, of a one-mode equation without solvent."""
    (modulus,), (time,) = equation.modulus, equation.relaxation_time
    s, d = stress / modulus, time * (gradient + gradient.T)
    terms = [(term.term, term.coefficient, dict(term.inner)) for term in equation.terms]
    extra = sum_of_spelled(terms, s, d)
    return modulus / time * (d - s - extra)


def _rheotool_rate(text, stress, gradient):
    """The same by rheoTool's sources."""
    (mode,) = rheotool_modes(text)
    return mode.rate(stress, gradient) - gradient @ stress - stress @ gradient.T


TAKEN = {
    "sigma": (0.2, -0.2),
    "gammadot": (0.2, -0.2),
    "sigma.sigma": (0.2,),
    "sigma.gammadot+gammadot.sigma": (0.2,),
    "tr(sigma)*sigma": (0.2,),
    "(exp(epsilon*tr(sigma))-1)*sigma": (1.0,),
}


def test_rheotool_takes_a_term_as_it_is_or_refuses_it_by_name():
    """Every term of the library alone, with either sign."""
    for index, name in enumerate(LIBRARY.names):
        size = 1.0 if name.startswith("(exp") else 0.2
        for coefficient in (size, -size):
            terms = sum_of([index], [coefficient]).equation.terms
            equation = Equation(terms, (7.0,), (0.4,))
            if coefficient not in TAKEN.get(name, ()):
                with pytest.raises(InputError) as refusal:
                    write_equation(equation, "rheotool")
                assert name in str(refusal.value)
                continue
            text = write_equation(equation, "rheotool")
            for stress, rate in STATES:
                state = (7.0 * stress, 0.5 * rate / 0.4)
                wanted = _physical_rate(equation, *state)
                assert agree(_rheotool_rate(text, *state), wanted), name


_SLIP = LawTerm("sigma.gammadot+gammadot.sigma", 0.1)
_EXPONENTIAL = LawTerm("(exp(epsilon*tr(sigma))-1)*sigma", 1.0, {"epsilon": 0.3})


@pytest.mark.parametrize(
    "terms",
    [
        (_SLIP, LawTerm("tr(sigma)*sigma", 0.3)),
        (_SLIP, _EXPONENTIAL),
        (_SLIP, _EXPONENTIAL, LawTerm("gammadot", 0.3)),
        (LawTerm("sigma", 0.5), LawTerm("sigma.sigma", 0.3), LawTerm("gammadot", 0.3)),
        (LawTerm("sigma", 0.5), LawTerm("tr(sigma)*sigma", 0.3), _SLIP),
    ],
    ids=lambda terms: " and ".join(t.term for t in terms),
)
def test_rheotool_takes_these_terms_together(terms):
    equation = Equation(terms, (7.0,), (0.4,))
    text = write_equation(equation, "rheotool")
    for stress, rate in STATES:
        wanted = _physical_rate(equation, 7.0 * stress, rate)
        assert agree(_rheotool_rate(text, 7.0 * stress, rate), wanted)
