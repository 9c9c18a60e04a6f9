"""Periodic states, in sweeps and in runs, against scipy and closed forms."""

from dataclasses import replace

import independent
import jax.numpy as jnp
import numpy as np
import pytest
from vectors import sweep_of, vector_of

from discover import protocols
from discover.dataset.linear_viscoelasticity import LinearSweep
from discover.dataset.material_functions import linear_sweep_as_run
from discover.dataset.run import Run
from discover.effects import make_effect, named_effects
from discover.errors import InputError
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.forward.of_fluids import observed_in
from discover.laws import Fluid, Giesekus
from discover.simulate import simulate

MODULUS, MOBILITY, FREQUENCY = 100.0, 0.3, 1.0
PERIOD = 2.0 * np.pi / FREQUENCY
TIMES = np.linspace(0.0, PERIOD, 65)


def giesekus_after(cycles, time, strain):
    """Return σ12 in Pa of a cycle, from rest that many cycles before, by scipy."""
    law = independent.Giesekus(MOBILITY, MODULUS, time)
    flow = independent.oscillation(strain * FREQUENCY, FREQUENCY)
    return law.respond(flow, cycles * PERIOD + TIMES).sigma12


def alternating(strain):
    rate = protocols.oscillatory_shear(strain * FREQUENCY, FREQUENCY)
    protocol = protocols.after_alternation(rate, PERIOD, TIMES)
    return Run("swing", TIMES, protocol, protocols.shear_rates(rate, TIMES), np.ones(65))


def predicted(declared, runs, **values):
    model = AugmentedModel(declared, [make_effect(name) for name in values])
    return model.predict(vector_of(model, **values), make_batch(runs, strain_step=0.1))


def test_a_slow_mode_is_periodic_from_the_first_sample_be_it_of_a_thousand_periods():
    time, strain = 100.0, 3.0
    declared = DeclaredModel.named("giesekus", {"alpha": MOBILITY}, MODULUS, time)
    (found,) = predicted(declared, [alternating(strain)])
    periodic = giesekus_after(10 + int(12 * time / PERIOD), time, strain)
    # steps of fourth order of a tenth of strain: 1e-5; scipy has settled to e⁻¹²
    np.testing.assert_allclose(found, periodic, atol=5e-5 * np.max(np.abs(periodic)))
    waited = giesekus_after(10, time, strain)
    # what ten cycles of waiting leave: 16 %
    assert np.linalg.norm(waited - periodic) > 0.1 * np.linalg.norm(periodic)
    # closed form: G ωλ/(1 + ω²λ²) (cos + ωλ sin)
    time = 1000.0 * PERIOD
    (found,) = predicted(DeclaredModel.maxwell(MODULUS, time), [alternating(2.0)])
    x = FREQUENCY * time
    wave = np.cos(FREQUENCY * TIMES) + x * np.sin(FREQUENCY * TIMES)
    exact = 2.0 * MODULUS * x / (1.0 + x**2) * wave
    np.testing.assert_allclose(found, exact, atol=1e-4 * np.max(exact))


@pytest.mark.slow
def test_a_record_in_samples_begins_as_the_wave_that_they_are_of():
    declared = DeclaredModel.named("giesekus", {"alpha": MOBILITY}, MODULUS, 100.0)
    times = np.linspace(3.0, 3.0 + 2.0 * PERIOD, 257)
    rates = np.cos(FREQUENCY * times)
    protocol = protocols.after_alternation(protocols.measured_rate(times, rates), PERIOD, times)
    run = Run("samples", times, protocol, rates, np.ones(257), rate_is_measured=True)
    (found,) = predicted(declared, [run])
    periodic = giesekus_after(10 + int(12 * 100.0 / PERIOD), 100.0, 1.0)
    exact = np.interp((times * FREQUENCY) % (2.0 * np.pi), TIMES, periodic)
    # straight lines between 128 samples, and 64 knots, a cycle
    np.testing.assert_allclose(found, exact, atol=3e-3 * np.max(np.abs(periodic)))
    assert bool(jnp.all(protocol.cycle == jnp.array([3.0 - PERIOD, 3.0])))


@pytest.mark.slow
@pytest.mark.parametrize("sampled", [False, True])
def test_cycles_that_are_waited_for_bring_the_slowest_mode_to_the_same_state(sampled):
    time = 100.0
    if sampled:
        times = np.linspace(3.0, 3.0 + PERIOD, 257)
        wave = protocols.measured_rate(times, 3.0 * np.cos(FREQUENCY * times))
        begun = protocols.after_alternation(wave, PERIOD, times)
    else:
        times, begun = TIMES, alternating(3.0).protocol
    protocol = protocols.settled(begun, time)
    assert protocols.settled(protocol, time) is protocol
    fluid = Fluid(Giesekus(MOBILITY), MODULUS, time)
    waiting = replace(protocol, cycle=np.zeros(2))
    found = observed_in(fluid, waiting, times)[:, 0]
    exact = giesekus_after(10 + int(12 * time / PERIOD), time, 3.0)
    exact = np.interp((times * FREQUENCY) % (2.0 * np.pi), TIMES, exact)
    # e⁻⁶ of what ten cycles leave, 16 %, and straight lines between samples
    assert np.linalg.norm(found - exact) < 5e-3 * np.linalg.norm(exact)


def test_nobody_waits_for_thousands_of_cycles_nor_for_what_does_not_start_periodic():
    with pytest.raises(InputError, match="Use close-loop"):
        protocols.settled(alternating(1.0).protocol, 1e4)
    protocol = protocols.start_up(1.0)
    assert protocols.settled(protocol, 1e6) is protocol


@pytest.mark.parametrize("time", [1.0, 100.0, 1e4])
def test_a_fluid_is_simulated_from_its_periodic_state_on(time):
    fluid = Fluid(Giesekus(MOBILITY), MODULUS, time)
    found = simulate(fluid, alternating(3.0).protocol, TIMES).shear_stress
    if time > 100.0:
        # scipy would have to follow 20,000 cycles; what a cycle brings back is as it was
        np.testing.assert_allclose(found[0], found[-1], atol=1e-6 * np.max(np.abs(found)))
        return
    exact = giesekus_after(10 + int(12 * time / PERIOD), time, 3.0)
    np.testing.assert_allclose(found, exact, atol=5e-5 * np.max(np.abs(exact)))


TIME = 1.0
STRAINS, FREQUENCIES = np.array([0.1, 1.0, 10.0, 2.0]), np.array([1.0, 1.0, 0.3, 30.0])
MAXWELL = DeclaredModel.named("giesekus", {"alpha": 0.0}, MODULUS, TIME)
GIESEKUS = DeclaredModel.named("giesekus", {"alpha": MOBILITY}, MODULUS, TIME)


SWEEP = sweep_of(STRAINS, FREQUENCIES)


INSTRUMENT = (
    "transducer_lag", "time_delay", "instrument_inertia", "stress_gain", "stress_offset",
    "edge_fracture", "rate_rise_time", "bearing_friction", "tool_compliance", "wall_slip",
)  # fmt: skip


def moduli_of(declared, run, **values):
    """Return the moduli with some effects, in a model that has all: one program serves."""
    model = AugmentedModel(declared, [named_effects()[name] for name in INSTRUMENT])
    storage, loss = model.predict(vector_of(model, **values), make_batch(run.records))
    return storage + 1j * loss


def test_moduli_of_modes_over_thirteen_decades_are_their_closed_form():
    moduli, times = np.geomspace(1e5, 1.0, 7), np.geomspace(1e-8, 1e5, 7)
    omega = np.geomspace(1e-3, 1e3, 9)
    run = linear_sweep_as_run(LinearSweep(omega, np.ones(9), np.ones(9)))
    x = omega[:, None] * times
    exact = ((x**2 + 1j * x) / (1.0 + x**2)) @ moduli
    # the limit of small strain of a law that is not linear: terms of the square of 0.01
    giesekus = DeclaredModel.named("giesekus", {"alpha": 0.3}, moduli, times)
    np.testing.assert_allclose(moduli_of(giesekus, run), exact, rtol=1e-4)


def test_lag_delay_inertia_gain_and_friction_change_a_modulus_by_their_closed_forms():
    iw, plain = 1j * FREQUENCIES, moduli_of(GIESEKUS, SWEEP)
    for name, value, expected in (
        ("transducer_lag", 0.02, plain / (1.0 + 0.02 * iw)),
        ("time_delay", 0.02, plain * np.exp(-0.02 * iw)),
        ("instrument_inertia", 0.5, plain + 0.5 * iw**2),
        ("stress_gain", 0.1, 1.1 * plain),
        ("stress_offset", 5.0, plain),
        ("edge_fracture", 0.5, plain),
        ("rate_rise_time", 0.5, plain),
    ):
        found = moduli_of(GIESEKUS, SWEEP, **{name: value})
        np.testing.assert_allclose(found, expected, rtol=1e-9, err_msg=name)
    added = moduli_of(MAXWELL, SWEEP, bearing_friction=2.0) - moduli_of(MAXWELL, SWEEP)
    # 4/π of a square wave; the trapezoidal rule meets its kink
    np.testing.assert_allclose(added, 4j * 2.0 / np.pi / STRAINS, rtol=1e-3, atol=1e-5)
