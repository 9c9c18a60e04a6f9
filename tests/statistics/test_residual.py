"""What a fit leaves: its size, its smooth part, and that of short runs."""

import numpy as np
import pytest
from independent import Giesekus, Modes, UpperConvectedMaxwell, oscillation, start_up
from independent.noise import correlated, proportional, rms, white

from discover.statistics import lack_of_fit
from discover.statistics.noise.smooth_misfit import smooth_misfit_probability
from discover.statistics.noise.whiteness import SIGNIFICANCE, noise_probability
from discover.statistics.residual import Expectation, fast_part, noise_floor

RUNS, SAMPLES = 6, 60
PHASE = np.linspace(0.0, 6.0, SAMPLES)


def probability_of(rows):
    return noise_probability(rows)


def is_noise(rows):
    return probability_of(rows) > SIGNIFICANCE


def explained(rows, **budget):
    """Return whether a complete model may leave rows."""
    budget, probability = Expectation(**budget), probability_of(rows)
    noise = noise_floor(rows, probability) if budget.noise is None else budget.noise
    return budget.explains(rows, probability, noise)


def floor_of(rows):
    return noise_floor(rows, probability_of(rows))


def noise(correlation=0.0, seed=0, size=0.01):
    lot, still = np.random.default_rng(seed), np.ones(SAMPLES)
    return [correlated(still, size, correlation, lot) - still for _ in range(RUNS)]


@pytest.mark.parametrize("correlation", [0.0, 0.6])
@pytest.mark.parametrize(
    "pattern",
    [np.sin(PHASE), np.sin(12 * PHASE), np.sign(np.cos(3 * PHASE)), np.exp(-PHASE)],
    ids=["smooth", "hum", "friction", "decay"],
)
def test_a_pattern_three_times_the_noise_is_structure(pattern, correlation):
    pattern = 0.03 * pattern / np.sqrt(np.mean(pattern**2))
    missed = [is_noise([r + pattern for r in noise(correlation, seed)]) for seed in range(20)]
    assert sum(missed) == 0


def test_runs_of_a_few_samples_say_nothing():
    assert probability_of(np.ones((3, 7))) is None


@pytest.mark.parametrize("correlation", [0.0, 0.6])
def test_the_floor_is_the_size_of_the_noise_correlated_or_not(correlation):
    # 360 samples, of which the correlation leaves 90: 7 % standard error
    assert floor_of(noise(correlation)) == pytest.approx(0.01, rel=0.2)


def test_what_a_model_may_leave_is_noise_and_the_error_of_the_linear_data():
    smooth = 0.02 * np.sin(PHASE)
    left = [row + smooth for row in noise()]
    assert not explained(left)
    assert explained(left, linear_error=0.02)
    # an error of the linear data that is far smaller does not excuse it
    assert not explained(left, linear_error=0.002)
    # nor does a noise that is given, unless it is as large as the whole
    assert explained(left, noise=0.02)
    assert not explained(left, noise=0.015)
    assert not explained(left, noise=0.005)


def test_what_repeated_runs_differ_by_may_have_a_pattern_of_its_size_and_no_more():
    smooth = 0.02 * np.sin(PHASE)
    left = [row + smooth for row in noise()]  # the pattern is 1.4 %, the noise 1 %
    assert explained(left, repeat_error=0.02)
    assert not explained(left, repeat_error=0.01)
    # what is left may be as large as before, and no pattern beyond it
    assert not explained([row + 3.0 * smooth for row in noise()], repeat_error=0.02)


def with_a_short_run(samples, miss):
    """Return what is said of noise of two long runs and a shorter one that is missed by so much."""
    rows = [*noise()[:2], np.full(samples, miss)]
    return lack_of_fit(rows, [np.ones(len(row)) for row in rows])


@pytest.mark.parametrize("samples", [1, 3, 6])
def test_a_run_of_a_few_samples_decides_nothing_beside_longer_ones(samples):
    left = with_a_short_run(samples, 0.3)
    assert left.noise == pytest.approx(0.01, rel=0.2)
    assert left.verdict == "explained"


def test_the_size_of_a_run_too_short_to_be_tested_is_no_sign_of_noise():
    left = with_a_short_run(15, 0.3)
    assert left.noise == pytest.approx(0.01, rel=0.2)
    assert left.verdict == "unexplained"
    assert with_a_short_run(15, 0.01).verdict == "explained"


@pytest.mark.parametrize(("samples", "verdict"), [(6, "unexplained"), (7, "explained")])
def test_runs_that_are_all_of_a_few_samples_do_not_say_how_noisy_they_are(samples, verdict):
    assert (
        lack_of_fit([0.01 * (-1.0) ** np.arange(samples)] * 3, [np.ones(samples)] * 3).verdict
        == verdict
    )


def test_the_noise_of_a_smooth_misfit_is_not_its_size():
    noise = 0.01 * np.random.default_rng(0).standard_normal(400)
    trend = 0.2 * np.sin(np.linspace(0, 6, 400))
    assert fast_part(noise) == pytest.approx(0.01, rel=0.2)
    assert fast_part(noise + trend) == pytest.approx(0.01, rel=0.2)


TIMES = np.linspace(0.33, 5.0, 15)


def noise_short(generator, runs=6, samples=15):
    return 0.01 * generator.standard_normal((runs, samples))


def structured(rows):
    probability = probability_of(rows)
    assert probability is not None
    return probability <= 0.01


def test_plain_noise_of_short_runs_is_taken_for_structure_as_seldom_as_the_level_says():
    taken = sum(structured(noise_short(np.random.default_rng(seed))) for seed in range(300))
    # 1 % of 300, within three standard deviations of a binomial count
    assert taken <= 3 + 3 * np.sqrt(300 * 0.01 * 0.99)


def test_six_runs_of_fifteen_samples_show_a_misfit_as_large_as_their_noise():
    # start-ups of Maxwell fluids of the same viscosity, one 2 times as slow
    misfit = np.exp(-TIMES / 2.0) - np.exp(-TIMES)
    misfit *= 0.01 / np.sqrt(np.mean(misfit**2))
    records = [-np.expm1(-TIMES)] * 6
    found = [
        lack_of_fit(list(noise_short(np.random.default_rng(seed)) + misfit), records).verdict
        for seed in range(20)
    ]
    # a misfit that is seen nine times in ten is missed more than five times of 20 once in 10,000
    assert found.count("unexplained") >= 15


def test_what_short_runs_cannot_tell_is_said():
    # no larger than a pattern of noise may be, and yet a pattern
    bent = 0.008 * np.cos(np.linspace(0.0, np.pi, 15))
    residuals = list(bent + noise_short(np.random.default_rng(1)))
    assert "do not tell correlated noise" in lack_of_fit(residuals, [np.ones(15)] * 6).reason
    # changes from sample to sample, as noise does
    few = lack_of_fit([0.01 * (-1.0) ** np.arange(8)] * 2, [np.ones(8)] * 2)
    assert few.probability is None
    assert "too few samples" in few.reason
    # 8 samples of plain noise look like more than noise one time in five
    row = noise_short(np.random.default_rng(0), 1, 8)[0] + np.linspace(-0.1, 0.1, 8)
    open_ = lack_of_fit([row], [np.ones(8)])
    assert open_.verdict == "unexplained"
    assert "hardly tell" in open_.reason
    assert "hardly tell" not in lack_of_fit([row] * 3, [np.ones(8)] * 3).reason


def test_longer_runs_tell_short_ones_how_correlated_their_noise_is():
    def correlated(n, generator):
        drawn = generator.standard_normal(n)
        for i in range(1, n):
            drawn[i] = 0.7 * drawn[i - 1] + np.sqrt(0.51) * drawn[i]
        return drawn

    alone, together = 0, 0
    for seed in range(20):
        generator = np.random.default_rng(seed)
        long = correlated(200, generator)
        short = [correlated(15, generator) for _ in range(6)]
        alone += structured(short)
        together += structured([long, *short])
    assert alone >= 18
    # 1 % of 20: more than 3 has a probability below 1e-4
    assert together <= 3


def test_the_noise_of_short_runs_is_their_size_where_nothing_speaks_against_it():
    # 90 samples: 7 % standard error
    assert floor_of(noise_short(np.random.default_rng(1))) == pytest.approx(0.01, rel=0.2)


GROWTH, WAVE = np.geomspace(0.05, 10.0, 60), np.linspace(0.0, 12.0, 121)
FLOWS = [(start_up(0.5), GROWTH), (start_up(2.0), GROWTH), (oscillation(2.0, 1.0), WAVE)]
TWO = Modes(Giesekus(0.1, 80.0, 1.0), Giesekus(0.7, 60.0, 0.1))
NEAR = Modes(Giesekus(0.1, 80.0, 1.0), UpperConvectedMaxwell(54.0, 0.1))


@pytest.fixture(scope="module")
def stresses():
    """σ12 of a fluid of two modes, and of one that is nearly it."""
    return [[material.respond(*flow).sigma12 for flow in FLOWS] for material in (TWO, NEAR)]


def said(exact, predicted, noise, seed):
    generator = np.random.default_rng(seed)
    records = [noise(row, generator) for row in exact]
    residuals = [row - record for row, record in zip(predicted, records, strict=True)]
    return lack_of_fit(residuals, records).verdict


NOISES = {
    "white": lambda row, generator: white(row, 0.01, generator),
    "slow": lambda row, generator: correlated(row, 0.03, 0.9, generator),
    "less slow": lambda row, generator: correlated(row, 0.03, 0.6, generator),
    "proportional": lambda row, generator: proportional(row, 0.05, generator),
}


@pytest.mark.slow
def test_a_smooth_misfit_larger_than_the_noise_is_no_slow_noise(stresses):
    exact, near = stresses
    # two to three times the noise: so much correlated noise would explain, were it not for its form
    misses = [rms(one - other) / rms(one) for one, other in zip(exact, near, strict=True)]
    assert 0.008 < np.mean(misses) < 0.04
    verdicts = [said(exact, near, NOISES["white"], seed) for seed in range(20)]
    assert verdicts.count("unexplained") >= 18


@pytest.mark.parametrize("noise", NOISES.values(), ids=NOISES)
def test_the_law_that_made_the_data_leaves_noise(stresses, noise):
    verdicts = [said(stresses[0], stresses[0], noise, seed) for seed in range(20)]
    # significance 0.01: more than 2 of 20 has a probability of 0.001
    assert verdicts.count("explained") >= 18


LOUD = 1.0 + 15.0 * np.exp(-WAVE)


@pytest.mark.parametrize("rho", [0.0, 0.6, 0.9])
@pytest.mark.parametrize("size", [np.ones(121), LOUD], ids=["even", "loud start"])
def test_the_probability_is_one_whatever_the_noise(rho, size):
    drawn = []
    for seed in range(60):
        generator = np.random.default_rng(seed)
        rows = [size * correlated(np.ones(121), 1.0, rho, generator) for _ in range(3)]
        drawn.append(smooth_misfit_probability([row - size for row in rows]))
    # 5 % of 60 is 3, and more than 9 has a probability of 0.1 %
    assert np.count_nonzero(np.array(drawn) < 0.05) <= 9
    assert np.count_nonzero(np.array(drawn) < 0.001) <= 1
