"""Steps in time: their order and accuracy; noise of synthetic data; harmonics of two laws."""

import independent
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import jv

from discover import protocols
from discover.errors import InputError
from discover.forward import make_batch
from discover.forward.exponential_weights import phi_functions
from discover.forward.grid import STRAIN_STEP, make_grid
from discover.forward.of_fluids import bare_run, observed, observed_in
from discover.laws import Fluid, Giesekus, UpperConvectedMaxwell, make_law
from discover.protocols import oscillatory_shear
from discover.report.plots.comparison import third_harmonic
from discover.simulate import simulate, synthetic_dataset

EXPONENTIAL = make_law("ptt_exponential", {"epsilon": 0.4})


def by_scipy(law, flow, times):
    """Return σ12, N1 and N2, to 1e-9."""
    found = law.respond(flow, times)
    return np.stack([found.sigma12, found.N1, found.N2], axis=-1)


def test_the_exponential_method_converges_at_fourth_order():
    fluid = Fluid.dimensionless(EXPONENTIAL)
    protocol, times = protocols.oscillatory_shear(2.0, 1.0), np.linspace(0, 6, 7)
    law = independent.PhanThienTanner(0.4, "exponential")
    reference = by_scipy(law, independent.oscillation(2.0, 1.0), times)
    errors = []
    for step in (0.1, 0.05, 0.025):
        found = observed_in(fluid, protocol, times, np.inf, phase=np.inf, longest=step)
        errors.append(np.abs(found - reference).max())
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert np.all(orders > 3.7), f"observed orders {orders}"
    assert np.all(orders < 4.6), f"observed orders {orders}"


@pytest.mark.parametrize(
    ("law", "same"),
    [
        pytest.param(Giesekus(0.8), independent.Giesekus(0.8), marks=pytest.mark.slow),
        (EXPONENTIAL, independent.PhanThienTanner(0.4, "exponential")),
    ],
)
def test_default_grids_are_accurate_to_1e_6_on_all_flows_of_the_paper(law, same):
    fluid, times = Fluid.dimensionless(law), np.linspace(0, 20, 41)
    flows = protocols.paper_training_protocols() | protocols.paper_test_protocols()
    batch = make_batch([bare_run(flow, times) for flow in flows.values()], STRAIN_STEP)
    for found, (name, flow) in zip(observed([fluid], batch)[0], flows.items(), strict=True):
        kind, *numbers = name.split("_")
        written = independent.oscillation if kind == "laos" else independent.start_up
        exact = by_scipy(same, written(*map(float, numbers)), times)
        assert np.max(np.abs(found - exact)) < 5e-6 * np.abs(exact).max()
        told = simulate(fluid, flow, times)
        np.testing.assert_allclose(told.shear_stress, exact[:, 0], atol=1e-7 * np.abs(exact).max())


def test_phi_functions_match_their_integrals():
    from scipy.integrate import quad

    for z in (-50.0, -3.0, -1.0001, -0.9999, -0.3, 0.0, 0.4):
        for k, value in enumerate(phi_functions(jnp.array(z)), start=1):
            factorial = [1, 1, 2][k - 1]
            integrand = lambda x, z=z, k=k: np.exp((1 - x) * z) * x ** (k - 1)  # noqa: E731
            exact, _ = quad(integrand, 0, 1, epsabs=1e-14)
            # the recurrence divides a difference of order one by z up to twice
            assert float(value) == pytest.approx(exact / factorial, rel=1e-12)


def test_a_cessation_is_not_smeared_a_law_may_run_away_and_an_absurd_run_is_refused():
    flow, times = protocols.step_rates([0.0, 2.03], [1.5, 0.0]), np.array([0.0, 1.0, 2.03, 3.0])
    fluid = Fluid.dimensionless(UpperConvectedMaxwell())
    expected = 1.5 * (1 - np.exp(-np.minimum(times, 2.03))) * np.exp(-np.maximum(times - 2.03, 0))
    found = observed_in(fluid, flow, times)[:, 0], simulate(fluid, flow, times).shear_stress
    np.testing.assert_allclose(found, [expected, expected], atol=1e-6)
    bad = Fluid.dimensionless(Giesekus(-5.0))
    assert not np.all(np.isfinite(observed_in(bad, protocols.start_up(5.0), np.linspace(0, 20, 5))))
    with pytest.raises(InputError, match="units of time"):
        make_grid(protocols.start_up(1e6), np.array([0.0, 1e6]))


def test_synthetic_noise_has_the_size_asked_for_and_the_seed_decides_it():
    def noisy(seed):
        return synthetic_dataset("giesekus", {"alpha": 0.2}, noise=0.02, seed=seed, n_samples=2001)

    one, two, other = map(noisy, (3, 3, 4))
    for run in one:
        exact = one.exact[run.name].shear_stress
        ratio = np.std(run.stress - exact) / np.sqrt(np.mean(exact**2))
        assert ratio == pytest.approx(0.02, rel=0.08)  # five times 1/sqrt(2 n)
        np.testing.assert_array_equal(run.stress, two[run.name].stress)
    assert not np.array_equal(one.runs[0].stress, other.runs[0].stress)


DEBORAH = 50.0


def late_third_harmonic(law, strain):
    """I₃/I₁ in one cycle after ten relaxation times."""
    period = 2.0 * np.pi / DEBORAH
    start = np.ceil(10.0 / period) * period
    times = np.concatenate([[0.0], start + period * np.arange(65) / 64.0])
    stress = simulate(Fluid(law, 1.0, 1.0), oscillatory_shear(strain * DEBORAH, DEBORAH), times)
    return third_harmonic(stress.shear_stress[1:])


@pytest.mark.parametrize("strain", [1.0, 3.0, 6.0])
def test_johnson_segalman_is_no_ellipse_at_large_strain(strain):
    """σ12 = G sin(aγ)/a, a² = ξ(2 − ξ), has harmonics J₁(aγ₀), J₃(aγ₀)."""
    limit = 0.8 * strain
    wanted = abs(jv(3, limit) / jv(1, limit))
    found = late_third_harmonic(make_law("johnson_segalman", {"xi": 0.4}), strain)
    assert found == pytest.approx(wanted, rel=0.02)


def test_giesekus_is_an_ellipse_at_any_strain():
    # scipy alone gives 0.7 % at a strain of 6 and De = 50
    assert late_third_harmonic(make_law("giesekus", {"alpha": 0.2}), 6.0) < 0.01
