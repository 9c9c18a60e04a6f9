"""A first step beyond the minimum, to the end of a range, hides no law. Records by scipy."""

import numpy as np
import pytest
from independent import Giesekus, JohnsonSegalman, Thixotropic
from independent.flow import start_up
from independent.folders import with_noise, write_folder
from independent.instruments import Instrument

import discover as dc

BASE = dc.Fluid(dc.make_law("ucm"), 100.0, 1.0)
FLOWS = {"slow.csv": (start_up(0.2), 8.0), "faster.csv": (start_up(0.6), 6.0)}
NOISE = 0.02


def records(folder, material):
    runs = {
        name: Instrument().record(material, flow, np.linspace(0.05, end, 80))
        for name, (flow, end) in FLOWS.items()
    }
    noisy = with_noise(runs, NOISE, np.random.default_rng(0))
    return dc.load_dataset(write_folder(folder, noisy))


# of these flows the misfit as a function of α has a second minimum at its largest, 1, and as one of
# ξ it is flat there, so that steps towards the minimum are first far too long and then too short
@pytest.mark.parametrize(
    ("effect", "material", "constant", "planted"),
    [
        ("giesekus_mobility", Giesekus(0.5, 100.0, 1.0), "alpha", 0.5),
        pytest.param(
            "non_affine_motion",
            JohnsonSegalman(0.55, 100.0, 1.0),
            "xi",
            0.55,
            marks=pytest.mark.slow,
        ),
    ],
)
def test_what_was_planted_is_found_from_the_far_end(tmp_path, effect, material, constant, planted):
    options = {"effects": [effect], "max_effects": 1, "explanations": 1}
    loop = dc.close_loop(records(tmp_path, material), BASE, **options)
    assert loop.verdict == "effects_added"
    low, high = loop.stages[0].parameters[constant].ci95
    assert low < planted < high


@pytest.mark.slow
def test_slow_shear_of_a_giesekus_fluid_does_not_exclude_the_law_that_made_it(tmp_path):
    effects = ["giesekus_mobility", "non_affine_motion", "ptt_linear", "ptt_exponential"]
    loop = dc.close_loop(
        records(tmp_path, Giesekus(0.5, 100.0, 1.0)), BASE, effects=effects, max_effects=1
    )
    told = [one for one in loop.explanations.likeliest_first if one.probability > 0.05]
    assert any(one.effects == ("giesekus_mobility",) for one in told)


@pytest.mark.slow
def test_a_slow_structure_is_not_taken_for_a_fast_one(tmp_path):
    """Broken as much and healed as fast, it thins alike in steady flow: a minimum far off."""
    flows = {f"at_{rate:g}.csv": start_up(rate) for rate in (0.5, 2.0, 5.0)}
    fluid = Thixotropic(Giesekus(0.0, 100.0, 1.0), breakdown=0.25, build_up_time=2.0)
    runs = {
        name: Instrument().record(fluid, flow, np.linspace(0.1, 8.0, 80))
        for name, flow in flows.items()
    }
    data = write_folder(tmp_path, with_noise(runs, 0.01, np.random.default_rng(0)))
    options = {"effects": ["thixotropy"], "max_effects": 1, "explanations": 1}
    loop = dc.close_loop(dc.load_dataset(data), BASE, **options)
    assert loop.verdict == "effects_added"
    constants = loop.stages[0].parameters
    assert constants["breakdown"].value == pytest.approx(0.25, rel=0.05)
    assert constants["build_up_time"].value == pytest.approx(2.0, rel=0.1)
