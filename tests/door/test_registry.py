"""Laws and effects of a program's own are known by name to studies and loops."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import discover as dc
from discover.effects.base import AbstractEffect, EffectParameter, SignalEffect
from discover.effects.registry import EFFECTS, make_effect, named_effects
from discover.laws.base import as_parameter
from discover.laws.registry import LAWS, name_of
from discover.loop.task import candidates_of
from discover.study.data import load_study_data, parse_study
from discover.study.declared_model import declared_model
from tensor_library.algebra import trace


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
    name="creak",
    parameters=(EffectParameter("c", "c", range_source="any", first_trial=0.01),),
    equation="c",
    source="this test",
    check="Listen.",
)


@pytest.fixture
def registered():
    dc.register_law("steep", SteepLaw, {"k": (0.0, 5.0)}, title="steep law", source="this test")
    dc.register_effect(CREAK)
    yield
    del LAWS["steep"]
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


def test_a_name_that_is_known_is_not_given_twice(registered):
    for name in ("steep", "giesekus", "learned"):
        with pytest.raises(dc.InputError, match="known already"):
            dc.register_law(name, SteepLaw, {"k": (0.0, 5.0)})
    with pytest.raises(dc.InputError, match="known already"):
        dc.register_effect(CREAK)


@pytest.mark.parametrize(
    ("name", "build", "parameters", "message"),
    [
        ("Steep law", SteepLaw, {"k": (0.0, 5.0)}, "lower-case"),
        ("steeper", SteepLaw, {"k": (5.0, 0.0)}, "low < high"),
        ("steeper", SteepLaw, {"k": (0.0, float("nan"))}, "two numbers"),
        ("steeper", SteepLaw, {}, "cannot be made"),
        ("steeper", float, {"k": (0.0, 5.0)}, "makes a float"),
    ],
)
def test_what_is_no_law_is_refused_and_not_kept(name, build, parameters, message):
    with pytest.raises(dc.InputError, match=message):
        dc.register_law(name, build, parameters)
    assert name not in LAWS


def test_what_is_no_effect_is_refused():
    with pytest.raises(dc.InputError, match="must be a ConstitutiveEffect"):
        dc.register_effect(AbstractEffect("creak", (), "c", "this test", "Listen."))


def test_a_law_knows_its_name_and_parameters():
    for name, values in (("giesekus", {"alpha": 0.3}), ("fene_p", {"L2": 30.0}), ("ucm", {})):
        assert name_of(dc.make_law(name, values)) == (name, values)
    # the two PTT laws differ in nothing but their class
    assert name_of(dc.make_law("ptt_exponential", {"epsilon": 0.2})) == (
        "ptt_exponential", {"epsilon": 0.2}
    )  # fmt: skip
    assert name_of(SteepLaw(0.3)) is None
