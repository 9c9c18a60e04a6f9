"""A run whose oscillation had gone on for ever, against scipy after so many cycles that it had."""

from dataclasses import replace

import independent
import jax.numpy as jnp
import numpy as np
import pytest

from discover.dataset import Run
from discover.effects import make_effect
from discover.errors import InputError
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.forward.of_fluids import observed_in
from discover.laws import Fluid, Giesekus
from discover.protocols import (
    after_alternation,
    measured_rate,
    oscillatory_shear,
    settled,
    shear_rates,
    start_up,
)
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
    rate = oscillatory_shear(strain * FREQUENCY, FREQUENCY)
    protocol = after_alternation(rate, PERIOD, TIMES)
    return Run("swing", TIMES, protocol, shear_rates(rate, TIMES), np.ones(65))


def predicted(declared, runs, **values):
    model = AugmentedModel(declared, [make_effect(name) for name in values])
    theta = model.zero()
    for name, value in values.items():
        theta[model.positions(name)] = value
    return model.predict(theta, make_batch(runs, strain_step=0.1))


def test_a_slow_mode_is_periodic_from_the_first_sample():
    time, strain = 100.0, 3.0
    declared = DeclaredModel.named("giesekus", {"alpha": MOBILITY}, MODULUS, time)
    (found,) = predicted(declared, [alternating(strain)])
    settled = giesekus_after(10 + int(12 * time / PERIOD), time, strain)
    # steps of fourth order of a tenth of strain: 1e-5; scipy has settled to e⁻¹²
    np.testing.assert_allclose(found, settled, atol=5e-5 * np.max(np.abs(settled)))
    waited = giesekus_after(10, time, strain)
    # what ten cycles of waiting leave: 16 %
    assert np.linalg.norm(waited - settled) > 0.1 * np.linalg.norm(settled)


def test_a_mode_of_a_thousand_periods_takes_no_more_than_a_fast_one():
    # closed form: G ωλ/(1 + ω²λ²) (cos + ωλ sin)
    time = 1000.0 * PERIOD
    (found,) = predicted(DeclaredModel.maxwell(MODULUS, time), [alternating(2.0)])
    x = FREQUENCY * time
    wave = np.cos(FREQUENCY * TIMES) + x * np.sin(FREQUENCY * TIMES)
    exact = 2.0 * MODULUS * x / (1.0 + x**2) * wave
    np.testing.assert_allclose(found, exact, atol=1e-4 * np.max(exact))


@pytest.mark.slow
def test_a_structure_that_heals_over_many_cycles_is_periodic_too():
    declared = DeclaredModel.maxwell(MODULUS, 1.0)
    swing = alternating(2.0)
    twice = Run(
        "twice", np.linspace(0.0, 2.0 * PERIOD, 129), swing.protocol,
        shear_rates(swing.protocol, np.linspace(0.0, 2.0 * PERIOD, 129)), np.ones(129),
    )  # fmt: skip
    # breaks down over strain, heals in 300 s: from rest it would take fifty cycles
    model = AugmentedModel(declared, [make_effect("thixotropy")])
    theta = model.zero()
    theta[model.positions("thixotropy")] = [0.3, 300.0]
    (found,) = model.predict(theta, make_batch([twice], strain_step=0.1))
    assert np.ptp(found) > 0.0
    # of second order in steps that differ from those of the cycle before: 2.3e-4; the structure of
    # a fluid at rest would give a hundredfold stress
    np.testing.assert_allclose(found[:65], found[64:], atol=1e-3 * np.max(np.abs(found)))


@pytest.mark.slow
def test_a_record_in_samples_begins_as_the_wave_that_they_are_of():
    declared = DeclaredModel.named("giesekus", {"alpha": MOBILITY}, MODULUS, 100.0)
    times = np.linspace(3.0, 3.0 + 2.0 * PERIOD, 257)
    rates = np.cos(FREQUENCY * times)
    protocol = after_alternation(measured_rate(times, rates), PERIOD, times)
    run = Run("samples", times, protocol, rates, np.ones(257), rate_is_measured=True)
    (found,) = predicted(declared, [run])
    settled = giesekus_after(10 + int(12 * 100.0 / PERIOD), 100.0, 1.0)
    exact = np.interp((times * FREQUENCY) % (2.0 * np.pi), TIMES, settled)
    # straight lines between 128 samples, and 64 knots, a cycle
    np.testing.assert_allclose(found, exact, atol=3e-3 * np.max(np.abs(settled)))
    assert bool(jnp.all(protocol.cycle == jnp.array([3.0 - PERIOD, 3.0])))


@pytest.mark.slow
@pytest.mark.parametrize("sampled", [False, True])
def test_cycles_that_are_waited_for_bring_the_slowest_mode_to_the_same_state(sampled):
    time = 100.0
    if sampled:
        times = np.linspace(3.0, 3.0 + PERIOD, 257)
        wave = measured_rate(times, 3.0 * np.cos(FREQUENCY * times))
        begun = after_alternation(wave, PERIOD, times)
    else:
        times, begun = TIMES, alternating(3.0).protocol
    protocol = settled(begun, time)
    assert settled(protocol, time) is protocol
    fluid = Fluid(Giesekus(MOBILITY), MODULUS, time)
    waiting = replace(protocol, cycle=np.zeros(2))
    found = observed_in(fluid, waiting, times)[:, 0]
    exact = giesekus_after(10 + int(12 * time / PERIOD), time, 3.0)
    exact = np.interp((times * FREQUENCY) % (2.0 * np.pi), TIMES, exact)
    # e⁻⁶ of what ten cycles leave, 16 %, and straight lines between samples
    assert np.linalg.norm(found - exact) < 5e-3 * np.linalg.norm(exact)


def test_nobody_waits_for_thousands_of_cycles():
    with pytest.raises(InputError, match="Use close-loop"):
        settled(alternating(1.0).protocol, 1e4)


def test_what_does_not_start_periodic_has_nothing_to_wait_for():
    protocol = start_up(1.0)
    assert settled(protocol, 1e6) is protocol


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
