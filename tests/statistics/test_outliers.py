"""Which samples are outliers: spikes, and not noise, peaks or steps."""

import numpy as np
import pytest
from independent import noise
from scipy.integrate import solve_ivp

from discover.statistics.noise.outliers import isolated

TIMES = np.linspace(0.05, 10.0, 200)
WAVE = np.sin(2.0 * TIMES)


def correlated(rho, generator, size=0.02, n=200):
    return size * (noise.correlated(np.ones(n), 1.0, rho, generator) - 1.0)


@pytest.mark.parametrize("share", [0.02, 0.05])
def test_spikes_of_thirty_times_the_noise_are_found(share):
    generator = np.random.default_rng(0)
    found = there = 0
    for _ in range(10):
        off = generator.random(200) < share
        off[:3] = off[-3:] = False
        spikes = 0.02 * 30.0 * off * generator.choice([-1.0, 1.0], 200)
        record = WAVE + correlated(0.0, generator) + spikes
        found += np.count_nonzero(isolated(record) & off)
        there += np.count_nonzero(off)
    # some stand side by side, and cannot be told from something real
    assert found > 0.7 * there


@pytest.mark.parametrize("correlation", [0.0, 0.9])
@pytest.mark.parametrize("size", [1.0, np.abs(WAVE), 1.0 + (TIMES > 5.0)], ids=["", "prop", "step"])
def test_noise_has_fewer_than_one_outlier_in_a_thousand_samples(correlation, size):
    generator = np.random.default_rng(1)
    count = 0
    for _ in range(20):
        noise = size * correlated(correlation, generator)
        count += np.count_nonzero(isolated(WAVE + noise))
    assert count <= 4  # of 4000


@pytest.mark.parametrize("samples", [15, 40, 200])
@pytest.mark.parametrize("noise", [0.0, 0.005])
def test_peaks_and_steps_are_no_outliers(samples, noise):
    time = np.linspace(0.0, 10.0, samples)
    generator = np.random.default_rng(2)
    # σ' = γ̇ − σ − ε σ³ (a law that overshoots with its structure), by scipy, and dry friction
    change = lambda t, y: [3.0 * y[1] - y[0], -2.0 * (y[1] - 0.2)]  # noqa: E731
    peak = solve_ivp(change, (0.0, 10.0), [0.0, 3.0], t_eval=time, rtol=1e-8).y[0]
    friction = np.sin(2.0 * time) + 0.4 * np.sign(np.cos(2.0 * time))
    for record in (peak, friction, np.abs((time % 2.0) - 1.0)):
        drawn = record + noise * generator.standard_normal(samples)
        assert not np.any(isolated(drawn))


@pytest.mark.parametrize("at", [1, 2, -3, -2, -1])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_knock_near_an_end_is_an_outlier(at, sign):
    record = WAVE + correlated(0.0, np.random.default_rng(3))
    record[at] += sign * 30.0 * 0.02
    assert np.flatnonzero(isolated(record)).tolist() == [at % 200]


@pytest.mark.parametrize("ringing", [1, 3, 8])
def test_what_rings_at_the_start_is_no_outlier(ringing):
    """An instrument that settles in a few samples: what is off in them is real."""
    record = WAVE + correlated(0.0, np.random.default_rng(2))
    record[:ringing] += 30.0 * 0.02 * 0.8 ** np.arange(ringing) * (-1.0) ** np.arange(ringing)
    assert not np.any(isolated(record)[:ringing])


def test_what_gives_way_at_the_end_is_no_outlier():
    record = WAVE + correlated(0.0, np.random.default_rng(2))
    record[-4:] -= 30.0 * 0.02 * np.arange(1.0, 5.0)
    assert not np.any(isolated(record))


@pytest.mark.parametrize("correlation", [0.0, 0.9])
def test_noise_and_what_ends_suddenly_are_no_outliers_near_an_end(correlation):
    """A motor that stops two samples before the end, a stress that levels off, a first sample."""
    generator = np.random.default_rng(5)
    growing = np.exp(0.3 * np.arange(40.0))
    growing[-1] = growing[-2]
    stopped = np.append(1.0 - np.exp(-TIMES[:-2]), [0.4, 0.2])
    started = np.append([0.7], 1.0 - np.exp(-TIMES))
    for record in (WAVE, 1.0 - np.exp(-TIMES), growing, stopped, started):
        size = 0.02 * np.minimum(np.abs(record), 1.0)
        for _ in range(50):
            noise = size * correlated(correlation, generator, 1.0, len(record))
            assert not np.any(isolated(record + noise)[[0, 1, 2, -3, -2, -1]])


def test_samples_that_read_zero_are_outliers_unless_the_stress_passes_or_rests_there():
    record = 1.0 - np.exp(-TIMES) + correlated(0.0, np.random.default_rng(6))
    dropped = [20, 21, 30, 32, 33, 34, 100]
    record[dropped] = 0.0
    assert np.flatnonzero(isolated(record)).tolist() == dropped
    # records without noise that read exactly zero: a wave, a cusp, a rest before the flow
    wave = np.round(np.sin(0.1 * np.pi * np.arange(200)), 12)
    cusp = np.abs(np.arange(-100.0, 100.0)) / 100.0
    rest = np.append(np.zeros(30), 1.0 - np.exp(-TIMES))
    for record in (wave, cusp, rest):
        assert not np.any(isolated(record))
