"""What is in no dictionary, found as a curve: on records by scipy with a flaw put in by hand."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from independent.curve_records import JUDGE, NOISE, curve_records
from independent.flow import start_up
from independent.folders import write_folder
from independent.giesekus import Giesekus
from independent.instruments import Instrument
from scipy.integrate import cumulative_simpson

import discover as dc
from discover.closed_loop.beyond import free_form
from discover.closed_loop.beyond.beyond_the_search import predicts_worse
from discover.closed_loop.beyond.free_variables import Variables
from discover.closed_loop.results.error_pair import ErrorPair
from discover.closed_loop.results.free_curve import nearest_form
from discover.forward import Linearised
from discover.report.loop.verdict import loop_verdict

MODULUS, TIME, LIMIT = 100.0, 1.0, 60.0
EFFECTS = ["giesekus_mobility", "ptt_linear", "stress_gain", "stress_drift", "transducer_lag"]


FEW = ["giesekus_mobility", "stress_drift"]


def loop_with(folder, flaw, effects: Any = EFFECTS, max_effects=1):
    """Return the loop on Giesekus records to which a flaw of the instrument was done."""
    runs = curve_records(Giesekus(0.3, MODULUS, TIME), read=lambda run, _: flaw(run))
    data = dc.load_dataset(write_folder(folder, runs))
    base = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME)
    named = {} if effects is None else {"effects": effects}
    return dc.close_loop(
        data, base, held_out=[JUDGE], max_effects=max_effects, explanations=1, **named
    )


@pytest.fixture(scope="module")
def saturated(tmp_path_factory):
    folder = tmp_path_factory.mktemp("saturated")
    return loop_with(folder, lambda run: LIMIT * np.tanh(run.stress / LIMIT))


@pytest.mark.slow
def test_a_saturated_transducer_is_found_as_a_function_of_the_stress(saturated):
    assert saturated.verdict == "unexplained"
    found = saturated.free_form[0]
    # the law beside it is the right one, which the search alone had not found
    assert (found.slot, found.beside) == ("recorded_stress", ("giesekus_mobility",))
    assert found.nearest == "tanh"
    true = LIMIT * np.tanh(found.grid / LIMIT) - found.grid
    # within 2 % of the limit where most samples are; the ends hang on few
    assert np.mean((found.low95 <= true) & (true <= found.high95)) > 0.85
    middle = np.abs(found.grid) < 0.8 * np.max(np.abs(found.grid))
    assert np.max(np.abs(found.value - true)[middle]) < 0.02 * LIMIT
    assert found.error.fit < 1.2 * NOISE
    assert found.error.held_out < 1.5 * NOISE < saturated.error_after.held_out


@pytest.mark.slow
def test_the_verdict_says_of_what_it_is_a_function(saturated):
    said = loop_verdict(saturated)[0]
    assert "a function of the recorded stress alone" in said
    assert "tanh" in said
    assert saturated.to_json()["free_form"][0]["nearest"] == "tanh"


def test_a_hum_is_found_as_a_function_of_time(tmp_path):
    loop = loop_with(tmp_path, lambda run: run.stress + 3.0 * np.sin(0.9 * run.time), FEW)
    found = loop.free_form[0]
    assert (found.slot, found.nearest) == ("drift", "periodic")
    assert found.explains
    # six draws: the band holds 92 to 100 % of the curve, that of the few knots alone 67 to 92 %
    true = 3.0 * np.sin(0.9 * found.grid)
    assert np.mean((found.low95 <= true) & (true <= found.high95)) > 0.9
    assert np.median(found.high95 - found.low95) < 0.9  # of 6 Pa
    said = loop_verdict(loop)[0]
    assert "a function of the time alone" in said
    assert "periodic" in said
    assert loop.to_json()["free_form"][0]["nearest"] == "periodic"


def test_a_torque_that_depends_on_where_the_tool_stands_is_found_as_that_function(tmp_path):
    def of_bearing(strain):
        return 3.0 * np.sin(2.0 * np.pi * strain / 9.0)

    def recorded(run):
        # on these samples Simpson's rule is off by less than 1e-3
        strain = run.rate[0] * run.time[0] + cumulative_simpson(run.rate, x=run.time, initial=0.0)
        return run.stress + of_bearing(strain)

    loop = loop_with(tmp_path, recorded, FEW)
    found = loop.free_form[0]
    assert (found.slot, found.beside, found.nearest) == (
        "position", ("giesekus_mobility",), "periodic",
    )  # fmt: skip
    true = of_bearing(found.grid)
    assert np.mean((found.low95 <= true) & (true <= found.high95)) > 0.85
    assert "a function of the tool's position alone" in loop_verdict(loop)[0]


@pytest.mark.slow
def test_a_torque_that_repeats_with_the_cycle_is_found_as_a_function_of_its_phase(tmp_path):
    def recorded(run):
        if np.ptp(run.rate) == 0.0:
            return run.stress
        # γ̇ = a cos ωt: where it is zero for the first time ωt is a quarter of a turn
        until = np.argmax(run.rate < 0.0) + 1
        turn = np.interp(0.0, -run.rate[:until], run.time[:until])
        return run.stress + 3.0 * np.sin(np.pi * run.time / turn)

    loop = loop_with(tmp_path, recorded, FEW)
    found = loop.free_form[0]
    assert (found.slot, found.beside) == ("phase", ("giesekus_mobility",))
    true = 3.0 * np.sin(2.0 * found.grid)
    assert np.mean((found.low95 <= true) & (true <= found.high95)) > 0.85


def test_no_curve_is_found_in_a_sound_record(tmp_path):
    loop = loop_with(tmp_path, lambda run: run.stress, FEW)
    assert loop.verdict == "effects_added"
    assert loop.free_form == ()


@pytest.mark.slow
def test_the_law_beside_a_curve_is_found_among_all_candidates(tmp_path):
    """Three wrong names come first; beside the right one alone the curve leaves far less."""
    loop = loop_with(
        tmp_path, lambda run: LIMIT * np.tanh(run.stress / LIMIT), max_effects=3, effects=None
    )
    assert len(loop.stages) > 1
    found = loop.free_form[0]
    assert (found.slot, found.beside) == ("recorded_stress", ("giesekus_mobility",))
    assert found.error.held_out < 1.5 * NOISE < loop.error_after.held_out


@pytest.mark.usefixtures("as_users_run_it")  # what stands for a search is none
def test_of_a_few_rates_no_curve_is_drawn_and_of_a_wave_one_is():
    times = np.linspace(0.05, 5.0, 80)
    left = Linearised(np.zeros((3, 80)), np.zeros((0, 3, 80)), ())
    model = SimpleNamespace(linearise=lambda *_: left)
    batch = SimpleNamespace(weight=np.ones((3, 80)), recorded=np.ones((3, 80)))
    search: Any = SimpleNamespace(model=model, batch=batch, positions=lambda effects: [])

    def drawn(slot, course):
        runs = [
            dc.Run(f"{rate}", times, dc.start_up(rate), rate * course, np.ones(80))
            for rate in (0.5, 1.0, 2.0)
        ]
        variables, few = Variables(runs, 80), free_form.KNOTS[0]
        return free_form._fitted(search, variables, slot, (), np.zeros(2), few)

    assert drawn("rate", np.ones(80)) is None
    # controls: of the time there is one in the same runs, and of the rate in a wave
    assert drawn("drift", np.ones(80)) is not None
    assert drawn("rate", np.cos(times)) is not None


@pytest.mark.slow
def test_start_ups_at_a_few_rates_hold_no_function_of_the_rate(tmp_path):
    generator, runs = np.random.default_rng(0), {}
    for rate in (0.5, 1.0, 2.0):
        run = Instrument().record(
            Giesekus(0.4, MODULUS, TIME), start_up(rate), np.linspace(0.02, 5.0, 80)
        )
        noise = NOISE * np.max(run.stress) * generator.standard_normal(80)
        runs[f"up_{rate:g}.csv"] = replace(run, stress=run.stress + noise)
    data = dc.load_dataset(write_folder(tmp_path, runs))
    base = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME)
    loop = dc.close_loop(data, base, effects=["stress_drift"], max_effects=1, explanations=1)
    assert loop.verdict == "unexplained"
    assert "rate" not in {one.slot for one in loop.free_form}


@pytest.mark.parametrize(
    ("curve", "name"),
    [
        (lambda x: 0.2 * x + 1.0, "linear"),
        (lambda x: 0.3 * np.sign(x) * x**2, "power"),
        (lambda x: -0.6 * np.sign(x) * np.maximum(np.abs(x) - 1.0, 0.0), "threshold"),
        (lambda x: np.sin(4.0 * x), "periodic"),
        # a hump and a step are no form of the list
        (lambda x: np.exp(-((x - 1.0) ** 2) / 0.02) + (x > 0.0), None),
    ],
)  # fmt: skip
def test_the_nearest_form_is_the_one_that_drew_the_curve(curve, name):
    grid = np.linspace(-2.0, 2.0, 60)
    value = curve(grid)
    assert nearest_form(grid, value, np.full(60, 0.005), True) == name


@pytest.mark.parametrize(
    ("curve", "found", "worse"),
    [(0.02, 0.01, True), (0.01, 0.02, False), (np.inf, np.inf, True), (None, None, False)],
)
def test_a_curve_beside_which_runs_held_out_are_missed_more_or_not_at_all_met_is_worse(
    curve, found, worse
):
    assert predicts_worse(ErrorPair(0.01, curve), ErrorPair(0.1, found)) == worse
