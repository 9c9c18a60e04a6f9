"""Bands allow for constants of the declared model that were fitted, as a fit by scipy says."""

from dataclasses import replace

import numpy as np
import pytest
from discover.comparison.judging.bands.constants_in_bands import (
    law_with_fitted,
    with_fitted_constants,
)
from discover.comparison.outcomes.flows import run_flow
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.identify.rivals.bands import PredictionBand
from scipy.optimize import curve_fit

import discover as dc
from discover.learners import RecoveredTerm
from discover.study.data import StudyData
from discover.study.in_memory import declared_fluid

TIMES = np.linspace(0.05, 6.0, 80)
RATES = (0.5, 2.0)
BOTH = ("modulus_Pa", "relaxation_time_s")


def shear(modulus, time, rate):
    """Return σ12 of a Maxwell fluid in start-up, in closed form."""
    return modulus * time * rate * -np.expm1(-TIMES / time)


def first_difference(modulus, time, rate):
    """Return its N1   [Bird, Armstrong & Hassager 1987, table 7.3-1]."""
    x = TIMES / time
    return 2 * modulus * (time * rate) ** 2 * (1 - np.exp(-x) * (1 + x))


@pytest.fixture(scope="module")
def maxwell():
    """Two start-ups with 1 % noise, and modulus, time and their covariance as scipy fits them."""
    stresses = [shear(100.0, 1.0, rate) for rate in RATES]
    sizes = [0.01 * np.sqrt(np.mean(stress**2)) for stress in stresses]
    lot = np.random.default_rng(5)
    noisy = [s + size * lot.normal(size=80) for s, size in zip(stresses, sizes, strict=True)]

    def both(_, modulus, time):
        return np.concatenate([shear(modulus, time, rate) for rate in RATES])

    values, covariance = curve_fit(
        both, None, np.concatenate(noisy), (90.0, 1.1), np.repeat(sizes, 80)
    )
    runs = [
        dc.Run(f"at_{rate:g}", TIMES, dc.start_up(rate), np.full(80, rate), stress)
        for rate, stress in zip(RATES, noisy, strict=True)
    ]
    return dc.Dataset("maxwell", tuple(runs)), values, covariance


def bands(maxwell, names, terms=()):
    data, (modulus, time), _ = maxwell
    declared = declared_fluid(dc.Fluid(dc.make_law("ucm"), modulus, time), data)
    divided = StudyData(data, data, data.select([]))
    flows = [run_flow(run, "training", divided) for run in data]
    found = LearnerOutcome("tensor_sindy", terms, 0.0, (np.zeros(0), np.zeros(0)))
    made = {}
    for flow, rate in zip(flows, RATES, strict=True):
        columns = [shear(modulus, time, rate), first_difference(modulus, time, rate)]
        chosen = np.stack([*columns, np.zeros(80)], axis=-1)
        made[flow.key] = PredictionBand(TIMES, *[chosen] * 5, runaways=0.0)
    return made, with_fitted_constants(made, law_with_fitted(found, declared, names), flows)


def test_a_law_without_terms_has_the_band_of_its_fitted_modulus_and_time(maxwell):
    _, (modulus, time), covariance = maxwell
    _, wider = bands(maxwell, BOTH)
    for (_, band), rate in zip(wider.items(), RATES, strict=True):
        for column, of in enumerate((shear, first_difference)):
            slopes = [
                (of(modulus * 1.001, time, rate) - of(modulus, time, rate)) / (0.001 * modulus),
                (of(modulus, time * 1.001, rate) - of(modulus, time, rate)) / (0.001 * time),
            ]
            half = 1.96 * np.sqrt(np.einsum("in,ij,jn->n", slopes, covariance, slopes))
            own = 0.5 * (band.high - band.low)[:, column]
            # the noise of 160 samples is known to 6 %, and a first-order correlation is looked for
            assert own == pytest.approx(half, rel=0.4)
            # one truth in twenty lies outside a band of 95 %, and hardly any outside two of them
            assert np.all(np.abs(of(100.0, 1.0, rate) - band.chosen[:, column]) <= 2 * own)
        assert band.directions is not None
    assert all(np.any(band.rivals_high > band.rivals_low) for band in wider.values())


def test_of_constants_that_were_given_no_band_is_wider(maxwell):
    made, wider = bands(maxwell, ())
    assert all(wider[key] is made[key] for key in made)


def test_a_term_that_does_what_a_constant_does_makes_the_band_no_narrower(maxwell):
    alone = bands(maxwell, ("modulus_Pa",))[1]
    term = RecoveredTerm("sigma.sigma", 0.0, ci95=(-0.01, 0.01), coefficient_penalised=0.0)
    beside = bands(maxwell, ("modulus_Pa",), (term,))[1]
    for key, band in alone.items():
        assert np.all(beside[key].high >= band.high - 1e-9 * np.abs(band.high))


def test_no_band_stays_no_band(maxwell):
    made, wider = bands(maxwell, BOTH)
    key = next(iter(made))
    assert np.all(np.isfinite(wider[key].high))
    nothing = replace(made[key], low=made[key].low * np.nan, high=made[key].high * np.nan)
    data, (modulus, time), _ = maxwell
    declared = declared_fluid(dc.Fluid(dc.make_law("ucm"), modulus, time), data)
    flows = [run_flow(run, "training", StudyData(data, data, data.select([]))) for run in data]
    found = LearnerOutcome("tensor_sindy", (), 0.0, (np.zeros(0), np.zeros(0)))
    kept = with_fitted_constants({key: nothing}, law_with_fitted(found, declared, BOTH), flows)
    assert not np.any(np.isfinite(kept[key].high))
