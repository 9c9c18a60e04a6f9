"""The pom-pom law, with its structure variable, against full tensors in scipy and closed forms."""

import jax.numpy as jnp
import numpy as np
import pytest
from independent import PomPom as Independent
from independent.homogeneous import UNIT
from independent.sweeps import modulus_of
from scipy.integrate import solve_ivp

import discover as dc
from discover.dataset.run import Run
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.laws import Fluid, make_law
from discover.laws.textbook.pom_pom import _FADES
from discover.loop.task import Task
from discover.protocols import in_flow, oscillations, start_up, steady_rates
from discover.simulate import simulate

ARMS, RATIO = 4.0, 0.3
CONSTANTS = {"q": ARMS, "stretch_time_ratio": RATIO}
TIMES = np.linspace(0.05, 4.0, 60)
both = pytest.mark.parametrize("name", ["pom_pom", "pom_pom_drag_strain"])


def independent(name, modulus=1.0, time=1.0):
    drag_strain = name == "pom_pom_drag_strain"
    return Independent(ARMS, RATIO * time, modulus, time, drag_strain, fade=_FADES)


def exact(name, gradient, times=TIMES, **mode):
    """Return σ in a start-up, (n, 3, 3): A and Λ apart, by Radau."""
    law = independent(name, **mode)
    options = {"rtol": 1e-9, "atol": 1e-11}
    found = solve_ivp(
        lambda t, y: law.change(y, gradient), (0, times[-1]), law.rest(), "Radau", times, **options
    )
    return np.array([law.stress(y, gradient) for y in found.y.T])


def of_records(name, run, modulus=(1.0,), relaxation_time=(1.0,)):
    declared = DeclaredModel.named(name, CONSTANTS, np.array(modulus), np.array(relaxation_time))
    model = AugmentedModel(declared, [])
    return [np.asarray(one) for one in model.predict(model.zero(), make_batch(run.records))]


def predicted(name, protocol, times, rate, modes=(), **columns):
    run = Run("run", times, protocol, rate, np.ones(len(times)), **columns)
    return of_records(name, run, *modes)[0]


@pytest.mark.parametrize(
    ("name", "kind", "rate"),
    [
        ("pom_pom", "shear", 5.0),
        pytest.param("pom_pom_drag_strain", "uniaxial", 1.5, marks=pytest.mark.slow),
        pytest.param("pom_pom_drag_strain", "shear", 5.0, marks=pytest.mark.slow),
        pytest.param("pom_pom", "uniaxial", 1.5, marks=pytest.mark.slow),
        pytest.param("pom_pom", "planar", 1.0, marks=pytest.mark.slow),
        pytest.param("pom_pom_drag_strain", "planar", 1.0, marks=pytest.mark.slow),
        pytest.param("pom_pom", "biaxial", 0.6, marks=pytest.mark.slow),
        pytest.param("pom_pom_drag_strain", "biaxial", 0.6, marks=pytest.mark.slow),
    ],
)
def test_two_modes_are_those_of_full_tensors_in_every_flow(name, kind, rate):
    modulus, times = (1000.0, 300.0), (0.01, 2.0)
    protocol = in_flow(start_up(rate), kind)
    found = predicted(name, protocol, TIMES, np.full(60, rate), (modulus, times))
    stress = sum(
        exact(name, rate * UNIT[kind], modulus=g, time=time)
        for g, time in zip(modulus, times, strict=True)
    )
    wanted = stress[:, 0, 1] if kind == "shear" else stress[:, 0, 0] - stress[:, 1, 1]
    # fixed steps of a fit; fading growth has kinks, at which one step's error is of second order
    np.testing.assert_allclose(found, wanted, atol=5e-4 * np.max(np.abs(wanted)))


@pytest.mark.parametrize(
    "name", ["pom_pom_drag_strain", pytest.param("pom_pom", marks=pytest.mark.slow)]
)
def test_steady_shear_is_the_closed_form_that_has_a_maximum(name):
    """A is upper-convected Maxwell's: A11 = 1 + 2 Wi², A12 = Wi; McLeish & Larson 1998, eq. 39."""
    # at the fastest the logarithm of tr A used to run away, and a stress of a wrong sign was steady
    rates = np.array([0.1, 0.5, 1.0, 2.0, 5.0, 20.0, 1e3, 1e4, 1e5])
    found = predicted(name, steady_rates(rates), np.arange(1.0, 10.0), rates)
    turned = rates / (3.0 + 2.0 * rates**2)
    np.testing.assert_allclose(found, 3.0 * _stretch(name, rates * turned) ** 2 * turned, rtol=1e-7)
    assert found[-1] < np.max(found)


@both
def test_steady_extension_hardens_to_the_square_of_the_arms(name):
    """Nothing changes at the closed form; that steady states are found: in shear, above."""
    law = make_law(name, CONSTANTS)
    for rate in (0.1, 0.3, 0.45, 20.0):
        along, across = 1.0 / (1.0 - 2.0 * rate), 1.0 / (1.0 + rate)
        turned = (along - across) / (along + 2.0 * across)
        if rate > 0.5:
            # chains are straight, and beyond (1 − 1/q)/θ stretched to their end
            along, across, turned = 1e9, 0.0, 1.0
        stretch = _stretch(name, np.array([rate * turned]))[0]
        shape = np.array([along, across, across, 0.0]) / (along + 2.0 * across)
        stress = 3.0 * stretch**2 * shape - np.array([1.0, 1.0, 1.0, 0.0])
        assert stress[0] - stress[1] == pytest.approx(3.0 * stretch**2 * turned)
        assert rate < 0.5 or stretch == pytest.approx(ARMS)
        state = np.append(stress, np.log((along + 2.0 * across) / 3.0))
        gradient = rate * np.array([1.0, -0.5, -0.5, 0.0])
        change = law.stress_rate(jnp.asarray(state), jnp.asarray(gradient))[:4]
        # sixty bisections, and a share of 1e-9 of A that is not yet straight
        np.testing.assert_allclose(change, 0.0, atol=1e-6 * rate * np.max(np.abs(stress)))


def _stretch(name, drawn):
    """Return the Λ at which (λ/λ_s) e^{ν(Λ−1)} (Λ − 1) = Λ L:S, at most q; bisected."""
    nu = 2.0 / (ARMS - 1.0) if name == "pom_pom_drag_strain" else 0.0
    low, high = np.ones_like(drawn), np.full_like(drawn, ARMS)
    for _ in range(60):
        middle = 0.5 * (low + high)
        grows = drawn > (1.0 - 1.0 / middle) * np.exp(nu * (middle - 1.0)) / RATIO
        low, high = np.where(grows, middle, low), np.where(grows, high, middle)
    return low


@pytest.mark.slow
def test_an_oscillation_gone_on_for_ever_is_one_that_was_waited_for():
    strain, frequency = 2.0, 1.0
    one = np.ones(1)
    run = Run(
        "sweep", one, oscillations([strain], [frequency]), strain * frequency * one, one,
        strain=strain * one, storage_modulus=one, loss_modulus=one,
    )  # fmt: skip
    found = of_records("pom_pom", run)
    modulus = modulus_of(independent("pom_pom"), strain, frequency, cycles=4)
    np.testing.assert_allclose(
        np.ravel(found), [modulus.real, modulus.imag], atol=1e-3 * abs(modulus)
    )


@pytest.mark.slow
@both
def test_no_flow_takes_the_conformation_away(name):
    """σ + I = 3 Λ² S, and A stays positive definite: in a reversal at Wi 20 too."""
    fluid = Fluid.dimensionless(make_law(name, CONSTANTS))
    protocol = dc.step_rates([0.0, 1.0], [20.0, -20.0])
    found = simulate(fluid, protocol, np.linspace(0.0, 2.0, 81)).components
    s11, s22, s33, s12 = found.T + np.array([[1.0], [1.0], [1.0], [0.0]])
    assert np.min((s11 + s22) / 2 - np.hypot((s11 - s22) / 2, s12)) > 0.0
    assert np.min(s33) > 0.0


@pytest.mark.slow
def test_of_several_laws_the_records_of_a_pom_pom_fluid_ask_for_it():
    """Made with growth that fades over 2 %; of the unseen flows one is three times as fast."""
    generator = np.random.default_rng(1)

    def record(kind, rate):
        gradient = rate * UNIT[kind]
        law = Independent(5.0, 0.3)
        found = solve_ivp(lambda t, y: law.change(y, gradient), (0, 4), law.rest(), "Radau", TIMES)
        s = np.array([law.stress(y, gradient) for y in found.y.T])
        stress = s[:, 0, 1] if kind == "shear" else s[:, 0, 0] - s[:, 1, 1]
        noise = 0.01 * np.sqrt(np.mean(stress**2)) * generator.standard_normal(len(TIMES))
        flow = in_flow(start_up(rate), kind)
        return Run(f"{kind} {rate}", TIMES, flow, np.full(len(TIMES), rate), stress + noise)

    fitted = [record("shear", 0.5), record("shear", 8.0), record("uniaxial", 1.0)]
    unseen = [record("uniaxial", 3.0), record("shear", 15.0)]
    declared = DeclaredModel.named("ucm", {}, np.ones(1), np.ones(1))
    names = ["giesekus", "xpp", "pom_pom_drag_strain"]
    task = Task(declared, (), fitted, unseen, most=0)
    taken, found = task.choose(names)
    tried = task.lines(found)
    assert taken.law_name == "pom_pom_drag_strain"
    assert tried[0].probability > 0.99
    # 1 % noise on 180 samples
    assert tried[0].parameters["q"] == pytest.approx(5.0, rel=0.05)
    assert tried[0].parameters["stretch_time_ratio"] == pytest.approx(0.3, rel=0.02)
    assert tried[0].error.held_out < 0.02
