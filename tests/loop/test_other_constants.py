"""Declared constants of another temperature or sample are told from effects that are missing."""

import re

import numpy as np
import pytest
from independent import Giesekus, UpperConvectedMaxwell
from independent.flow import oscillation, start_up
from independent.folders import write_folder
from independent.instruments import Instrument

import discover as dc
from discover.closed_loop.explanations.other_constants import FACTOR

MODULUS, TIME, NOISE = 100.0, 1.0, 0.01
FLOWS = {
    "slow.csv": start_up(0.3),
    "fast.csv": start_up(3.0),
    "wave.csv": oscillation(3.0, 1.0),
    "unseen.csv": oscillation(4.0, 1.5),
}
EFFECTS = ["wall_slip", "giesekus_mobility", "stress_gain"]


def loop_of(folder, material, declared_time, instrument=None, **how):
    """Return the loop over noisy records of a material, told a relaxation time."""
    times, generator = np.linspace(0.0, 8.0, 60), np.random.default_rng(0)
    instrument = instrument or Instrument()
    runs = {name: instrument.record(material, flow, times) for name, flow in FLOWS.items()}
    for run in runs.values():
        size = NOISE * np.sqrt(np.mean(run.stress**2))
        run.stress[:] += size * generator.standard_normal(len(times))
    data = dc.load_dataset(write_folder(folder, runs))
    return dc.close_loop(
        data,
        dc.Fluid(dc.make_law("ucm"), MODULUS, declared_time),
        held_out=["unseen.csv"],
        effects=EFFECTS,
        max_effects=1,
        explanations=3,
        **how,
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("declared", "slip"),
    [(2.0 * TIME, 0.0), (TIME, 0.005)],
    ids=["the time was wrong", "the fluid slipped"],
)
def test_slip_of_a_maxwell_fluid_is_not_told_from_a_shorter_time(tmp_path, declared, slip):
    # 1/λ + G s is the same in both: they leave the same stress
    loop = loop_of(tmp_path, UpperConvectedMaxwell(MODULUS, TIME), declared, Instrument(slip=slip))
    (stage,) = loop.stages
    assert stage.effect == "wall_slip"
    assert FACTOR in stage.aliases
    # even odds, less what is left for what nobody wrote down
    assert loop.explanations.inclusion["wall_slip"] < 0.6
    # the standard error of a slip at this noise is half a per cent
    said = re.search(r"all ([0-9.]+) times the declared", loop.remaining["description"])
    assert said is not None
    expected = TIME / declared / (1.0 + MODULUS * TIME * slip)
    assert float(said[1]) == pytest.approx(expected, rel=0.02)


@pytest.mark.slow
def test_times_that_no_effect_makes_up_for_are_named_where_nothing_is_explained(tmp_path):
    loop = loop_of(tmp_path, Giesekus(0.3, MODULUS, TIME), 2.0 * TIME)
    assert loop.verdict == "unexplained"
    assert "relaxation times that are all 0.5" in loop.remaining["description"]
    assert "giesekus_mobility" in loop.remaining["description"]


def test_an_effect_that_no_factor_on_the_times_imitates_stands_alone(tmp_path):
    loop = loop_of(tmp_path, Giesekus(0.3, MODULUS, TIME), TIME)
    assert loop.verdict == "effects_added"
    assert FACTOR not in loop.stages[0].aliases
    assert "relaxation times" not in loop.remaining["description"]
    assert loop.explanations.inclusion["giesekus_mobility"] > 0.8


@pytest.mark.parametrize(("declared", "verdict"), [(0.3, "unexplained"), (0.5, "no_effect_needed")])
def test_a_known_effect_of_another_sample_is_told_with_its_own_constant(
    tmp_path, declared, verdict
):
    known = {"giesekus_mobility": {"alpha": declared}}
    loop = loop_of(tmp_path, Giesekus(0.5, MODULUS, TIME), TIME, known_effects=known)
    assert loop.verdict == verdict
    said = re.search(
        r"alpha = ([0-9.]+) \(declared: 0\.3\) of giesekus_mobility the fitted",
        loop.remaining["description"],
    )
    if declared == 0.5:
        assert said is None
    else:
        # the standard error of a mobility at this noise is half a per cent
        assert float(said[1]) == pytest.approx(0.5, rel=0.02)


def test_a_known_effect_that_is_not_there_is_left_out(tmp_path):
    known = {"giesekus_mobility": {"alpha": 0.3}}
    loop = loop_of(tmp_path, UpperConvectedMaxwell(MODULUS, TIME), TIME, known_effects=known)
    assert loop.verdict == "unexplained"
    said = re.search(
        r"Without giesekus_mobility the fitted runs are missed by ([0-9.]+) %",
        loop.remaining["description"],
    )
    assert said is not None
    assert float(said[1]) < 1.1  # the noise, and a tenth more than its 180 samples may have
