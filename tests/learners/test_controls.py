"""Learners on flow curves, sweeps, periodic starts and long holds of a rate; records by scipy."""

from functools import cache

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from differences import nearly_giesekus, told_as_differences
from independent import Giesekus, oscillation, start_up, steps
from independent.folders import write_table
from independent.noise import white
from noisy_runs import run_at, start_ups

import discover as dc
from discover import protocols
from discover.learners.settings import as_runs, known_part
from discover.learners.tbnn_ude import estimator as of_network
from discover.learners.tbnn_ude.problem import make_problem as make_training_problem
from discover.learners.tbnn_ude.session import without_network
from discover.protocols.control import steady_rates
from tensor_library.library import build_library

LIBRARY = build_library(degree=0)
RATES = np.geomspace(0.1, 20.0, 24)
SLOW = RATES[RATES < 2.0]  # in faster flow the stress of a trial law bends too fast for differences
MOBILITY, NOISE = 0.3, 0.01


def flow_curve(noise=0.0, rates=RATES):
    """Where start-ups of a Giesekus fluid end by scipy, with noise in proportion."""
    material = Giesekus(MOBILITY)
    stress = [material.respond(start_up(r), np.linspace(0.0, 40.0, 3)).sigma12[-1] for r in rates]
    off = 1.0 + noise * np.random.default_rng(0).standard_normal(rates.size)
    counted = np.arange(1.0, rates.size + 1.0)
    return dc.Run("flow_curve.csv", counted, steady_rates(rates), rates, np.array(stress) * off)


@pytest.mark.slow
def test_the_network_is_told_of_steady_states_as_their_differences_say():
    start = start_ups(Giesekus(MOBILITY), (2.0,), np.linspace(0.05, 8.0, 40), noise=0.0)[0]
    problem = make_training_problem([flow_curve(rates=SLOW), start], dc.Fluid())
    along = told_as_differences(problem, nearly_giesekus(MOBILITY), 1e-5, 1e-6)
    assert np.all(np.isfinite(along.states))


STIFF, SLOW_TIME, FREQUENCY = 100.0, 20.0, 1.0
SLOWLY = dc.Fluid(modulus=STIFF, relaxation_time=SLOW_TIME)
PERIOD = 2.0 * np.pi / FREQUENCY


def swing(strain, samples=65, cycles=None, noise=0.0):
    times = np.linspace(0.0, PERIOD, samples)
    rate = protocols.oscillatory_shear(strain * FREQUENCY, FREQUENCY)
    protocol = protocols.after_alternation(rate, PERIOD, times)
    flow = oscillation(strain * FREQUENCY, FREQUENCY)  # after so many cycles from rest, by scipy
    later = (45 if cycles is None else cycles) * PERIOD + times
    stress = Giesekus(MOBILITY, STIFF, SLOW_TIME).respond(flow, later).sigma12
    stress = white(stress, noise, np.random.default_rng(int(10 * strain)))
    return dc.Run(f"strain {strain:g}", times, protocol, protocols.shear_rates(rate, times), stress)


def test_weights_of_a_network_move_its_periodic_state_as_differences_do():
    problem = make_training_problem(
        [swing(2.0), run_at(1.0, np.linspace(0.5, 20.0, 40), np.ones(40))],
        dc.Fluid(modulus=STIFF, relaxation_time=SLOW_TIME),
    )
    mobility = jnp.zeros(8).at[3].set(MOBILITY)
    law = eqx.tree_at(lambda law: law.constants, without_network(True), mobility)
    along = told_as_differences(problem, law, 1e-6, 1e-5)
    assert np.all(np.isfinite(along.recorded))


def test_only_what_does_not_relax_by_itself_waits():
    run = swing(1.0, cycles=0)
    assert as_runs([run], 1e4)[0].protocol.begins == run.protocol.begins
    waits = as_runs([run], SLOW_TIME, relaxes=False)[0].protocol
    assert waits.begins < run.protocol.begins


@pytest.mark.slow
def test_a_slow_mode_is_learned_from_two_cycles():
    runs = [swing(strain, noise=0.01) for strain in (0.5, 2.0)]
    fitted = dc.TensorSINDy(LIBRARY, base=SLOWLY).fit(runs)
    (term,) = fitted.result_.terms
    assert term.term == "sigma.sigma"
    low, high = term.ci95
    # within three half-widths
    assert abs(term.coefficient - MOBILITY) < 1.5 * (high - low)


def test_the_network_sees_every_state_of_a_sweep_in_fewer_steps(tmp_path):
    strains = np.geomspace(0.1, 10.0, 24)
    columns = {"strain": strains, "omega_rad_s": np.ones(24), "Gp_Pa": strains, "Gpp_Pa": strains}
    write_table(tmp_path / "amplitude_sweep.csv", columns)
    runs = list(dc.load_dataset(tmp_path).with_material_functions())
    known = known_part(dc.Fluid(dc.make_law("ucm"), [300.0, 200.0], [2.0, 0.1]))
    fine = of_network.make_problem(runs, known)
    rough, said = of_network._rougher(fine, runs, known, 100)
    assert np.array_equal(rough.records.recorded, fine.records.recorded)
    assert rough.flows.n_steps <= fine.flows.n_steps / 1.5
    assert "fewer steps than it is tested in" in said
    assert "samples" not in said


SOFT, SHORT, STRONG = 2.0, 0.02, 0.4
BASE = dc.Fluid(dc.make_law("ucm"), SOFT, SHORT)


@cache
def records(noise=0.01, seed=0):
    """Giesekus at a low rate for 2 s, then held at a high one for a minute."""
    generator, runs = np.random.default_rng(seed), []
    for rate in (10.0, 40.0, 100.0):
        flow, law = ([0.0, 2.0], [1.0, rate]), Giesekus(STRONG, SOFT, SHORT)
        times = np.append(np.geomspace(2e-3, 1.9, 15), 2.0 + np.geomspace(2e-3, 60.0, 40))
        exact = law.respond(steps(*flow), times).sigma12
        rates, noisy = np.where(times < 2.0, 1.0, rate), white(exact, noise, generator)
        runs.append(dc.Run(f"to_{rate:g}", times, protocols.step_rates(*flow), rates, noisy))
    return runs


@pytest.mark.slow
def test_the_sparse_law_is_found_on_whole_holds():
    found = dc.TensorSINDy(LIBRARY, base=BASE, max_terms=2).fit(records())
    assert [term.term for term in found.terms_] == ["sigma.sigma"]
    low, high = found.terms_[0].ci95
    assert low < STRONG < high
