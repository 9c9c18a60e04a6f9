"""The worlds by which the software is judged, and the counts of what it said of them."""

import numpy as np
import pytest
from calibration_tables import calibration_error, comparison_table, is_right, loop_table, share
from independent import SoftGlass, UpperConvectedMaxwell, start_up
from independent.instruments import Instrument
from independent.worlds import FLOWS, NOISES, draw_world, known_flaws, known_laws, unknown_laws
from run import ask

SCALE = {"modulus": 100.0, "relaxation_time": 2.0}


def test_a_soft_glass_ages_at_rest():
    law, times = SoftGlass(0.3, 0.2, **SCALE), np.linspace(0.0, 5.0, 6)
    state = law.rest()
    for _ in times:
        # dD/dt = −r D² has D = 1/(λ + r t)
        assert law.change(state, 0.0)[0] == pytest.approx(-0.3 * state[0] ** 2)
        state = state * 0.9


@pytest.mark.parametrize("rate", [0.5, 5.0])
def test_a_soft_glass_flows_at_its_yield_stress_at_any_rate(rate):
    law = SoftGlass(0.3, 0.2, **SCALE)
    steady = law.respond(start_up(rate), np.array([0.0, 200.0 / rate])).sigma12[-1]
    assert steady == pytest.approx(100.0 * np.sqrt(0.3 / 0.2), rel=1e-5)


def test_a_ringing_transducer_overshoots_as_a_damped_oscillator():
    # a Maxwell fluid of very short memory has the stress G λ γ̇ at once: a step of 1 Pa
    fluid = UpperConvectedMaxwell(1e4, 1e-4)
    times = np.linspace(0.01, 2.0, 60)
    ringing = Instrument(resonance=8.0, damping=0.2).record(fluid, start_up(1.0), times)
    own = 8.0 * np.sqrt(1.0 - 0.2**2)
    decay = np.exp(-0.2 * 8.0 * times)
    step = 1.0 - decay * (np.cos(own * times) + 0.2 * 8.0 / own * np.sin(own * times))
    # the stress takes some 1e-3 s to rise, of a period of 0.8 s
    np.testing.assert_allclose(ringing.stress, step, atol=1e-2)
    assert np.max(ringing.stress) > 1.4


def test_slip_of_a_power_of_the_stress_balances_the_rate_of_the_tool():
    fluid = UpperConvectedMaxwell(100.0, 0.01)
    record = Instrument(slip=0.3, slip_power=3.0).record(fluid, start_up(1.3), np.array([0.0, 2.0]))
    stress = record.stress[-1]  # η = 1 Pa s, so that γ̇_felt = σ
    assert stress + 0.3 * stress**3 == pytest.approx(1.3, rel=1e-6)


def test_a_drift_that_settles_ends_at_its_time_by_its_slope():
    fluid, times = UpperConvectedMaxwell(1.0, 1.0), np.array([0.0, 0.01, 50.0])
    sound = Instrument().record(fluid, start_up(1.0), times).stress
    drifted = Instrument(drift=3.0, settling_time=2.0).record(fluid, start_up(1.0), times).stress
    np.testing.assert_allclose(drifted - sound, [0.0, 0.03, 6.0], rtol=3e-3)


def test_worlds_hold_every_law_flaw_protocol_and_noise():
    worlds = [draw_world(1, index) for index in range(500)]

    def draw(low, high):
        return 0.5 * (low + high)

    assert {w.law for w in worlds} == {*known_laws(draw), *unknown_laws(draw)}
    assert len({w.law for w in worlds}) >= 12
    assert {w.flaw for w in worlds} >= {"sound", *known_flaws(draw), "saturated", "ringing"}
    assert {w.protocol for w in worlds} == {*FLOWS}
    assert {w.noise for w in worlds} == {*NOISES}
    # K-BKZ is damping by strain exactly where no flow turns
    named = [w for w in worlds[1::2] if w.inside]
    assert {(w.law, w.protocol) for w in named} == {("K-BKZ", "start-ups")}
    assert len(named) < 20
    assert sum(w.inside for w in worlds[::2]) > 150


def test_a_world_is_the_same_again_and_another_by_another_seed():
    def stress(seed):
        runs = draw_world(seed, 2).make(np.random.default_rng(0))
        return np.concatenate([run.stress for run in runs.values()])

    np.testing.assert_array_equal(stress(1), stress(1))
    assert not np.array_equal(stress(1), stress(2))


def test_an_answer_is_right_if_one_of_its_twins_names_all_that_is_there_and_no_more():
    effects = [["ptt_linear", "tr(sigma)*sigma"], ["stress_gain"]]
    assert is_right([["wall_slip"], ["stress_gain", "tr(sigma)*sigma"]], effects)
    assert not is_right([["ptt_linear"]], effects)
    assert not is_right([["ptt_linear", "stress_gain", "wall_slip"]], effects)
    assert not is_right([["ptt_linear", "tr(sigma)*sigma"]], effects)
    assert is_right([[]], [])
    assert not is_right([["ptt_linear"]], [])
    assert not is_right([[]], None)


def test_calibration_error_is_what_was_said_less_what_was_so():
    said = np.array([0.9, 0.9, 0.9, 0.9, 0.1, 0.1])
    assert calibration_error(said, np.array([1, 1, 1, 0, 0, 0]))[0] == pytest.approx(
        4 / 6 * 0.15 + 2 / 6 * 0.1
    )
    # said with certainty, and right
    assert calibration_error(np.array([1.0, 0.0]), np.array([1, 0]))[0] == 0.0


def test_no_case_of_a_hundred_leaves_four_in_a_hundred_open():
    # Clopper & Pearson 1934: of n trials without a hit the upper end is 1 − 0.025^(1/n)
    assert share(0, 100) == f"0 of 100 (0 to {100 * (1 - 0.025 ** (1 / 100)):.0f} %)"


def case(effects, verdict, members, probability, **more):
    return {
        "index": 0, "law": "a law", "flaw": "sound", "protocol": "steps", "noise": "white",
        "effects": effects, "verdict": verdict, "inclusion": {}, "constants": [], "bands": [],
        "explanations": [{"members": members, "probability": probability}],
        "unexplained_probability": 1.0 - probability, "processor_seconds": 1.0,
        "library_laws": [], "terms": [], **more,
    }  # fmt: skip


def test_the_table_of_loops_counts_what_was_false():
    cases = [
        case([["wall_slip"]], "effects_added", [["wall_slip"]], 1.0,
             constants=[{"ci95": [0.0, 1.0], "truth": 0.5}]),
        case([["wall_slip"]], "effects_added", [["stress_gain"]], 1.0,
             inclusion={"stress_gain": 0.8, "wall_slip": 0.2}),
        case([], "effects_added", [["stress_gain"]], 1.0),
        case(None, "effects_added", [["stress_gain"]], 1.0),
        case(None, "unexplained", [["stress_gain"]], 0.1),
    ]  # fmt: skip
    table = loop_table(cases)
    assert "in the likeliest class: 1 of 2" in table
    assert "a name beside it, 50 % or more: 1 of 2" in table
    assert "named where there is none: 1 of 1" in table
    assert "where something has none: 1 of 2" in table
    assert "but: 0, a law, sound, steps, white: effects_added, stress_gain 1.00" in table
    assert "hold the constant: 1 of 1" in table


def test_the_table_of_comparisons_keeps_learners_and_quantities_apart():
    def band(quantity, inside):
        return {"source": "tensor_sindy", "run": "e", "quantity": quantity, "inside": inside,
                "half_width": 0.1}  # fmt: skip

    table = comparison_table([
        case([], "explained", [[]], 1.0, bands=[band("N1", 0.95), band("N1", 0.5)]),
        case(None, "unexplained", [[]], 0.0, bands=[band("N2", 1.0)]),
    ])  # fmt: skip
    assert "tensor_sindy, N1: 72.5 % of the samples, runs held to 90 % 1 of 2" in table
    assert "tensor_sindy, N2: 100.0 %" in table
    assert "something has none: explained in 0 of 1" in table


def test_the_table_of_comparisons_counts_what_was_said_to_be_determined_and_is_not():
    def curve(quantity, off):
        return {"source": "tensor_sindy", "run": "e", "quantity": quantity, "off": off}

    right = [{"term": "sigma.sigma", "ci95": [0.18, 0.22]}]
    table = comparison_table([
        case([], "explained", [[]], 1.0, terms=right, library_laws=[{"sigma.sigma": 0.2}],
             undetermined=["N2"], bands=[curve("N1", 0.01), curve("N2", 0.5)]),
        case([], "explained", [[]], 1.0, library_laws=[{"sigma.sigma": 0.2}],
             undetermined=[], bands=[curve("N1", 0.2), curve("N2", 0.05)]),
    ])  # fmt: skip
    assert "found alone: 1 of 2" in table
    assert "hold the coefficient: 1 of 1" in table
    assert "off by a tenth: 1 of 3" in table
    assert "N1 by 20 %" in table


def test_a_world_without_noise_holds_the_law_of_the_library_that_it_names():
    world = next(w for i in range(0, 200, 2) if (w := draw_world(1, i)).library_laws)
    exact, noisy = world.make(None), world.make(np.random.default_rng(0))
    for name, run in exact.items():
        np.testing.assert_array_equal(run.stress, run.true.sigma12)
        off = np.linalg.norm(noisy[name].stress - run.stress) / np.linalg.norm(run.stress)
        assert 0.0 < off < 0.2


@pytest.mark.slow
def test_a_comparison_on_a_sound_maxwell_fluid_is_explained_and_its_bands_hold(tmp_path):
    found = ask("calibration", "0", "compare", 7, str(tmp_path), 3600.0)
    assert (found["law"], found["flaw"], found["verdict"]) == ("Maxwell", "sound", "explained")
    assert found["terms"] == []
    assert {b["source"] for b in found["bands"]} == {"tensor_sindy", "posterior"}
    held = [b["inside"] for b in found["bands"] if "inside" in b]
    assert held
    assert min(held) > 0.9
    assert "found alone: 1 of 1" in comparison_table([found])
