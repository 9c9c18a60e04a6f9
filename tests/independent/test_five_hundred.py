"""The five hundred fluids of the field's own test, against closed forms and another simulator."""

import numpy as np
import pytest
from five_hundred import judged
from independent import Giesekus, Modes, Newtonian, PhanThienTanner, oscillation
from independent.five_hundred import FLOWS, RANGES, TIMES, drawn, records, respond

RATE = 1e-3


@pytest.mark.parametrize("frequency", [1.0 / 3.0, 1.0, 2.0])
@pytest.mark.parametrize("law", ["Oldroyd-B", "Giesekus", "linear PTT"])
def test_at_a_small_amplitude_a_fluid_is_the_linear_maxwell_mode_and_its_solvent(law, frequency):
    c = drawn(law, 5, 0)
    w, t = frequency, c["time"]
    # σ' + σ/λ = G γ̇0 sin ωt from rest, in closed form
    x = w * t
    mode = c["viscosity"] * RATE / (1 + x**2)
    closed = mode * (np.sin(w * TIMES) - x * np.cos(w * TIMES) + x * np.exp(-TIMES / t))
    closed = closed + c["solvent"] * RATE * np.sin(w * TIMES)
    found = respond(c, lambda at: RATE * np.sin(w * np.asarray(at)))
    # the first term left out goes with the square of the Weissenberg number, at most (1e-2)²
    np.testing.assert_allclose(found, closed, atol=2e-4 * np.max(np.abs(closed)))


def test_a_newtonian_fluid_is_its_viscosity_and_carreau_and_yasuda_have_their_two_limits():
    (eta,) = drawn("Newtonian", 5, 1).values()
    for columns in records("Newtonian", 5, 1).values():
        np.testing.assert_array_equal(columns["stress_Pa"], eta * columns["shear_rate_1_s"])
    c = {"zero": 10.0, "infinite": 0.05, "k": 1.0, "n": 0.4, "a": 2.0}
    slow = respond(c, lambda t: np.full(np.shape(t), 1e-6))
    np.testing.assert_allclose(slow, 1e-6 * c["zero"], rtol=1e-9)
    fast = respond(c, lambda t: np.full(np.shape(t), 1e6)) / 1e6 - c["infinite"]
    np.testing.assert_allclose(fast, 9.95 * 1e6 ** (c["n"] - 1.0), rtol=1e-6)


@pytest.mark.parametrize("law", ["Giesekus", "linear PTT"])
def test_large_oscillations_are_those_of_the_simulators_on_full_tensors(law):
    c = drawn(law, 5, 2)
    scale = c["viscosity"] / c["time"], c["time"]
    mode = PhanThienTanner(c.get("epsilon", 0.0), "linear", c.get("zeta", 0.0), *scale)
    mode = Giesekus(c["alpha"], *scale) if law == "Giesekus" else mode
    fluid = Modes(mode, Newtonian(c["solvent"]))
    for name, (rate, frequency) in list(FLOWS.items())[6:9]:
        exact = fluid.respond(oscillation(rate, frequency, -np.pi / 2), TIMES).sigma12
        found = records(law, 5, 2)[name]["stress_Pa"]
        np.testing.assert_allclose(found, exact, atol=1e-7 * np.max(np.abs(exact)))  # both to 1e-9


def test_constants_lie_in_their_ranges_and_are_those_of_the_number():
    for law, ranges in RANGES.items():
        many = [drawn(law, 5, number) for number in range(50)]
        assert many[3] == drawn(law, 5, 3) != many[4]
        for name, (_, low, high) in ranges.items():
            values = [one[name] for one in many]
            assert low <= min(values) < max(values) <= high


@pytest.mark.parametrize(
    ("verdict", "alike", "named", "answer"),
    [
        ("effects_added", ["giesekus"], [["solvent_viscosity"]], "right"),
        ("effects_added", ["ucm"], [["giesekus_mobility"], ["solvent_viscosity"]], "right"),
        ("effects_added", ["xpp", "giesekus"], [["solvent_viscosity"]], "twin"),
        ("unexplained", ["ptt_linear"], [], "withheld"),
        ("effects_added", ["ucm"], [["instrument_inertia"], ["solvent_viscosity"]], "wrong"),
        ("no_effect_needed", ["giesekus"], [], "wrong"),
    ],
)
def test_an_answer_is_right_a_twin_withheld_or_wrong(verdict, alike, named, answer):
    assert judged("Giesekus", verdict, alike, named) == answer
