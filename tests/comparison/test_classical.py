"""The classical laws, fitted to what scipy integrated."""

from dataclasses import replace

import numpy as np
import pytest
from discover.comparison.classical import CLASSICAL, fit_classical_laws
from discover.comparison.flows import Flow
from scipy.integrate import solve_ivp

from discover.laws.textbook.maxwell import UpperConvectedMaxwell
from discover.protocols.protocol import oscillatory_shear, start_up
from discover.study.declared_model import DeclaredModel

MODULUS, RELAXATION_TIME = 100.0, 2.0


def giesekus(shear_rate, times, alpha):
    """Return σ12, N1 and N2 in Pa of one Giesekus mode, by scipy alone."""

    def slope(t, s):
        rate = RELAXATION_TIME * shear_rate(t)
        gradient = np.zeros((3, 3))
        gradient[0, 1] = rate
        stress = np.array([[s[0], s[3], 0.0], [s[3], s[1], 0.0], [0.0, 0.0, s[2]]])
        change = gradient + gradient.T + gradient @ stress + stress @ gradient.T - stress
        change = (change - alpha * stress @ stress) / RELAXATION_TIME
        return [change[0, 0], change[1, 1], change[2, 2], change[0, 1]]

    s = MODULUS * solve_ivp(slope, (0, times[-1]), np.zeros(4), "LSODA", times, rtol=1e-9).y
    return {"sigma12": s[3], "N1": s[0] - s[1], "N2": s[1] - s[2]}


def flow(name, kind, protocol, shear_rate, alpha, noise=0.0):
    times = np.linspace(0.0, 20.0, 81)
    truth = giesekus(shear_rate, times, alpha)
    scatter = np.random.default_rng(len(name)).normal(size=81)
    measured = truth["sigma12"] * (1.0 + noise * scatter) if kind == "training" else None
    rates = np.array([shear_rate(t) for t in times])
    return Flow(name, kind, protocol, times, rates, truth, measured)


@pytest.fixture(scope="module")
def fits():
    model = DeclaredModel(
        law=UpperConvectedMaxwell(),
        law_name="ucm",
        parameters={},
        modulus=np.array([MODULUS]),
        relaxation_time=np.array([RELAXATION_TIME]),
        free=(),
        spectrum=None,
    )
    slow, fast = oscillatory_shear(0.5, 0.25), oscillatory_shear(1.0, 0.5)

    def found(noise, independent=None):
        flows = [
            flow("slow", "training", slow, lambda t: 0.5 * np.cos(0.25 * t), 0.3, noise),
            flow("fast", "training", fast, lambda t: np.cos(0.5 * t), 0.3, noise),
            flow("start-up", "held_out", start_up(1.5), lambda t: 1.5, 0.3),
        ]
        fits = fit_classical_laws(model, flows, independent=independent)
        return {fit.law: fit for fit in fits}

    return {"noisy": found(0.01), "exact": found(0.0), "few": found(0.01, 16.0)}


def test_the_law_that_made_the_data_is_found_with_its_constant(fits):
    fits = fits["noisy"]
    assert list(fits) == list(CLASSICAL)
    best = min(fits.values(), key=lambda fit: fit.criterion)
    assert best.law == "giesekus"
    # 1 % noise on 162 samples; the constant shifts the stress by some 0.5 of itself
    assert best.parameters["alpha"] == pytest.approx(0.3, rel=0.02)
    assert best.errors["start-up"]["N2"] < 0.02


def test_every_other_law_fits_worse_and_says_so(fits):
    fits = fits["noisy"]
    others = [fit for fit in fits.values() if fit.law != "giesekus"]
    assert all(fit.misfit > 3.0 * fits["giesekus"].misfit for fit in others)
    assert all(fit.criterion > fits["giesekus"].criterion + 10.0 for fit in others)


def test_the_criterion_counts_the_independent_samples_that_it_is_told(fits):
    few, all_of_them = fits["few"]["ucm"], fits["noisy"]["ucm"]
    assert few.misfit == all_of_them.misfit
    # a law without a constant pays for nothing but its choice, 0 of 5
    assert few.criterion == pytest.approx(2.0 * 16.0 * np.log(few.misfit))
    assert all_of_them.criterion == pytest.approx(2.0 * 162.0 * np.log(few.misfit))


def test_a_constant_lies_where_the_misfit_is_least_and_not_at_a_trial(fits):
    # any constant from the grid of trials misses exact data by more than the integration does
    exact = fits["exact"]["giesekus"]
    assert exact.parameters["alpha"] == pytest.approx(0.3, rel=1e-4)
    assert exact.misfit < 1e-4


def test_a_constant_at_the_end_of_its_range_is_said_to_be(fits):
    assert not fits["exact"]["giesekus"].at_bound
    assert replace(fits["exact"]["giesekus"], parameters={"alpha": 1.0}).to_json()["at_bound"]
