"""Inside the fitted range or beyond it."""

from dataclasses import replace

import numpy as np
import pytest

from discover.comparison.flows import Flow
from discover.comparison.outcome import place
from discover.protocols.protocol import in_flow, oscillatory_shear, start_up

TIME = np.linspace(0.0, 20.0, 201)


def oscillation(weissenberg, deborah):
    rate = weissenberg * np.cos(deborah * TIME)
    return Flow("osc", "test", oscillatory_shear(weissenberg, deborah), TIME, rate, {})


def started(rate, duration=20.0):
    times = np.linspace(0.0, duration, 201)
    return Flow("start", "test", start_up(rate), times, np.full(201, rate), {})


PAPER = [oscillation(wi, de) for de in (0.25, 0.5, 0.75, 1.0) for wi in (1.0, 2.0)]


def test_a_fitted_flow_is_inside():
    assert place(PAPER[3], PAPER).inside
    assert place(oscillation(0.1, 0.9), PAPER).inside


def test_a_faster_oscillation_is_beyond_in_rate_and_frequency():
    placed = place(oscillation(3.0, 1.5), PAPER)
    assert placed.beyond == pytest.approx({"shear rate": 1.5, "frequency": 1.5})
    assert placed.text.startswith("beyond the fitted range: shear rate (Wi) 1.5 times")


def test_a_start_up_is_beyond_in_strain_though_its_rate_was_fitted():
    # strain 40 against the largest of the eight series, 2/0.25
    placed = place(started(2.0), PAPER)
    assert placed.beyond == pytest.approx({"strain": 5.0}, rel=0.01)
    assert place(started(2.0, duration=3.0), PAPER).inside


def test_a_step_of_the_rate_excites_every_frequency():
    assert place(oscillation(1.0, 5.0), [started(2.0)]).inside
    assert not place(oscillation(1.0, 5.0), PAPER).inside


def test_runs_at_rest_leave_every_flow_beyond():
    placed = place(started(1.0), [started(0.0)])
    assert set(placed.beyond) == {"shear rate", "strain"}


def test_an_extension_is_beyond_wherever_only_shear_was_fitted():
    pull = replace(started(0.1), protocol=in_flow(start_up(0.1), "uniaxial"))
    placed = place(pull, [started(2.0)])
    assert not placed.inside
    assert placed.text == (
        "beyond the fitted range: uniaxial extension, of which nothing was fitted"
    )
    assert placed.to_json()["new_flow"] == "uniaxial"
    # among extensions of its own kind it is held against those, whatever the shear was
    faster = replace(started(0.3), protocol=in_flow(start_up(0.3), "uniaxial"))
    assert place(pull, [started(0.01), faster]).inside
    assert place(faster, [started(9.0), pull]).beyond["Hencky rate"] == pytest.approx(3.0)
