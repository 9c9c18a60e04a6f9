"""A law behind a transducer that has no name: linear PTT by scipy, clipped or not."""

import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

import discover as dc
from discover.effects import EffectParameter, SignalEffect, named_effects
from discover.report.first_screen import answer_screen

MODULUS, TIME, EPSILON = 60.0, 1.3, 0.25
RATES = {"a": 0.7, "b": 1.5, "c": 3.0, "d": 4.5}
CANDIDATES = ["ptt_linear", "giesekus_mobility", "stress_gain", "stress_offset"]


def start_up(rate, times):
    """Return the shear stress of linear PTT   [Phan-Thien & Tanner 1977, JNNFM 2, 353]."""

    def change(_, stress):
        normal, shear = stress
        faster = (1.0 + EPSILON * normal / MODULUS) / TIME
        return [2.0 * rate * shear - faster * normal, MODULUS * rate - faster * shear]

    found = solve_ivp(change, (0.0, times[-1]), [0.0, 0.0], t_eval=times, rtol=1e-9, atol=1e-9)
    return found.y[1]


def runs_of(limit=np.inf):
    """Return runs of a transducer with a limit, over the largest stress fitted."""
    times, lot = np.linspace(0.05, 6.0, 80), np.random.default_rng(7)
    stress = {name: start_up(rate, times) for name, rate in RATES.items()}
    largest = limit * np.max(stress["c"])
    tables = []
    for name, values in stress.items():
        noise = 1.0 + 0.01 * lot.standard_normal(len(times))
        shown = np.clip(values, -largest, largest) * noise
        columns = {"time_s": times, "shear_rate_1_s": RATES[name], "stress_Pa": shown}
        tables.append(pd.DataFrame(columns).assign(run=name))
    return dc.from_dataframe(pd.concat(tables))


def loop_of(limit=np.inf):
    """Return the loop on these runs."""
    base = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME)
    return dc.close_loop(runs_of(limit), base, held_out=["d"], effects=CANDIDATES)


@pytest.fixture(scope="module")
def clipped():
    return loop_of(limit=0.6)


def test_the_law_behind_a_transducer_that_saturates_is_the_answers_law(clipped):
    assert clipped.verdict == "unexplained"  # what bends has no name
    (constant,) = clipped.answer.constants
    low, high = constant.ci95
    assert clipped.answer.law == "ptt_linear"
    # the half of each record that the clip leaves tells it to a sixth
    assert low < EPSILON < high
    assert high - low < EPSILON / 3.0


def test_what_saturates_is_suspected_and_how_to_see_it_comes_next(clipped):
    (function,) = clipped.free_form
    assert (function.slot, function.nearest, function.in_answer) == (
        "recorded_stress",
        "clipped",
        True,
    )
    (suspect,) = clipped.answer.suspects
    assert suspect.text.startswith("nonlinear transducer −")
    # of the fitted runs a, b, c these two reach the limit
    repeated = tuple(f" ({name}) with a smaller plate or cone." for name in "bc")
    assert clipped.answer.next_test.startswith("Repeat the start-up at ")
    assert clipped.answer.next_test.endswith(repeated)
    assert answer_screen(clipped.answer)["open"]
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


def giesekus(rate, times, modulus, time, mobility):
    """Return the shear stress of a mode   [Giesekus 1982, JNNFM 11, 69]."""

    def change(_, stress):
        s11, s12, s22 = stress
        strain = mobility / (modulus * time)
        return [
            2.0 * rate * s12 - s11 / time - strain * (s11**2 + s12**2),
            rate * (modulus + s22) - s12 / time - strain * s12 * (s11 + s22),
            -s22 / time - strain * (s12**2 + s22**2),
        ]

    found = solve_ivp(change, (0.0, times[-1]), np.zeros(3), "LSODA", times, rtol=1e-9, atol=1e-7)
    return found.y[1]


@pytest.mark.slow
def test_a_saturation_that_a_user_names_is_found_where_other_effects_seem_nearer_at_first():
    moduli, times = np.array([1000.0, 300.0]), np.array([1.0, 0.1])
    sampled, lot, tables = np.linspace(0.1, 6.0, 60), np.random.default_rng(0), []
    for rate in (0.5, 1.0, 2.0, 4.0, 8.0):
        true = sum(giesekus(rate, sampled, *mode, 0.25) for mode in zip(moduli, times, strict=True))
        read = true / (1.0 + 3e-4 * true)
        read += 0.01 * np.sqrt(np.mean(read**2)) * lot.standard_normal(len(read))
        columns = {"time_s": sampled, "shear_rate_1_s": rate, "stress_Pa": read}
        tables.append(pd.DataFrame(columns).assign(run=f"r{rate:g}"))
    named = [name for name, effect in named_effects().items() if not effect.on_request]
    base = dc.Fluid(dc.make_law("ucm"), moduli, times)
    found = dc.close_loop(
        dc.from_dataframe(pd.concat(tables)), base, held_out=["r4"], effects=[*named, SATURATION]
    )
    assert found.explanations.likeliest_first[0].members[0] == ("giesekus_mobility", "saturation")
