"""Every spelling of a law, on pages and in files, read by what would run or draw it."""

import ast
import json
import xml.etree.ElementTree as ElementTree
from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest
import sympy
from readers import in_ufl, module_of, read_latex, rheotool_modes, sum_of_spelled, ufl_number, value
from spelled_laws import (
    BOTH_SIGNS,
    EFFECTS,
    LIBRARY,
    LIBRARY_LAWS,
    NAMED_LAWS,
    STATES,
    agree,
    sum_of,
)

from discover.comparison.comparison import Comparison
from discover.equations import Equation, NamedPart, equation_from_json, write_equation
from discover.equations.markup import (
    SEPARATOR,
    law_element,
    law_latex,
    sum_elements,
    term_element,
)
from discover.errors import InputError
from discover.laws import LAWS
from discover.report.comparison.report import equations_tex
from tensor_library import CandidateTerm, LawTerm, parse_term


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
    ((_, law),) = rheotool_modes(text)
    return law.stress_change(stress, gradient) - gradient @ stress - stress @ gradient.T


TAKEN = {
    "sigma": (0.2, -0.2), "gammadot": (0.2, -0.2), "sigma.sigma": (0.2,),
    "sigma.gammadot+gammadot.sigma": (0.2,), "tr(sigma)*sigma": (0.2,),
    "(exp(epsilon*tr(sigma))-1)*sigma": (1.0,),
}  # fmt: skip


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


def extra_by_latex(law, letters=()):
    """Return h at every state from the left-hand side, the convected derivative + σ + h."""
    law, *assigned = law.split(r", \qquad ")
    left, _, right = law.partition(" = ")
    assert right == r"\dot{\boldsymbol{\gamma}}"
    head = r"\overset{\nabla}{\boldsymbol{\sigma}} + "
    assert left.startswith(head)
    left = left.removeprefix(head)
    inner = {e.lhs.name: float(e.rhs) for e in map(read_latex, assigned)} | dict(letters)
    found = []
    for stress, rate in STATES:
        letters = {"sigma": stress, "gamma": rate, "I": np.eye(3), "e": np.e, **inner}
        found.append(value(read_latex(left), letters) - stress)
    return np.array(found)


def law_line(equation):
    text = write_equation(equation, "latex")
    return text.split("\\begin{equation}\n  ")[1].split("\n\\end{equation}")[0]


# Every tensor with every multiplier of degree 0 and 1 and with every closed form. Of degree 2,
# where reading all would take a minute, every multiplier with one tensor in turn; that the others
# are the same pieces is the test below.
READ = {name: s for name, s in LIBRARY_LAWS.items() if parse_term(name).degree < 2}
DEGREE_TWO = [i for i, term in enumerate(LIBRARY.terms) if term.degree == 2]
IN_TURN = [i for k, i in enumerate(DEGREE_TWO) if i % 8 == (k // 8) % 8]


@pytest.mark.parametrize("name", READ)
def test_the_latex_of_every_library_term_says_the_term(name):
    spelled = READ[name]
    text = law_line(spelled.equation)
    assert agree(extra_by_latex(text), spelled.extra)
    assert spelled.equation.latex() == text  # three digits: .latex() rounds nothing either
    if parse_term(name).degree == 0:
        assert agree(extra_by_latex(law_line(spelled.flipped.equation)), -spelled.extra)


@pytest.mark.parametrize("half", [0, 1])
def test_the_latex_of_degree_two_says_the_terms(half):
    chosen = IN_TURN[half::2]
    assert len({LIBRARY.terms[i].powers for i in IN_TURN}) == len(IN_TURN) == len(DEGREE_TWO) / 8
    spelled = sum_of(chosen, [0.2 * (-1) ** k for k in range(len(chosen))])
    assert agree(extra_by_latex(law_line(spelled.equation)), spelled.extra)


def test_every_term_of_degree_two_is_made_of_pieces_that_were_read():
    tensors = {i: CandidateTerm(i).latex() for i in range(8)}
    for term in LIBRARY.terms:
        if term.degree == 2:
            multiplier = CandidateTerm(0, term.powers).latex().removesuffix(tensors[0])
            assert term.latex() == multiplier + tensors[term.tensor]


@pytest.mark.parametrize("name", NAMED_LAWS)
def test_the_latex_of_laws_and_effects_says_the_law(name):
    spelled = NAMED_LAWS[name]
    assert agree(extra_by_latex(law_line(spelled.equation)), spelled.extra, 1e-8)  # nine digits
    if any("+" in t.term for t in spelled.equation.terms):
        assert agree(extra_by_latex(law_line(spelled.flipped.equation)), -spelled.extra, 1e-8)


def test_a_sum_without_its_brackets_is_another_law():
    """Negative control: what was written before."""
    spelled = sum_of([5], [0.2])
    right = law_line(spelled.equation)
    wrong = right.replace(r"\left(", "").replace(r"\right)", "")
    assert agree(extra_by_latex(right), spelled.extra)
    assert not agree(extra_by_latex(wrong), spelled.extra, 0.1)


def test_values_of_an_inner_parameter_are_kept_and_read_back_also_where_nobody_gave_one():
    name = "(exp(epsilon*tr(sigma))-1)*sigma"
    for values in ((0.3, -0.2), (-0.2, 0.3), (2e-5, -3e-5), (None,)):
        terms = tuple(LawTerm(name, 1.0, {"epsilon": e} if e else {}) for e in values)
        wanted = [sum(np.expm1((e or 0.25) * np.trace(s)) for e in values) * s for s, _ in STATES]
        assert agree(extra_by_latex(law_line(Equation(terms))), np.array(wanted))
        law = Equation(terms).law()
        found = [law.extra_term(*map(jnp.asarray, state)) for state in STATES]
        assert None in values or agree(found, np.array(wanted))


def test_equations_tex_writes_what_latex_writes():
    spelled = sum_of([5, 6], [0.2, -0.3])
    outcome = SimpleNamespace(terms=spelled.equation.terms)
    comparison = object.__new__(Comparison)  # of a comparison only this is written
    object.__setattr__(comparison, "outcomes", {"tensor_sindy": outcome})
    object.__setattr__(comparison, "known_of", {})
    text = equations_tex(comparison, True)
    assert spelled.equation.latex() in text
    # the known part is part of the law
    named = NamedPart("rolie_poly", ({"stretch_time_ratio": 0.2, "beta": 1.0},))
    below = (LawTerm("sigma.sigma", 0.3),)
    object.__setattr__(comparison, "known", Equation(below, named=named))
    whole = Equation(below + spelled.equation.terms, named=named)
    assert whole.latex() in equations_tex(comparison, True)


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda effect: effect.name)
def test_the_equation_of_an_effect_in_the_reference_says_what_it_adds(effect):
    values = [0.17, 0.4][: len(effect.parameters)]
    if effect.as_terms(values) is None:
        pytest.skip("no sum of library terms")
    right = effect.equation.partition(r"\mathrel{+}=")[2].partition(r",\quad")[0]
    letters = {p.symbol.lstrip("\\"): v for p, v in zip(effect.parameters, values, strict=True)}
    for old, new in (
        (r"\mathrm{tr}\,\sigma", r"\operatorname{tr}(\sigma)"),
        (r"\mathrm{tr}", r"\operatorname{tr}"),
        (r"\dot\gamma", r"\gamma"),
    ):
        right = right.replace(old, new)
    for stress, rate in STATES:
        known = {"sigma": stress, "gamma": rate, "I": np.eye(3), "e": np.e, **letters}
        wanted = effect.extra_term(jnp.array(values), jnp.asarray(stress), jnp.asarray(rate))
        assert agree(value(read_latex(right), known), np.asarray(wanted))


def elements(markup, tag="math"):
    return list(ElementTree.fromstring(f"<div>{markup}</div>").iter(tag))


def drawn(markup):
    return "".join(text for one in elements(markup) for text in one.itertext())


@pytest.mark.parametrize("name", BOTH_SIGNS)
def test_what_a_page_shows_is_the_latex_of_the_law(name):
    equation = BOTH_SIGNS[name].equation
    law = law_element(equation.terms, True, equation.named)
    text = " ".join(one.get("alttext") for one in elements(law)).replace(r", \quad ", SEPARATOR)
    shown = {r"\textbf{γ̇}": r"\dot{\boldsymbol{\gamma}}", "α": r"\alpha", "ε": r"\epsilon"}
    for letter, written in (shown | {"κ": r"\kappa", "ξ": r"\xi"}).items():
        text = text.replace(letter, written)
    assert text == law_latex(equation.terms, True, 4, equation.named)


@pytest.mark.parametrize("name", [name for name, law in LAWS.items() if law.written])
def test_every_named_law_is_drawn_without_a_command_of_latex(name):
    constants = {key: low + 0.3 * (min(high, 10.0) - low)
                 for key, (low, high) in LAWS[name].parameters.items()}  # fmt: skip
    law = law_element((), True, NamedPart(name, (constants,)), modes=2, solvent=True)
    assert "\\" not in drawn(law)
    assert "xmlns" not in law  # an address, in a page that asks for none
    # a text of several letters is a function's: a name would be as long as the others are short
    assert {one.text for one in elements(law, "mi") if len(one.text) > 1} <= {"tr", "max"}


def test_every_tensor_is_bold_and_upright():
    for term in LIBRARY.terms:
        parts = [one for tag in ("mi", "mtext") for one in elements(term_element(term.name), tag)]
        tensors = [one for one in parts if one.text in ("σ", "γ̇", "I")]
        assert tensors
        # browsers take no other variant, and draw what they do not take as if it were not there
        assert {one.get("mathvariant") for one in tensors} == {"normal"}
        assert {one.get("style") for one in tensors} == {"font-weight:bold"}


def test_a_long_law_breaks_between_summands_spaced_by_signs_with_letters_for_missing_values():
    terms = sum_of([5, 6], [0.2, 0.1]).equation.terms
    # browsers break a line between elements, never within one
    assert law_element(terms, True).count("</math><wbr/><math") == len(terms)
    terms = [LawTerm("sigma", -1.0), LawTerm("sigma.sigma", -1.5e-5)]
    first, second = elements(sum_elements(terms))
    # a sign is a prefix where it is the first of several in its row
    assert first[0][0].text == "−"
    assert [one.tag for one in second[0]][:2] == ["mrow", "mo"]
    assert drawn(sum_elements(terms)) == "−σ−1.5×10−5σ·σ"
    name = "(tr(sigma)/(1+kappa*abs(tr(sigma))))*sigma"
    assert "κ" in drawn(term_element(name))
    assert "(−0.1)" in drawn(term_element(name, {"kappa": -0.1}))
