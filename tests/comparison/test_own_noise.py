"""Normal stresses noisier than the shear stress, fitted beside it: each weighs by its own noise."""

import numpy as np
import pytest
from independent import Giesekus, Structured, start_up

import discover as dc
from discover.comparison import own_noise

pytestmark = pytest.mark.usefixtures("verdict_alone")

MOBILITY, MODULUS, TIME = 0.3, 100.0, 1.0
TIMES = np.linspace(0.1, 8.0, 60)
RATES = (0.5, 2.0, 5.0)
NOISES = {"sigma12": 0.002, "N1": 0.05}
"""Relative noise: a transducer of torque, and one of thrust."""


def start_ups(material) -> dc.Dataset:
    """Return start-ups by scipy with σ12 and N1, each with its noise."""
    rng, runs = np.random.default_rng(3), []
    for rate in RATES:
        exact = material.respond(start_up(rate), TIMES)
        sigma12, n1 = (
            values + noise * np.sqrt(np.mean(values**2)) * rng.standard_normal(len(TIMES))
            for values, noise in ((exact.sigma12, NOISES["sigma12"]), (exact.N1, NOISES["N1"]))
        )
        runs.append(
            dc.Run(
                f"{rate:g}.csv", TIMES, dc.start_up(rate), 0 * TIMES + rate, sigma12,
                first_normal_stress_difference=n1,
            )
        )  # fmt: skip
    return dc.Dataset("noisy N1", tuple(runs))


def found_in(material, of=lambda data: data):
    """Return what a comparison finds where both are fitted."""
    return dc.compare(
        of(start_ups(material)),
        dc.Fluid(dc.make_law("ucm"), MODULUS, TIME),
        learners=["tensor_sindy"],
        library={"degree": 0},
        max_terms=2,
        use_normal_stresses=True,
    )


def deviation() -> float:
    """Return the least standard deviation of α that any unbiased fit has, by scipy's derivative."""
    step, information = 0.01, 0.0
    for rate in RATES:
        low, own, high = (
            Giesekus(MOBILITY + d, MODULUS, TIME).respond(start_up(rate), TIMES)
            for d in (-step, 0.0, step)
        )
        for quantity, noise in NOISES.items():
            size = np.sqrt(np.mean(getattr(own, quantity) ** 2))
            slope = (getattr(high, quantity) - getattr(low, quantity)) / (2.0 * step) / size
            information += float(slope @ slope) / noise**2
    return 1.0 / np.sqrt(information)


def width_of_the_mobility(found) -> float:
    """Return the width of its interval, which has to hold it, or nearly: one in twenty does not."""
    (term,) = found.outcomes["tensor_sindy"].terms
    assert term.term == "sigma.sigma"
    low, high = term.ci95
    assert abs(MOBILITY - 0.5 * (low + high)) < high - low
    return high - low


@pytest.mark.slow
def test_a_noisy_n1_beside_a_quiet_stress_takes_nothing_from_what_the_stress_tells():
    found = found_in(Giesekus(MOBILITY, MODULUS, TIME))
    assert found.explanation.verdict == "explained"
    # 95 % of a normal distribution is 3.9 deviations wide; the noise is estimated, and not exactly
    assert width_of_the_mobility(found) < 6.0 * deviation()


@pytest.mark.slow
def test_with_equal_weights_the_noise_of_n1_leaves_a_pattern_in_the_stress(monkeypatch):
    monkeypatch.setattr(own_noise, "weights_by_noise", lambda *_: None)
    found = found_in(Giesekus(MOBILITY, MODULUS, TIME))
    assert found.explanation.verdict == "unexplained"
    assert width_of_the_mobility(found) > 6.0 * deviation()


@pytest.mark.slow
@pytest.mark.usefixtures("as_users_run_it")
def test_a_fluid_of_another_kind_stays_unexplained_beside_a_noisy_n1():
    found = found_in(Structured(2.0, (2.0,), in_modulus=True, modulus=MODULUS, mobility=0.0))
    assert found.explanation.verdict == "unexplained"


def test_normal_stresses_that_are_records_of_their_own_are_not_fitted_once_more():
    with pytest.raises(dc.InputError, match="would fit once more"):
        found_in(Giesekus(MOBILITY, MODULUS, TIME), dc.Dataset.quantity_by_quantity)
