"""Fluids at a given stress and in periodic states, with derivatives, against scipy."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from independent import multimode_giesekus
from independent.sweeps import modulus_of, strain_at

from discover.errors import InputError
from discover.forward.flow_batch import lay_out
from discover.forward.fluids import at_samples, dynamics_of_fluid, solved_on_grid
from discover.laws.multimode import Fluid
from discover.laws.textbook.classical import Giesekus
from discover.protocols import imposed_stress, oscillations, oscillatory_shear, steady_rates
from discover.protocols.protocol import recording
from discover.simulate import SimulationError, observe, simulate

MODULUS, TIME, SOLVENT, MOBILITY = (100.0, 30.0), (0.3, 3.0), 5.0, 0.3
TIMES = np.concatenate([np.geomspace(0.02, 6.0, 30), 6.0 + np.geomspace(0.02, 6.0, 30)])
STRESS = np.where(TIMES <= 6.0, 60.0, 0.0)
STRAINS, FREQUENCY = np.array([0.1, 2.0, 10.0]), 2.0
LAW = multimode_giesekus([MOBILITY] * 2, MODULUS, TIME)
COUNTED = np.arange(1.0, 4.0)
SWEEP = oscillations(STRAINS, np.full(3, FREQUENCY))


def fluid(mobility=MOBILITY):
    return Fluid(Giesekus(mobility), MODULUS, TIME, SOLVENT)


def test_creep_and_recovery_of_two_modes_are_those_of_scipy():
    exact = strain_at(LAW, [(0.0, 60.0), (6.0, 0.0)], SOLVENT, TIMES)
    found = observe(fluid(), imposed_stress(TIMES, STRESS), TIMES)[:, 0]
    # a jump is over in a thousandth of the first gap, and the solvent is of first order in time
    assert np.linalg.norm(found - exact) < 5e-4 * np.linalg.norm(exact)


def test_an_amplitude_sweep_is_where_scipy_ends():
    flows = lay_out(
        [recording(SWEEP, f"{name}_modulus") for name in ("loss", "storage")], [COUNTED] * 2
    )
    loss, storage = jax.jit(lambda law: flows.over(partial(at_samples, law)).observed)(fluid())[
        ..., 0
    ]
    exact = np.array([modulus_of(LAW, strain, FREQUENCY, 12) for strain in STRAINS])
    exact = exact + 1j * SOLVENT * FREQUENCY
    # steps of a strain of 0.4: 5e-6 was measured
    np.testing.assert_allclose(storage + 1j * loss, exact, rtol=2e-5)
    # many fluids at once are followed in steps of 0.1
    for modulus, wanted in (("storage_modulus", exact.real), ("loss_modulus", exact.imag)):
        found = observe(fluid(), recording(SWEEP, modulus), COUNTED)[:, 0]
        np.testing.assert_allclose(found, wanted, rtol=1e-6)


def swept(law, strains):
    n = len(strains)
    protocol = oscillations(np.asarray(strains), np.full(n, FREQUENCY))
    ((flows, grids),) = lay_out([protocol], [np.arange(1.0, n + 1.0)]).parts
    flow, grid = jax.tree.map(lambda leaf: leaf[0], (flows, grids))
    make = partial(dynamics_of_fluid, protocol=flow)
    solved = jax.jit(lambda law: solved_on_grid(make, law, flow, grid).observed)
    return np.asarray(solved(law)[:, 0])


@pytest.mark.slow
def test_a_strain_that_has_no_periodic_state_takes_no_other_of_a_sweep_with_it():
    # a trial law that drives itself: periodic up to a strain of 0.437, where it takes many steps
    runaway, strains = Fluid(Giesekus(-1.2), MODULUS, TIME, SOLVENT), (0.1, 0.435, 10.0)
    alone = swept(runaway, strains)
    np.testing.assert_array_equal(np.isfinite(alone), [True, True, False])
    # without the last strain the other two are found, in longer steps
    both = swept(runaway, strains[:2])
    np.testing.assert_allclose(both, alone[:2], rtol=1e-4)


@pytest.mark.parametrize(
    ("protocol", "times"),
    [
        (imposed_stress(TIMES, STRESS), TIMES),
        (steady_rates(np.array([3.0])), COUNTED[:1]),
        pytest.param(SWEEP, COUNTED, marks=pytest.mark.slow),
        pytest.param(oscillatory_shear(2.0, 1.0), np.linspace(0, 4, 9), marks=pytest.mark.slow),
    ],
    ids=["creep", "steady", "sweep", "oscillation"],
)
def test_derivatives_forward_and_in_reverse_are_differences(protocol, times):
    flows = lay_out([protocol], [times])

    def recorded(mobility):
        return flows.over(partial(at_samples, fluid(mobility))).observed[0, :, 0]

    @jax.jit
    def moved(mobility):
        return jax.jvp(recorded, (mobility,), (jnp.ones(()),))

    at, step = jnp.asarray(MOBILITY), 1e-4
    (more, _), (less, _), (at_it, columns) = (moved(at + d) for d in (step, -step, 0.0))
    differences = (more - less) / (2.0 * step)
    size = float(jnp.max(jnp.abs(differences)))
    # the difference errs by the square of the step; at a given stress the rate moves with slopes
    # that are those of its first guess: 2e-6 was measured
    np.testing.assert_allclose(columns, differences, atol=1e-5 * size)
    back = jax.jit(jax.grad(lambda value: jnp.sum(recorded(value) ** 2)))(at)
    np.testing.assert_allclose(back, 2.0 * at_it @ columns, rtol=1e-9)


def test_a_stress_that_a_fluid_cannot_bear_is_said_and_a_rate_bears_no_other_control():
    with pytest.raises(SimulationError, match="bears this stress"):
        observe(fluid(), imposed_stress(TIMES, 1e200 * STRESS), TIMES)
    with pytest.raises(InputError, match="flows at a given rate"):
        simulate(fluid(), SWEEP, COUNTED)
    # the control
    assert np.all(np.isfinite(observe(fluid(), imposed_stress(TIMES, STRESS), TIMES)))
