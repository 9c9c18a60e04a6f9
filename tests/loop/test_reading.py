import numpy as np
import pytest

from discover.loop import RunRecord
from discover.loop.reading import oscillation, read_residual, read_wave

RATES = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0)


def record(name, time, strain, rate, measured, left, **options):
    error = np.sqrt(np.mean(left**2) / np.mean(measured**2))
    predicted = np.stack([measured + left])
    values = strain, time, rate, measured, predicted, np.array([error])
    return RunRecord(name, False, time, *values, **options)


def start_up(rate, residual, seed=0, **options):
    """Return the record of a start-up whose residual is a function of time and strain."""
    time = np.geomspace(0.01, 20.0, 150)
    measured = rate * (1.0 - np.exp(-time))
    size = float(np.sqrt(np.mean(measured**2)))
    left = size * residual(time, rate * time, np.random.default_rng([seed, int(1000 * rate)]))
    return record(
        f"{rate:g}", time, rate * time, np.full_like(time, rate), measured, left, **options
    )


def oscillating(residual, frequency=0.7, cycles=6.0, samples=400, noise=0.0, seed=1):
    """Return the record of an oscillation with strain sin ωt and stress 2 sin ωt + cos ωt."""
    time = np.linspace(0.0, cycles * 2.0 * np.pi / frequency, samples)
    phase = frequency * time
    measured = 2.0 * np.sin(phase) + np.cos(phase)
    left = residual(phase) + noise * np.random.default_rng(seed).normal(size=samples)
    return record("wave", time, np.sin(phase), frequency * np.cos(phase), measured, left)


def test_noise_follows_nothing():
    spoke = 0
    for seed in range(40):
        records = [
            start_up(rate, lambda t, g, rng: 0.05 * rng.normal(size=t.size), seed) for rate in RATES
        ]
        reading = read_residual(records)
        spoke += bool(reading.sentences)
    # trends of pure chance are named in one case of twenty; four of forty has a probability of 0.1
    assert spoke <= 5


def test_a_residual_that_grows_with_temperature_is_said_to():
    temperatures = (-30.0, -20.0, -10.0, 0.0, 10.0, 20.0)
    mixed = (2.0, 0.1, 1.0, 5.0, 0.2, 0.5)  # so that the rate is not the order of temperatures
    records = [
        start_up(
            rate,
            lambda t, g, rng, warm=warm: 0.01 * (warm + 40.0) * rng.normal(size=t.size),
            conditions={"temperature_C": warm},
        )
        for rate, warm in zip(mixed, temperatures, strict=True)
    ]
    trends = read_residual(records).trends
    assert [(t.quantity, t.of) for t in trends] == [("temperature_C", "size")]
    assert trends[0].correlation == pytest.approx(1.0)
    # 2 of 720 orders, times the number of trends tried
    assert trends[0].probability < 0.05


def test_four_runs_are_too_few_for_a_trend():
    records = [start_up(r, lambda t, g, rng, r=r: 0.1 * r + 0.0 * t) for r in RATES[:4]]
    assert read_residual(records).trends == ()


@pytest.mark.parametrize(
    ("part", "residual", "size"),
    [
        ("elastic", lambda p: 0.1 * np.sin(p), 0.1),
        ("viscous", lambda p: -0.1 * np.cos(p), -0.1),
        ("odd", lambda p: 0.1 * np.sin(3 * p + 0.3), 0.1),
        ("even", lambda p: 0.1 * np.cos(2 * p + 1.0), 0.1),
    ],
)
def test_an_oscillating_residual_is_taken_apart(part, residual, size):
    wave = read_wave(oscillating(residual))
    assert wave is not None
    assert wave.frequency == pytest.approx(0.7, rel=1e-4)
    parts = {name: getattr(wave, name) for name in ("elastic", "viscous", "odd", "even")}
    # the fundamental of the stress is √5; the search for the frequency is good to 1e-4
    assert parts.pop(part) == pytest.approx(size / np.sqrt(5.0), rel=1e-2)
    assert max(map(abs, parts.values())) < 2e-3


def test_noise_in_an_oscillation_is_of_no_kind():
    spoke = [
        read_residual([oscillating(lambda p: 0.0 * p, noise=0.1, seed=seed)]).sentences
        for seed in range(40)
    ]
    # four times what noise puts into two harmonics on average
    assert not any(spoke)
    seen = read_residual([oscillating(lambda p: 0.1 * np.sin(3 * p), noise=0.1)])
    assert "odd harmonics" in seen.sentences[0]


def test_a_drift_is_no_harmonic():
    wave = read_wave(oscillating(lambda p: 0.2 * p / p[-1]))
    assert wave is not None
    # the second half of the run sees half of the drift
    assert wave.drift == pytest.approx(0.1 / np.sqrt(5.0), rel=0.02)
    assert max(abs(wave.elastic), abs(wave.viscous), wave.odd, wave.even) < 2e-3


@pytest.mark.parametrize("rate", [0.5, 2.0])
def test_a_start_up_does_not_oscillate(rate):
    record = start_up(rate, lambda t, g, rng: 0.0 * t)
    assert oscillation(record) is None
    assert read_wave(record) is None


def test_steps_up_and_down_do_not_oscillate():
    record = oscillating(lambda p: 0.0 * p)
    noisy = record.rate + np.random.default_rng(0).normal(size=record.time.size)
    assert oscillation(RunRecord(**{**vars(record), "rate": noisy})) is None


def test_a_perfect_prediction_has_no_reading():
    reading = read_residual([start_up(rate, lambda t, g, rng: 0.0 * t) for rate in RATES])
    assert reading.sentences == []
