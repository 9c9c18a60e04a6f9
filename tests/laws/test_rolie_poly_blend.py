"""The Rolie–Poly blend, with four tensors a mode, against scipy and the limits that are exact."""

import numpy as np
import pytest
from independent import RoliePoly
from independent import RoliePolyBlend as Independent
from independent.homogeneous import UNIT
from independent.sweeps import modulus_of
from noisy_runs import run_at
from scipy.integrate import solve_ivp

import discover as dc
from discover.dataset.run import Run
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.forward.grid import STRAIN_STEP
from discover.forward.of_fluids import bare_run, components
from discover.laws import Fluid, make_law
from discover.protocols import in_flow, oscillations, start_up
from discover.simulate import simulate

CONSTANTS = {
    "long_fraction": 0.3, "short_time_ratio": 0.1, "stretch_time_ratio": 0.15,
    "short_stretch_time_ratio": 0.3, "beta": 0.8,
}  # fmt: skip
TIMES = np.linspace(0.05, 4.0, 40)
PLACES = ([0, 1, 2, 0], [0, 1, 2, 1])


def independent(modulus=1.0, time=1.0, **changed):
    c = CONSTANTS | changed
    short = c["short_time_ratio"] * time
    stretch = c["stretch_time_ratio"] * time, c["short_stretch_time_ratio"] * short
    share = c["long_fraction"], 1.0 - c["long_fraction"]
    return Independent(share, (time, short), stretch, c["beta"], modulus)


def exact(law, gradient):
    """Return σ in a start-up, (n, 4)."""
    return law.held(gradient, TIMES)[:, *PLACES]


def fluid(modulus=1.0, time=1.0, **changed):
    return Fluid(make_law("rolie_poly_blend", CONSTANTS | changed), modulus, time)


def solved(law, rate, strain_step, kind="shear", times=TIMES):
    run = bare_run(in_flow(start_up(rate), kind), times)
    return components([law], make_batch([run], strain_step))[0, 0, :, :4]


def by_the_loop(protocol, rate, modulus=(1.0,), time=(1.0,), times=TIMES, **columns):
    law = "rolie_poly_blend"
    declared = DeclaredModel.named(law, CONSTANTS, np.array(modulus), np.array(time))
    model = AugmentedModel(declared, [])
    run = Run("run", times, protocol, rate, np.ones(len(times)), **columns)
    return [np.asarray(one) for one in model.predict(model.zero(), make_batch(run.records))]


@pytest.mark.parametrize("rate", [0.05, 3.0])
def test_short_chains_that_relax_within_a_hundredth_of_a_step_are_followed(rate):
    """Their retraction takes 3e-5 of λ; a step at the slower rate is longer than λ."""
    quick = {"short_time_ratio": 1e-3, "short_stretch_time_ratio": 0.03}
    wanted = exact(independent(**quick), rate * UNIT["shear"])[:, 3]
    found = solved(fluid(**quick), rate, 0.1)[:, 3]
    np.testing.assert_allclose(found, wanted, atol=1e-3 * np.max(wanted))


@pytest.mark.parametrize(("share", "time"), [(1.0, 1.0), (0.0, 0.1)])
def test_of_one_component_it_is_rolie_poly(share, time):
    name = "stretch_time_ratio" if share else "short_stretch_time_ratio"
    alone = RoliePoly(CONSTANTS["beta"], CONSTANTS[name] * time, relaxation_time=time)
    wanted = exact(alone, 5.0 * UNIT["shear"])
    found = solved(fluid(long_fraction=share), 5.0, 0.05)
    np.testing.assert_allclose(found, wanted, atol=3e-4 * np.max(np.abs(wanted)))


def without_stretch(gradient, times):
    """Return σ of chains that retract at once, so that no tr A_i moves from 3, (n, 4).

    The r_i then follow from 3 r_i = 2 L:A_i − Σ φ_j (½/τ_j + ½/τ_i + β r_j)(tr A_ij − 3).
    """
    law = independent()
    share, one = np.array(law.share), np.eye(3)
    lost = 0.5 / np.array(law.relaxation_time)
    lost = lost[:, None] + lost[None, :]

    def change(_, y):
        a = y.reshape(2, 2, 3, 3)
        excess = np.trace(a, axis1=2, axis2=3) - 3.0
        drive = 2.0 * np.einsum("kl,j,ijkl->i", gradient, share, a)
        drive = drive - np.sum(share * lost * excess, axis=1)
        drawn = np.linalg.solve(3.0 * np.eye(2) + law.release * share * excess, drive)
        carried = gradient @ a + a @ gradient.T
        rates = (lost + law.release * drawn[None, :])[..., None, None]
        return np.ravel(carried - rates * (a - one) - drawn[:, None, None, None] * a)

    found = solve_ivp(change, (0, times[-1]), law.rest(), "LSODA", times, rtol=1e-9, atol=1e-11)
    return np.array([law.stress(y, gradient)[PLACES] for y in found.y.T])


def test_with_ever_shorter_rouse_times_it_becomes_the_law_without_stretch():
    wanted = without_stretch(UNIT["shear"], TIMES)
    errors = []
    for ratio in (4e-3, 2e-3):
        short = {"stretch_time_ratio": ratio, "short_stretch_time_ratio": ratio}
        found = solved(fluid(**short), 1.0, 0.0025)
        errors.append(np.max(np.abs(found - wanted)) / np.max(np.abs(wanted)))
    # what is left is of the order of Wi τ_s/τ
    assert errors[1] < 4e-3
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.2)


@pytest.mark.slow
def test_an_oscillation_gone_on_is_one_waited_for():
    strain, frequency, one = 3.0, 1.0, np.ones(1)
    sweep = {"strain": strain * one, "storage_modulus": one, "loss_modulus": one}
    protocol = oscillations([strain], [frequency])
    found = by_the_loop(protocol, strain * frequency * one, times=one, **sweep)
    modulus = modulus_of(independent(), strain, frequency, cycles=3)
    wanted = [modulus.real, modulus.imag]
    np.testing.assert_allclose(np.ravel(found), wanted, atol=1e-3 * abs(modulus))


def test_no_flow_takes_a_conformation_away():
    """Of any pair, in a reversal at Wi 20."""
    run = bare_run(dc.step_rates([0.0, 1.0], [20.0, -20.0]), np.linspace(0.0, 2.0, 81))
    states = components([fluid()], make_batch([run], STRAIN_STEP))[0, 0]
    for first in range(0, 20, 4):
        s11, s22, s33, s12 = states[:, first : first + 4].T + np.array([[1], [1], [1], [0]])
        assert np.min((s11 + s22) / 2 - np.hypot((s11 - s22) / 2, s12)) > 0.0
        assert np.min(s33) > 0.0


@pytest.mark.slow
def test_a_learner_told_of_it_claims_nothing_beside_it():
    """Records of its own simulator with 0.1 % noise: that the four tensors are carried along."""
    known = fluid()
    lot, runs = {r: np.random.default_rng(int(r)) for r in (1.0, 3.0, 6.0)}, []
    for rate, generator in lot.items():
        stress = simulate(known, start_up(rate), TIMES).shear_stress
        noise = 1e-3 * np.std(stress) * generator.normal(size=40)
        runs.append(run_at(rate, TIMES, stress + noise))
    sparse = dc.TensorSINDy(base=known, max_terms=1).fit(dc.Dataset("blend", tuple(runs)))
    assert sparse.terms_ == ()
    assert sparse.score(runs) > 0.995
