"""Which effects are candidates, by the rates of the runs alone."""

from dataclasses import replace

import numpy as np
import pytest

from discover.dataset import Run
from discover.effects import make_effect
from discover.loop.task import EXTRAPOLATION, admission, candidates_of
from discover.protocols import start_up

TIMES = np.linspace(0.1, 2.0, 20)


def run(rate, measured=False):
    rates = np.full(20, rate)
    return Run(f"{rate}", TIMES, start_up(rate), rates, np.ones(20), rate_is_measured=measured)


def admitted(fitted, held=()):
    admits = admission(fitted, held)
    return {effect.name for effect in candidates_of(None) if admits(effect)}


@pytest.mark.parametrize(("factor", "tried"), [(0.9, True), (1.1, False)])
def test_terms_that_name_the_rate_are_none_where_the_loop_must_extrapolate_far(factor, tried):
    names = admitted([run(0.4), run(-1.5)], [run(1.5 * factor * EXTRAPOLATION)])
    for name in ("non_affine_motion", "gammadot", "tr(sigma)*gammadot"):
        assert (name in names) == tried, name
    # the control: what feels the stress alone, and the instrument, are candidates all the same
    assert {"giesekus_mobility", "ptt_linear", "rate_rise_time", "stress_gain"} <= names


def test_without_a_run_held_out_all_are_candidates_and_a_gain_of_a_force_where_one_is_fitted():
    every = {effect.name for effect in candidates_of(None)}
    assert admitted([run(1.0)]) == every - {"normal_force_gain"}
    with_force = replace(run(1.0), first_normal_stress_difference=np.ones(20))
    assert admitted([with_force]) == every - {"normal_force_gain"}  # recorded, and not fitted
    assert admitted([with_force, with_force.observing("N1")]) == every


@pytest.mark.parametrize("measured", [False, True])
def test_what_shapes_a_command_is_none_where_the_rate_was_measured(measured):
    names = admitted([run(1.0), run(2.0, measured)])
    shaping = {
        effect.name for effect in candidates_of(None) if getattr(effect, "shapes_command", False)
    }
    assert "rate_rise_time" in shaping
    assert (shaping <= names) == (not measured)
    assert bool(shaping & names) == (not measured)
    # a wrong gap is between the tool and the fluid
    assert not make_effect("rate_gain").shapes_command
    assert "rate_gain" in names
