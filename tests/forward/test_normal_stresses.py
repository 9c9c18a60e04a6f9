"""N1 and N2 of runs come with what is recorded of them, from one integration."""

from dataclasses import replace

import numpy as np
import pytest
from independent.homogeneous import GiesekusFluid
from vectors import sweep_of, vectors_of_each

import discover as dc
from discover.dataset import Run
from discover.effects import make_effect
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.forward.of_fluids import bare_run, observed
from discover.protocols import oscillatory_shear, start_up
from discover.protocols.control import steady_rates
from discover.protocols.kinematics import RecordedQuantity
from discover.protocols.protocol import in_flow, recording

FLUID = GiesekusFluid((60.0, 20.0), (0.1, 2.0), 0.3, solvent_viscosity=1.0)
TIMES = np.linspace(0.05, 3.0, 30)
RATES = np.array([0.3, 3.0])
NAMES = "giesekus_mobility", "thixotropy", "viscous_heating", "wall_slip", "transducer_lag"


def run(name, protocol, times, rate):
    return Run(name, times, protocol, np.broadcast_to(rate, times.shape), np.full(times.size, 9.0))


TRANSIENTS = [
    run("start-up", start_up(2.0), TIMES, 2.0),
    run("waves", oscillatory_shear(2.0, 1.5), TIMES, 0.0),
    *(run(kind, in_flow(start_up(0.4), kind), TIMES, 0.4) for kind in ("uniaxial", "planar")),
]
CURVES = [
    run("curve", steady_rates(RATES), np.array([1.0, 2.0]), RATES),
    run(
        "tensile", in_flow(steady_rates(0.1 * RATES), "biaxial"), np.array([1.0, 2.0]), 0.1 * RATES
    ),
]


@pytest.fixture(scope="module")
def model():
    declared = DeclaredModel.maxwell([60.0, 20.0], [0.1, 2.0], solvent_viscosity=1.0)
    return AugmentedModel(declared, [make_effect(name) for name in NAMES])


def vectors(model, names=NAMES):
    """Return the Giesekus fluid, and one with each of some effects more."""
    found = vectors_of_each(model, names)
    found[:, model.positions("giesekus_mobility")[0]] = 0.3
    return found


def observables_by_scipy(run):
    """Return what is recorded, N1 and N2, on full tensors."""
    rates = run.protocol.kinematics
    kind = run.name if rates is not None and run.name in ("uniaxial", "planar") else "shear"
    kind = "biaxial" if run.name == "tensile" else kind
    if run in CURVES:
        # of many relaxation times
        each = [FLUID.stress(kind, lambda _, r=r: r, np.array([60.0]))[0] for r in run.rate]
        total = np.array(each)
    else:
        waves = {"waves": lambda t: 2.0 * np.cos(1.5 * t)}
        total = FLUID.stress(kind, waves.get(run.name, lambda _: run.rate[0]), run.time)
    n1, n2 = (total[:, i, i] - total[:, i + 1, i + 1] for i in (0, 1))
    return np.stack([total[:, 0, 1] if kind == "shear" else n1, n1, n2], axis=-1)


def test_transients_and_flow_curves_have_the_normal_stresses_of_full_tensors(model):
    for runs in (TRANSIENTS, CURVES, TRANSIENTS[:1]):
        batch = make_batch(runs)
        (found,) = model.observables(vectors(model, ()), batch)
        for own, expected in zip(found, map(observables_by_scipy, runs), strict=True):
            # the error of the steps that a loop takes
            largest = np.max(np.abs(expected))
            np.testing.assert_allclose(own, expected, atol=2e-4 * largest)


def test_what_is_recorded_is_what_is_predicted_alone(model):
    batch, thetas = make_batch([*TRANSIENTS, *CURVES]), vectors(model)
    found = model.observables(thetas, batch)[..., 0]
    np.testing.assert_array_equal(found, model.predictions(thetas, batch))


def test_normal_stresses_are_those_of_runs_that_record_them(model):
    shear, thetas = [TRANSIENTS[0], CURVES[0]], vectors(model)
    found = model.observables(thetas, make_batch(shear))
    quantities: tuple[tuple[int, RecordedQuantity], ...] = ((1, "N1"), (2, "N2"))
    for i, quantity in quantities:
        recorded = [
            replace(
                one,
                first_normal_stress_difference=one.stress,
                second_normal_stress_difference=one.stress,
            ).observing(quantity)
            for one in shear
        ]
        other = model.predictions(thetas, make_batch(recorded))
        # the same steps; sums of modes are taken in another order
        np.testing.assert_allclose(found[..., i], other, rtol=1e-10, atol=1e-9)
    # negative control: effects do something to what is recorded
    assert np.all(np.ptp(found[1:, 0, :, 0], axis=0) > 0.0)


@pytest.mark.parametrize("quantity", ["N1", "N2"])
def test_a_flow_that_records_a_normal_stress_can_be_followed_without_a_record(quantity):
    of_shear, of_normal = (
        make_batch([bare_run(flow, TIMES)])
        for flow in (start_up(2.0), recording(start_up(2.0), quantity))
    )
    fluid = dc.Fluid(dc.make_law("giesekus", {"alpha": 0.3}), [60.0], [2.0])
    every, own = (observed([fluid], batch)[0, 0] for batch in (of_shear, of_normal))
    column = 1 if quantity == "N1" else 2
    # the same steps; sums of modes are taken in another order
    np.testing.assert_allclose(own[:, 0], every[:, column], rtol=1e-10)
    assert np.all(every[:, column] != every[:, 0])


def test_a_sweep_has_no_normal_stresses(model):
    strains, ones = np.array([0.1, 1.0]), np.ones(2)
    found = model.observables(vectors(model, ()), make_batch(sweep_of(strains, ones).records))
    assert np.all(np.isfinite(found[..., 0]))
    assert np.all(np.isnan(found[..., 1:]))
