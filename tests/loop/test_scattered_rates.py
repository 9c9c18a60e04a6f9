"""Rates with noise: of the reading, or of the motor, which the fluid feels; records by scipy."""

import numpy as np
import pytest
from independent import Giesekus, oscillation, start_up
from independent.flow import Flow

from discover.dataset import Run
from discover.effects import simplest_terms
from discover.forward import DeclaredModel
from discover.laws.registry import make_law
from discover.loop import measured_rates
from discover.loop.measured_rates import smoothed, unfelt_scatter
from discover.protocols import sampled_rate
from discover.protocols import start_up as commanded

FLUID = Giesekus(0.3, 100.0)
DECLARED = DeclaredModel(make_law("ucm"), np.array([100.0]), np.array([1.0]))
TIMES = np.linspace(0.1, 8.0, 80)
FLOWS = {"slow.csv": start_up(0.5), "fast.csv": start_up(2.0), "wave.csv": oscillation(2.0, 1.0)}


def through(rates):
    """Return the flow at straight lines between samples of the rate, the first one before them."""
    times, values = np.append(0.0, TIMES), np.append(rates[0], rates)
    steps = 0.5 * (values[1:] + values[:-1]) * np.diff(times)
    strains = np.append(0.0, np.cumsum(steps))
    return Flow(
        lambda t: np.interp(t, times, values), lambda t: np.interp(t, times, strains),
        tuple(TIMES[:-1]),
    )  # fmt: skip


def runs_of(scatter, felt, seed):
    lot, runs = np.random.default_rng(seed), []
    for name, flow in FLOWS.items():
        true = np.asarray(flow.rate(TIMES), float) + 0.0 * TIMES
        size = np.sqrt(np.mean(true**2))
        rates = true + scatter * size * lot.standard_normal(len(true))
        stress = FLUID.respond(through(rates) if felt else flow, TIMES).sigma12
        noise = 0.005 * np.sqrt(np.mean(stress**2)) * lot.standard_normal(len(stress))
        runs.append(Run(name, TIMES, sampled_rate(TIMES, rates), rates, stress + noise))
    return runs


# a law of these terms is as flexible as three flows ask; all sixteen are tried in the slow cases
FEW = ("gammadot", "sigma.sigma", "tr(sigma)*sigma", "sigma.gammadot+gammadot.sigma")


@pytest.mark.parametrize(
    ("seed", "some"), [(0, True), *(pytest.param(n, False, marks=pytest.mark.slow) for n in (0, 1))]
)
def test_noise_of_the_reading_is_told_from_that_of_the_motor(seed, some, monkeypatch):
    if some:
        terms = [term for term in simplest_terms() if term.name in FEW]
        assert len(terms) == len(FEW)
        monkeypatch.setattr(measured_rates, "simplest_terms", lambda: terms)
    said = unfelt_scatter(DECLARED, runs_of(0.03, False, seed))
    assert "scatter by 3" in said or "scatter by 2" in said
    assert unfelt_scatter(DECLARED, runs_of(0.03, True, seed)) == ""


def test_the_rate_in_the_midst_is_nearer_than_the_samples():
    for run in runs_of(0.03, False, 2):
        true = np.asarray(FLOWS[run.name].rate(TIMES), float) + 0.0 * TIMES
        before, after = (np.sqrt(np.mean((one.rate - true) ** 2)) for one in (run, smoothed(run)))
        # of 80 samples one constant is known to a ninth of the scatter, three to a fifth
        assert after < 0.3 * before


def test_a_rate_that_was_commanded_or_hardly_scatters_stays_as_it_is():
    run = runs_of(0.0, False, 0)[0]
    told = Run(run.name, TIMES, commanded(0.5), run.rate, run.stress)
    assert smoothed(told) is told
    for quiet in runs_of(0.002, False, 0):
        assert smoothed(quiet) is quiet
    assert unfelt_scatter(DECLARED, [told, *runs_of(0.002, False, 0)]) == ""


def test_a_rate_that_drifts_is_no_scatter_about_a_constant():
    run = runs_of(0.01, False, 0)[1]
    rates = run.rate * (1.0 + 0.03 * TIMES)
    drifting = Run("drifts", TIMES, sampled_rate(TIMES, rates), rates, run.stress)
    assert smoothed(drifting) is drifting
