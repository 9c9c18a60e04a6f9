"""Laws, effects, forms, learners and importers of a program's own are known by their names."""

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp

import discover as dc
import tensor_library as tl
from discover.dataset.importing import IMPORTERS, Block, register_importer
from discover.effects.base import AbstractEffect, EffectParameter, SignalEffect
from discover.effects.registry import EFFECTS, make_effect, named_effects
from discover.equations import Equation, equation_from_json, equation_to_json
from discover.equations.formats.code import numpy_code, sympy_code
from discover.equations.markup import law_element
from discover.errors import InputError
from discover.laws.base import as_parameter
from discover.laws.registry import LAWS, name_of
from discover.learners.registry import LEARNERS, learner_title, register_learner
from discover.loop.task import candidates_of
from discover.programs.store import digest_of
from discover.study.data import load_study_data, parse_study
from discover.study.declared_model import declared_model
from tensor_library import trace


class SteepLaw(dc.AbstractConstitutiveLaw):
    """h = k tr(σ)² σ, which is no law of this package."""

    steepness: jnp.ndarray = eqx.field(converter=as_parameter)
    linear_relaxation: bool = eqx.field(static=True, default=True)

    def extra_term(self, stress, rate):
        del rate
        return self.steepness * trace(stress) ** 2 * stress


class Creak(SignalEffect):
    """The stress recorded is the true one times 1 + c."""

    def recorded_stress(self, values, record):
        return record.stress * (1.0 + values[0])


CREAK = Creak(
    name="creak", equation="c", source="this test", check="Listen.",
    parameters=(EffectParameter("c", "c", range_source="any", first_trial=0.01),),
)  # fmt: skip


@pytest.fixture
def registered():
    dc.register_law("steep", SteepLaw, {"k": (0.0, 5.0)}, title="steep law", source="this test")
    dc.register_effect(CREAK)
    before = set(LAWS.present)
    yield
    for name in ("steep", *set(LAWS.present) - before):
        del LAWS[name]
    del EFFECTS["creak"]


def test_a_study_uses_a_law_and_an_effect_from_outside(registered):
    study = parse_study(
        {
            "data": {"synthetic": {"law": "steep", "parameters": {"k": 0.4}, "samples": 21}},
            "model": {"law": "steep", "parameters": {"k": "fit"}},
            "loop": {"effects": ["creak"]},
        }
    )
    data = load_study_data(study)
    assert declared_model(study, data.dataset).free == ("k",)
    assert candidates_of(study.loop.effects) == [CREAK]
    assert make_effect("creak") is CREAK

    def field(t, s):  # by components, apart from the software
        rate = np.cos(0.5 * t)
        slow = 1.0 + 0.4 * (s[0] + s[1]) ** 2
        return [2 * rate * s[2] - slow * s[0], -slow * s[1], rate + rate * s[1] - slow * s[2]]

    run = data.dataset["laos_1_0.5"]
    found = solve_ivp(field, (0, 20), np.zeros(3), t_eval=run.time, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(run.stress, found.y[2], rtol=1e-6, atol=1e-8)


def test_tables_list_what_is_registered_with_range_unit_and_source(registered):
    steep = dc.laws().loc["steep"]
    assert (steep["parameter"], steep["low"], steep["high"]) == ("k", 0.0, 5.0)
    assert steep["source"] == "this test"
    assert dc.effects().loc["creak"]["kind"] == "signal"
    assert name_of(SteepLaw(0.3)) == ("steep", {"k": 0.3})


def test_tables_list_what_is_built_in():
    laws, effects = dc.laws(), dc.effects()
    assert "steep" not in laws.index
    assert "creak" not in effects.index
    assert set(laws.index) == set(LAWS)
    assert set(effects.index) == set(named_effects())
    assert (laws["source"] != "").all()
    assert (effects["source"] != "").all()
    slip = effects.loc[["wall_slip"]].iloc[0]
    assert slip["unit"] == named_effects()["wall_slip"].parameters[0].unit
    assert laws.loc["giesekus"]["high"] == 1.0


def test_a_name_or_a_suffix_that_is_known_is_not_given_twice(registered):
    def read(path):
        return [Block.of({"time": ("s", [0.0])})]

    def learn(task):
        return None

    register_learner("mine", learn)
    register_importer("mine", read, [".raw"])
    try:
        assert learner_title("mine") == "mine"
        for again in (
            *(lambda n=n: dc.register_law(n, SteepLaw, {"k": (0.0, 5.0)})
              for n in ("steep", "giesekus", "learned")),
            lambda: dc.register_effect(CREAK),
            *(lambda n=n: register_learner(n, learn) for n in ("mine", "tensor_sindy")),
            *(lambda n=n: register_importer(n, read) for n in ("mine", "text")),
        ):  # fmt: skip
            with pytest.raises(InputError, match="known already"):
                again()
        with pytest.raises(InputError, match=r"end in \.raw are read by the importer 'mine'"):
            register_importer("other", read, [".RAW"])
    finally:
        del LEARNERS["mine"]
        del IMPORTERS["mine"]


@pytest.mark.parametrize(
    ("name", "given", "message"),
    [
        ("Steep law", {"build": SteepLaw}, "lower-case"),
        ("steeper", {"build": SteepLaw, "parameters": {"k": (5.0, 0.0)}}, "low < high"),
        ("steeper", {"build": SteepLaw, "parameters": {"k": (0.0, np.nan)}}, "two numbers"),
        ("steeper", {"build": SteepLaw, "parameters": {}}, "cannot be made"),
        ("steeper", {"build": float}, "makes a float"),
        ("mine", {}, "either build"),
        ("mine", {"build": dc.AbstractConstitutiveLaw, "extra_term": trace}, "either build"),
        ("mine", {"extra_term": lambda stress: stress}, r"def mine\(stress, rate, k\)"),
        ("mine", {"extra_term": lambda stress, rate, q: stress}, r"def mine\(stress, rate, k\)"),
        ("mine", {"extra_term": lambda stress, rate, k: k * trace(stress)}, "shape"),
    ],
)
def test_what_is_no_law_is_refused_and_not_kept(name, given, message):
    with pytest.raises(dc.InputError, match=message):
        dc.register_law(name, **{"parameters": {"k": (0.0, 5.0)}, **given})
    assert name not in LAWS


def test_what_is_no_effect_is_refused_and_a_law_knows_its_name_and_parameters():
    with pytest.raises(dc.InputError, match="must be a ConstitutiveEffect"):
        dc.register_effect(AbstractEffect("creak", (), "c", "this test", "Listen."))
    for name, values in (("giesekus", {"alpha": 0.3}), ("fene_p", {"L2": 30.0}), ("ucm", {})):
        assert name_of(dc.make_law(name, values)) == (name, values)
    # the two PTT laws differ in nothing but their class
    assert name_of(dc.make_law("ptt_exponential", {"epsilon": 0.2})) == (
        "ptt_exponential", {"epsilon": 0.2}
    )  # fmt: skip
    assert name_of(SteepLaw(0.3)) is None


def test_a_law_of_a_function_is_the_law_that_is_built_in(registered):
    def mobility(stress, rate, alpha):
        return alpha * tl.square(stress)

    dc.register_law("own_mobility", extra_term=mobility, parameters={"alpha": (0.0, 1.0)})
    own, built_in = (dc.make_law(n, {"alpha": 0.3}) for n in ("own_mobility", "giesekus"))
    for stress in (np.array([0.5, -0.1, 0.0, 0.7]), np.diag([0.4, 0.1, -0.2])):
        rate = jnp.asarray(2.0) if stress.ndim == 1 else jnp.eye(3, k=1)
        ours, theirs = (law.stress_rate(jnp.asarray(stress), rate) for law in (own, built_in))
        np.testing.assert_allclose(ours, theirs, rtol=1e-14)
    assert "own_mobility" in dc.laws().index


def test_constants_of_such_a_law_are_fitted(registered):
    def softening(stress, rate, k):
        return k * trace(stress) ** 2 * stress

    dc.register_law("softening", extra_term=softening, parameters={"k": (0.0, 10.0)})
    data = dc.synthetic_dataset("softening", {"k": 0.3}, noise=0.01, n_samples=41)
    base = dc.Fluid(modulus=1.0, relaxation_time=1.0)
    fitted = dc.fit("softening", data, base=base)
    low, high = fitted.conf_int(0.999).loc["k"]
    assert low < 0.3 < high
    # negative control: the law's function decides what is fitted
    other = dc.fit("ptt_linear", data, base=base)
    assert other.error > 2.0 * fitted.error


def test_columns_of_a_block_have_one_length_and_a_gap_is_an_empty_cell():
    block = Block.of({"time": ("s", [0.0, 1.0]), "stress": ("kPa", [np.nan, 2.5])}, "step 1")
    assert block.cells == (("0.0", ""), ("1.0", "2.5"))
    assert block.columns == (("time", "s"), ("stress", "kPa"))
    for wrong in ({}, {"time": ("s", [0.0, 1.0]), "stress": ("Pa", [1.0])}):
        with pytest.raises(InputError, match="must have one length"):
            Block.of(wrong)


FORM = tl.ClosedForm(
    "levelling", "(tr(sigma)/sqrt(1+(mu*tr(sigma))^2))", "mu", 0.5, (1e-3, 10.0),
    lambda trace, mu: trace / jnp.sqrt(1.0 + (mu * trace) ** 2), 4, "this test",
    lambda trace, mu: trace / sympy.sqrt(1 + (mu * trace) ** 2),
)  # fmt: skip


@pytest.fixture
def form():
    yield tl.register_closed_form(FORM)
    del tl.CLOSED_FORMS[FORM.name]


def test_every_notation_writes_the_same_function(form, tmp_path):
    name = f"{form.spelling}*sigma"
    assert tl.parse_term(name).name == name
    equation = Equation((tl.LawTerm(name, 0.8, {"mu": 0.3}),))
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
    library = tl.build_library(tensors=["sigma"], closed_forms=["levelling"])
    assert digest_of(library) is None
    # negative control: one with a form of this package is
    assert digest_of(tl.build_library(tensors=["sigma"], closed_forms=["exp"])) is not None


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
        tl.register_closed_form(replace(FORM, **change))
    assert "levelling" not in tl.CLOSED_FORMS
