"""What is planted is what was asked for, and the loop, told the base law alone, names it."""

import numpy as np
import pytest
from planting import OUTSIDE, Noise, Planter

from discover.effects import named_effects
from discover.errors import InputError
from discover.loop import run_loop


@pytest.fixture(scope="module")
def planter():
    return Planter("ucm")


def relative_change(case, reference):
    fitted = [run for run in case.dataset if run.name not in case.held_out]
    changes = []
    for run in fitted:
        other = reference.dataset[run.name].stress
        difference = run.stress - other
        changes.append(np.sqrt(np.mean(difference**2) / np.mean(other**2)))
    return np.mean(changes)


@pytest.fixture(scope="module")
def clean(planter):
    return planter.plant(noise=Noise(0.0))


@pytest.mark.slow
@pytest.mark.parametrize(
    "effect", ["giesekus_mobility", "stress_drift", "thixotropy", "wall_slip", "time_delay"]
)
def test_a_planted_effect_changes_the_stress_as_much_as_asked(planter, clean, effect):
    case = planter.plant([effect], size=0.12, noise=Noise(0.0), seed=3)
    assert set(case.effects) == {effect}
    assert relative_change(case, clean) == pytest.approx(0.12, rel=5e-3)


@pytest.mark.slow
@pytest.mark.parametrize("mechanism", sorted(OUTSIDE))
def test_a_mechanism_from_outside_changes_it_as_asked_and_is_in_no_dictionary(
    planter, clean, mechanism
):
    assert mechanism not in named_effects()
    case = planter.plant(outside=mechanism, size=0.12, noise=Noise(0.0))
    # clipping and rounding are stepwise functions of their size
    assert relative_change(case, clean) == pytest.approx(0.12, rel=0.1)


@pytest.mark.slow
def test_the_same_seed_plants_the_same(planter):
    first, second = (planter.plant(["thixotropy"], seed=5) for _ in range(2))
    other = planter.plant(["thixotropy"], seed=6)
    assert first.effects == second.effects != other.effects
    for run in first.dataset:
        np.testing.assert_array_equal(run.stress, second.dataset[run.name].stress)


def test_noise_has_the_size_and_the_correlation_asked_for():
    drawn = Noise(0.02, 0.6).draw((2000, 50), np.random.default_rng(0))
    assert np.std(drawn) == pytest.approx(0.02, rel=0.02)
    neighbours = np.mean(drawn[:, 1:] * drawn[:, :-1]) / np.mean(drawn**2)
    assert neighbours == pytest.approx(0.6, abs=0.02)


def test_a_base_that_is_no_law_is_refused():
    with pytest.raises(InputError, match="base law"):
        Planter("water")


@pytest.mark.slow
def test_what_cannot_be_planted_is_refused(planter):
    with pytest.raises(InputError, match="gremlins"):
        planter.plant(["gremlins"])
    with pytest.raises(InputError, match="gremlins"):
        planter.plant(outside="gremlins")
    with pytest.raises(InputError, match="No admissible amplitude"):
        planter.plant(["finite_extensibility"], size=50.0)


def loop(case):
    # the named effects alone, which share their program with the planter; no other explanations,
    # which change neither verdict nor stages (test_loop)
    return run_loop(
        case.dataset,
        case.declared,
        held_out=case.held_out,
        effects=list(named_effects()),
        max_effects=3,
        explanations=1,
    )


def names(result):
    return [{stage.effect, *stage.aliases} for stage in result.stages]


@pytest.mark.slow
@pytest.mark.parametrize("correlation", [0.0, 0.6])
def test_nothing_is_named_in_data_without_a_flaw(planter, correlation):
    for seed in (1, 2):
        result = loop(planter.plant(noise=Noise(0.01, correlation), seed=seed))
        assert result.verdict == "no_effect_needed"
        assert result.stages == ()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "seed"), [("wall_slip", 1), ("thixotropy", 2), ("stress_drift", 3)]
)
def test_a_flaw_of_eight_times_the_noise_is_named_and_held_out_runs_are_predicted(
    planter, effect, seed
):
    case = planter.plant([effect], size=0.08, seed=seed)
    result = loop(case)
    assert len(result.stages) == 1
    assert effect in names(result)[0]
    assert result.verdict == "effects_added"
    # the noise alone is 0.01
    assert result.error_after.held_out < 0.015 < 0.03 < result.error_before.held_out


@pytest.mark.slow
def test_two_flaws_that_only_together_explain_the_data_are_both_named(planter):
    effects = ("yield_stress", "tool_compliance")
    case = planter.plant(effects, size=0.1, noise=Noise(0.01, 0.6), seed=4)
    result = loop(case)
    assert result.verdict == "effects_added"
    for effect in effects:
        assert any(effect in stage for stage in names(result))


@pytest.mark.slow
@pytest.mark.parametrize("mechanism", ["clipped_transducer", "hum"])
def test_a_mechanism_that_is_in_no_dictionary_is_unexplained(planter, mechanism):
    result = loop(planter.plant(outside=mechanism, size=0.1, seed=1))
    assert result.verdict == "unexplained"
    assert result.remaining["structured"]


@pytest.mark.slow
def test_an_effect_that_stood_in_for_another_gives_way_to_it(planter):
    # on runs of one sign alone an offset and a friction of the bearing are alike
    case = planter.plant(["stress_offset"], size=0.12, noise=Noise(0.01), seed=1)
    assert [stage.effect for stage in loop(case).stages] == ["stress_offset"]
