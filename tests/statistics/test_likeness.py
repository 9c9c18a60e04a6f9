"""What a residual may be of the instrument's: zeros that wander, means, a converter's steps."""

import numpy as np
import pytest
from independent import Giesekus, WhiteMetzner, oscillation, start_up
from scipy.signal import lfilter

from discover.statistics import lack_of_fit
from discover.statistics.likeness import likeness
from discover.statistics.noise.running_mean import averaged_over
from discover.statistics.noise.wandering import wandering

LENGTHS = (80, 80, 120)
DRAWS = 40
FLOWS = (
    (start_up(0.5), np.linspace(0.1, 8.0, 80)),
    (start_up(2.0), np.linspace(0.1, 8.0, 80)),
    (oscillation(2.0, 1.0), np.linspace(0.1, 12.0, 120)),
)
SCALE = {"modulus": 100.0, "relaxation_time": 1.0}


def walk(n, lot):
    return 0.04 * np.cumsum(lot.standard_normal(n)) / np.sqrt(n) + 0.003 * lot.standard_normal(n)


def smooth(n, lot, size=3.0):
    swings = np.cos(np.pi * np.outer(np.arange(1, 5), np.linspace(0.0, 1.0, n)))
    row = lot.standard_normal(4) @ swings
    return 0.01 * (size * row / np.sqrt(np.mean(row**2)) + lot.standard_normal(n))


def start(n, lot):
    time = np.linspace(0.0, 1.0, n)
    return 0.01 * (10.0 * lot.choice([-1.0, 1.0]) * np.exp(-time / 0.1) + lot.standard_normal(n))


def wave(n, lot):
    time = np.linspace(0.0, 12.0, n)
    return 0.01 * (10.0 * np.sin(3.0 * time + lot.uniform(0.0, 6.0)) + lot.standard_normal(n))


def white(n, lot):
    return 0.01 * lot.standard_normal(n)


def correlated(n, lot):
    return 0.01 * lfilter([1.0], [1.0, -0.5], lot.standard_normal(n))


def found(make):
    lots = (np.random.default_rng(seed) for seed in range(DRAWS))
    told = [wandering([make(n, lot) for n in LENGTHS]) for lot in lots]
    return [far for far in told if far is not None]


def test_a_zero_that_wanders_is_told_with_its_size():
    told = found(walk)
    assert len(told) > DRAWS / 2
    # at its end a walk is 0.04 off, root-mean-square over draws
    assert np.median(told) == pytest.approx(0.04, rel=0.3)


@pytest.mark.parametrize("make", [smooth, start, wave, white, correlated])
def test_what_a_law_lacks_does_not_wander(make):
    assert not found(make)


def test_runs_of_a_few_samples_say_nothing_of_a_walk():
    lot = np.random.default_rng(0)
    assert wandering([np.cumsum(lot.standard_normal(30)) for _ in range(4)]) is None


def mean_of(width, n, lot):
    return np.convolve(lot.standard_normal(n + width - 1), np.full(width, 1.0 / width), "valid")


@pytest.mark.parametrize("width", [2, 3, 5, 9])
def test_noise_that_is_a_running_mean_is_told_with_its_width(width):
    lots = (np.random.default_rng(seed) for seed in range(20))
    told = [averaged_over([mean_of(width, n, lot) for n in LENGTHS]) for lot in lots]
    assert told.count(width) >= 18


@pytest.mark.parametrize("make", [smooth, start, wave, white, correlated, walk])
def test_what_is_no_running_mean_is_not_told_as_one(make):
    lots = (np.random.default_rng(seed) for seed in range(DRAWS))
    assert not any(averaged_over([make(n, lot) for n in LENGTHS]) for lot in lots)


def test_a_mean_over_a_third_of_a_run_is_not_told_from_a_misfit():
    lot = np.random.default_rng(0)
    assert averaged_over([mean_of(27, 80, lot) for _ in range(4)]) is None


def test_a_fit_that_leaves_a_running_mean_says_so():
    lot = np.random.default_rng(1)
    records = [np.sin(np.linspace(0.0, 9.0, n)) for n in LENGTHS]
    left = lack_of_fit([0.03 * mean_of(9, n, lot) for n in LENGTHS], records)
    assert left.verdict == "unexplained"
    assert "each sample is the mean of 9" in left.likeness
    assert "without smoothing it over 9 samples" in left.advice


def test_records_that_repeat_each_value_are_told_and_those_that_do_not_are_not():
    lot = np.random.default_rng(3)
    records = [np.sin(np.linspace(0.0, 9.0, n)) + white(n, lot) for n in LENGTHS]
    held = [row[3 * (np.arange(len(row)) // 3)] for row in records]
    left = [true - row for true, row in zip(records, held, strict=True)]
    told = likeness(left, held)
    assert "stands in 3 samples" in told.looks
    assert "keep the first" in told.remedy
    assert "stands in" not in str(likeness(left, records))
    assert "stands in" not in str(likeness(left, [*held[:2], records[2]]))


def residual_in_steps(told, share=0.04):
    """Return what a Giesekus law leaves of records of a fluid that are read in steps."""
    law = Giesekus(0.3, **SCALE)
    rows, records = [], []
    for flow, times in FLOWS:
        stress = told.respond(flow, times).sigma12
        step = share * np.max(np.abs(stress))
        records.append(step * np.round(stress / step))
        rows.append(law.respond(flow, times).sigma12 - records[-1])
    return rows, records


def test_steps_of_a_converter_are_told_where_they_may_be_all_that_is_left():
    text = str(likeness(*residual_in_steps(Giesekus(0.3, **SCALE))))
    assert "steps of 4 % of their largest value" in text
    assert "100 % of the residual stands within half of one" in text
    assert "hide as much of a law" in text


def test_steps_are_not_told_where_more_is_left_or_where_there_are_none():
    assert str(likeness(*residual_in_steps(WhiteMetzner(0.5, **SCALE)))) == ""
    rows, records = residual_in_steps(Giesekus(0.3, **SCALE), share=1e-9)
    lot = np.random.default_rng(0)
    assert str(likeness(rows, [row + lot.standard_normal(len(row)) for row in records])) == ""


def test_only_what_is_not_explained_is_said_to_look_like_something():
    rows, records = residual_in_steps(Giesekus(0.3, **SCALE))
    left = lack_of_fit(rows, records)
    assert left.verdict == "unexplained"
    assert "steps" in left.likeness
    lot = np.random.default_rng(0)
    noise = [lot.standard_normal(len(row)) for row in records]
    left = lack_of_fit(noise, records)
    assert left.verdict == "explained"
    assert left.likeness == ""
