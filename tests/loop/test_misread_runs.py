"""A loop whose runs were read otherwise than its model has it: records by scipy."""

import numpy as np
import pytest
from independent import Giesekus, oscillation, start_up

import discover as dc
from discover.dataset import Dataset, Run
from discover.protocols import oscillatory_shear
from discover.protocols import start_up as protocol
from discover.report.loop.found import what_was_found
from discover.report.loop.next_step import what_to_measure_next

GROWTH, WAVE = np.linspace(0.1, 8.0, 80), np.linspace(0.1, 12.0, 120)
FLOWS = {
    "slow.csv": (start_up(0.5), protocol(0.5), GROWTH),
    "fast.csv": (start_up(2.0), protocol(2.0), GROWTH),
    "wave.csv": (oscillation(2.0, 1.0), oscillatory_shear(2.0, 1.0), WAVE),
}


@pytest.fixture(scope="module")
def exact():
    return {
        name: Giesekus(0.3, 100.0).respond(flow, times).sigma12
        for name, (flow, _, times) in FLOWS.items()
    }


def found(exact, change, **options):
    """Return a loop that knows the mobility alone, on records with 1 % of noise."""
    lot, runs = np.random.default_rng(2), []
    for name, (flow, own, times) in FLOWS.items():
        noise = 0.01 * np.sqrt(np.mean(exact[name] ** 2)) * lot.standard_normal(len(times))
        rates = np.asarray(flow.rate(times), float) + 0.0 * times
        runs.append(Run(name, times, own, rates, change(name, exact[name]) + noise))
    fluid = dc.Fluid(dc.make_law("ucm"), [100.0], [1.0])
    options = {"effects": ["giesekus_mobility"], "max_effects": 1, **options}
    return dc.close_loop(Dataset("runs", tuple(runs)), fluid, **options)


def test_a_range_of_the_transducer_that_reads_more_is_no_explanation(exact):
    loop = found(exact, lambda name, stress: stress * (1 + 0.012 * (np.abs(stress) > 50.0)))
    assert loop.verdict == "unexplained"
    assert "times the stress above" in loop.remaining["description"]
    # both are said where one reads first
    assert "times the stress above" in what_was_found(loop)
    assert what_to_measure_next(loop) == "Measure one flow in both ranges of the transducer."


def test_runs_that_were_filled_differently_are_none(exact):
    factors = {"slow.csv": 1.01, "fast.csv": 0.99, "wave.csv": 1.0}
    loop = found(exact, lambda name, stress: factors[name] * stress)
    assert loop.verdict == "unexplained"


def test_runs_as_the_model_has_them_are_explained(exact):
    loop = found(exact, lambda name, stress: stress)
    assert loop.verdict == "effects_added"
    assert loop.remaining["read_as"] == loop.remaining["advice"] == ""
    low, high = loop.stages[0].parameters["alpha"].ci95
    assert low < 0.3 < high
    assert high - low < 0.012  # noise alone makes it 0.004 wide, and an inexact instrument 0.010


def test_noise_that_is_given_may_hold_another_reading(exact):
    factors = {"slow.csv": 1.01, "fast.csv": 0.99, "wave.csv": 1.0}
    loop = found(exact, lambda name, stress: factors[name] * stress, noise=0.02)
    assert loop.verdict == "effects_added"
