"""Answers behind what has no name: a transducer that bends, and a kernel with another N2."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from independent import KBKZ, PhanThienTanner, multimode_giesekus
from independent.noise import proportional, white
from noisy_runs import start_ups

import discover as dc
from discover.effects import EffectParameter, SignalEffect, named_effects
from discover.inference.bands import SIMPLE_FLUIDS

MODULUS, TIME, EPSILON = 60.0, 1.3, 0.25
RATES = {"a": 0.7, "b": 1.5, "c": 3.0, "d": 4.5}
FLUID = PhanThienTanner(EPSILON, modulus=MODULUS, relaxation_time=TIME)
CANDIDATES = ["ptt_linear", "giesekus_mobility", "stress_gain", "stress_offset"]


def runs_of(limit=np.inf):
    """Return runs of a transducer with a limit, over the largest stress fitted."""
    times, lot = np.linspace(0.05, 6.0, 80), np.random.default_rng(7)
    exact = start_ups(FLUID, RATES.values(), times, 0.0, names=[*RATES])
    largest = limit * np.max(exact["c"].stress)
    return dc.Dataset("clipped", tuple(
        replace(run, stress=proportional(np.clip(run.stress, -largest, largest), 0.01, lot))
        for run in exact
    ))  # fmt: skip


def loop_of(limit=np.inf):
    base = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME)
    return dc.close_loop(runs_of(limit), base, held_out=["d"], effects=CANDIDATES)


@pytest.fixture(scope="module")
def clipped():
    return loop_of(limit=0.6)


def test_behind_a_transducer_that_saturates_the_law_is_found_and_the_bend_suspected(clipped):
    assert clipped.verdict == "unexplained"  # what bends has no name
    (constant,) = clipped.answer.constants
    low, high = constant.ci95
    assert clipped.answer.law == "ptt_linear"
    # the half of each record that the clip leaves tells it to a sixth
    assert low < EPSILON < high
    assert high - low < EPSILON / 3.0
    (function,) = clipped.free_form
    told = function.slot, function.nearest, function.in_answer
    assert told == ("recorded_stress", "clipped", True)
    (suspect,) = clipped.answer.suspects
    assert suspect.text.startswith("nonlinear transducer −")
    # of the fitted runs a, b, c these two reach the limit
    repeated = tuple(f" ({name}) with a smaller plate or cone." for name in "bc")
    assert clipped.answer.next_test.startswith("Repeat the start-up at ")
    assert clipped.answer.next_test.endswith(repeated)
    assert "Not part of this law: nonlinear transducer (inst" in clipped.answer.headline
    # six tenths of the largest stress are shown; a straight line bends between two knots
    assert suspect.constants[0].value == pytest.approx(-0.4, abs=0.05)
    assert clipped.to_json()["free_form"][0]["constants"]["ptt_linear"]["epsilon"]


def test_a_run_that_no_fit_saw_is_predicted_as_the_transducer_shows_it(clipped):
    (record,) = (one for one in clipped.records if one.held_out)
    low, high = record.band
    # 95 % of 80 samples, three standard errors below
    assert np.mean((low <= record.measured) & (record.measured <= high)) > 0.87
    assert clipped.error_after.held_out < 0.02  # twice its noise


@pytest.mark.slow
def test_a_comparison_says_of_no_law_that_stood_first_before_that_it_is_the_best_classical_one():
    base = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME)
    found = dc.compare(runs_of(limit=0.6), base, held_out=["d"], learners=["tensor_sindy"])
    assert found.answer.law == "ptt_linear"
    assert not found.answer.best_classical


def test_a_transducer_that_saturates_nowhere_is_not_suspected():
    sound = loop_of()
    assert sound.verdict == "effects_added"
    assert not sound.free_form
    assert not sound.answer.suspects


class Saturation(SignalEffect):
    """The stress that is recorded is the true one over 1 + s |σ|."""

    def recorded_stress(self, values, record):
        return record.stress / (1.0 + values[0] * jnp.abs(record.stress))


SATURATION = Saturation(
    name="saturation",
    parameters=(
        EffectParameter(
            "s", "s", "1/Pa", low=0.0, high=1.0, scale="inverse_stress", first_trial=0.01,
            range_source="a reading of less than half of the stress is seen at once",
            range_scale="inverse_stress",
        ),
    ),
    equation=r"\sigma_\mathrm{rec} = \sigma / (1 + s\,|\sigma|)",
    source="Macosko 1994, Rheology, ch. 8: torque transducers", check="Hang known weights.",
    visible="s times the root-mean-square stress of about 0.05.",
)  # fmt: skip


@pytest.mark.slow
def test_a_saturation_that_a_user_names_is_found_where_other_effects_seem_nearer_at_first():
    moduli, times, lot = (1000.0, 300.0), (1.0, 0.1), np.random.default_rng(0)
    rates = (0.5, 1.0, 2.0, 4.0, 8.0)
    exact = start_ups(
        multimode_giesekus([0.25] * 2, moduli, times), rates, np.linspace(0.1, 6.0, 60), 0.0
    )
    read = [white(run.stress / (1.0 + 3e-4 * run.stress), 0.01, lot) for run in exact]
    runs = [replace(run, stress=stress) for run, stress in zip(exact, read, strict=True)]
    named = [name for name, effect in named_effects().items() if not effect.on_request]
    base = dc.Fluid(dc.make_law("ucm"), moduli, times)
    data = dc.Dataset("saturated", tuple(runs))
    found = dc.close_loop(data, base, held_out=["4"], effects=[*named, SATURATION])
    assert found.explanations.likeliest_first[0].members[0] == ("giesekus_mobility", "saturation")


def test_n2_of_damping_by_strain_is_anything_that_a_simple_fluid_may_have():
    # K-BKZ by quadrature, N2 = −0.15 N1: one of the kernels that differ in N2 alone
    fluid, times = KBKZ(0.2, modulus=MODULUS, relaxation_time=TIME), np.linspace(0.05, 6.0, 60)
    data = start_ups(fluid, RATES.values(), times, seed=3, names=[*RATES])
    base = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME)
    effects = ["strain_damping", "giesekus_mobility", "stress_gain"]
    loop = dc.close_loop(data, base, held_out=["d"], effects=effects)
    assert loop.explanations.likeliest_first[0].members[0] == ("strain_damping",)
    assert loop.answer.expected("N2").missing == "not determined"
    # as likely zero, as the law says, as anywhere between the least ratio and that: of the second
    # the mean is half of it and the deviation its root of a twelfth
    apart = -SIMPLE_FLUIDS * np.sqrt(0.5 * (0.25 + 1.0 / 12.0))
    assert loop.spread_of_laws["N2"].inside == pytest.approx(apart, rel=1e-3)  # and N1 itself
    assert loop.spread_of_laws["N1"].inside < 0.05  # control: σ12 tells N1
