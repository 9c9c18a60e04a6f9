"""A closed form, one file outside the package, as its page describes it."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
import sympy

from discover.equations import Equation, equation_from_json, equation_to_json
from discover.equations.formats.code import numpy_code, sympy_code
from discover.equations.spelling.markup import law_element
from discover.errors import InputError
from discover.programs.store import digest_of
from discover.study import read_study
from tensor_library import (
    CLOSED_FORMS,
    ClosedForm,
    LawTerm,
    build_library,
    parse_term,
    register_closed_form,
)

PAGE = "adding-a-term.md"
FORM = ClosedForm(
    "levelling", "(tr(sigma)/sqrt(1+(mu*tr(sigma))^2))", "mu", 0.5, (1e-3, 10.0),
    lambda trace, mu: trace / jnp.sqrt(1.0 + (mu * trace) ** 2), 4, "this test",
    lambda trace, mu: trace / sympy.sqrt(1 + (mu * trace) ** 2),
)  # fmt: skip
SAMPLES = """
import jax.numpy as jnp, numpy as np, pathlib, discover as dc
from discover.equations import Equation
from discover.simulate import simulate
from tensor_library import LawTerm
fluid = Equation((LawTerm("(tanh(mu*tr(sigma)))*sigma", 0.8, {"mu": 0.7}),)).fluid()
folder = pathlib.Path("data"); folder.mkdir()
names, noise = [], np.random.default_rng(3)
for number, run in enumerate(list(dc.synthetic_dataset("ucm", {}, n_samples=51))[::4]):
    table = run.to_dataframe()[["time_s", "shear_rate_1_s", "stress_Pa"]]
    stress = simulate(fluid, run.protocol, run.time).shear_stress
    size = np.sqrt(np.mean(stress**2))
    table["stress_Pa"] = stress + 0.002 * size * noise.standard_normal(stress.size)
    table.to_csv(folder / f"run{number}.csv", index=False)
    names.append(f"run{number}.csv")
(folder / "runs.csv").write_text("\\n".join(["file", *names]) + "\\n")
"""


@pytest.fixture
def form():
    yield register_closed_form(FORM)
    del CLOSED_FORMS[FORM.name]


@pytest.mark.slow
def test_the_form_of_the_page_is_found_in_data_reported_and_exported(workplace):
    workplace.follow(PAGE)
    workplace.run(script=SAMPLES)
    study = workplace.study(PAGE, more="max_terms = 1\n")
    text = (workplace.folder / study).read_text("utf-8")
    start, end = text.index("synthetic"), text.index("[compare]")
    text = text[:start] + 'folder = "data"\n' + text[end:].replace('"exp", "tanh"', '"tanh"')
    (workplace.folder / study).write_text(text)
    workplace.run("compare", study, "--out", "out", "--quiet")
    (term,) = workplace.json("out/comparison.json")["learners"]["tensor_sindy"]["terms"]
    assert term["term"] == "(tanh(mu*tr(sigma)))*sigma"
    np.testing.assert_allclose(term["coefficient"], 0.8, rtol=0.2)
    np.testing.assert_allclose(term["inner"]["mu"], 0.7, rtol=0.3)
    report = (workplace.folder / "out" / "report.html").read_text("utf-8")
    assert "tanh" in report
    assert "<mi>traceofstress</mi>" not in report
    assert r"\tanh" in (workplace.folder / "out" / "equations.tex").read_text("utf-8")
    code = workplace.run("export", "out", "--format", "python").stdout
    assert "np.tanh(" in code
    done = workplace.run("export", "out", "--format", "rheotool", code=2)
    assert "rheoTool cannot take this law" in done.stderr


def test_without_the_package_the_study_of_the_page_is_refused(workplace):
    # negative control of the test above, in this process, where nothing is installed
    said = "unknown closed form 'tanh'. Write one of: exp, saturating"
    with pytest.raises(InputError, match=said):
        read_study(workplace.folder / workplace.study(PAGE))


def test_every_notation_writes_the_same_function(form, tmp_path):
    name = f"{form.spelling}*sigma"
    assert parse_term(name).name == name
    equation = Equation((LawTerm(name, 0.8, {"mu": 0.3}),))
    stress, rate = jnp.diag(jnp.array([2.0, -0.5, 0.25])), jnp.zeros((3, 3))
    wanted = np.asarray(equation.law().extra_term(stress, rate))
    np.testing.assert_allclose(wanted[0, 0], 0.8 * 1.75 / np.sqrt(1 + (0.3 * 1.75) ** 2) * 2.0)

    (tmp_path / "as_numpy.py").write_text(numpy_code(equation))
    (tmp_path / "as_sympy.py").write_text(sympy_code(equation))
    found = {}
    for file in ("as_numpy", "as_sympy"):
        exec(compile((tmp_path / f"{file}.py").read_text(), file, "exec"), found)
        if file == "as_numpy":
            np.testing.assert_allclose(found["extra_term"](np.asarray(stress), 0.0), wanted)
    values = dict(zip(found["stress_symbols"], (2.0, 0, 0, -0.5, 0, 0.25), strict=True))
    evaluated = np.array(found["extra_term"].subs(values), dtype=float)
    np.testing.assert_allclose(evaluated, wanted, atol=1e-12)

    assert r"\sqrt{" in equation.latex()
    assert r"\mu = 0.3" in equation.latex()
    assert "<msqrt>" in law_element(equation.terms, True)
    assert "innerparameter" not in law_element(equation.terms, True) + equation.latex()
    assert equation.sympy().has(sympy.sqrt(1 + sympy.Symbol("q") ** 2).func)
    again = equation_from_json(equation_to_json(equation), "here")
    assert again.terms == equation.terms


def test_a_program_with_the_form_is_not_kept_for_another_process(form):
    library = build_library(tensors=["sigma"], closed_forms=["levelling"])
    assert digest_of(library) is None
    # negative control: one with a form of this package is
    assert digest_of(build_library(tensors=["sigma"], closed_forms=["exp"])) is not None


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"name": "exp"}, "is taken"),
        ({"inner_name": "epsilon"}, "is taken"),
        ({"name": "Levelling"}, "lower-case"),
        ({"spelling": "tanh(mu*tr(sigma))"}, "in brackets"),
        ({"spelling": "(tanh( mu*tr(sigma)))"}, "in brackets"),
        ({"spelling": "(exp(epsilon*tr(sigma))-1)"}, "must be new"),
        ({"inner_default": 20.0}, "must be from 0.001 to 10"),
        ({"expression": None}, "needs its expression"),
        ({"function": lambda trace, mu: 1.0 + mu * trace}, "must vanish at zero stress"),
        ({"expression": lambda trace, mu: mu * trace}, "must agree"),
    ],
)
def test_a_form_that_cannot_be_used_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        register_closed_form(replace(FORM, **change))
    assert "levelling" not in CLOSED_FORMS
