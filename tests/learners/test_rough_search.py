"""A rough grid follows what the fine one does; records by scipy."""

import numpy as np
import pytest
from independent import Giesekus, start_up
from independent.folders import write_table

import discover as dc
from discover.learners import runs as learner_runs
from discover.learners.settings import known_part
from discover.learners.tbnn_ude import estimator as of_network
from discover.learners.tbnn_ude.problem import make_problem

MODULUS, TIME, MOBILITY = np.array([300.0, 200.0]), np.array([2.0, 0.1]), 0.3
BASE = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME)


def records(noise=0.01, seed=0):
    """Two Giesekus modes in start-up, 90 samples to a strain of 40."""
    generator, runs = np.random.default_rng(seed), []
    for rate in (0.5, 2.0, 8.0):
        times = np.geomspace(0.05, 40.0, 90) / rate
        exact = sum(
            modulus * Giesekus(MOBILITY).respond(start_up(rate * time), times / time).sigma12
            for modulus, time in zip(MODULUS, TIME, strict=True)
        )
        off = noise * np.sqrt(np.mean(exact**2)) * generator.standard_normal(times.size)
        rates = np.full(times.size, rate)
        runs.append(dc.Run(f"at_{rate:g}", times, dc.start_up(rate), rates, exact + off))
    return runs


def problem_of(runs, **limits):
    return make_problem(runs, BASE, **limits)


def test_where_the_fine_grid_follows_the_fastest_relaxation_so_does_the_rough_one():
    runs = records()
    followed = problem_of(runs, max_step=0.05)
    assert learner_runs.rough_limits(followed.flows, TIME)["max_step"] == pytest.approx(0.1)
    # else the slowest one sets the limit
    assert learner_runs.rough_limits(problem_of(runs).flows, TIME)["max_step"] == pytest.approx(2.0)


def test_the_network_sees_every_state_of_a_sweep_in_fewer_steps(tmp_path):
    strains = np.geomspace(0.1, 10.0, 24)
    columns = {"strain": strains, "omega_rad_s": np.ones(24), "Gp_Pa": strains, "Gpp_Pa": strains}
    write_table(tmp_path / "amplitude_sweep.csv", columns)
    runs = list(dc.load_dataset(tmp_path).with_material_functions())
    known = known_part(BASE)
    fine = of_network.make_problem(runs, known)
    rough, said = of_network._rougher(fine, runs, known, 100)
    assert np.array_equal(rough.records.recorded, fine.records.recorded)
    assert rough.flows.n_steps <= fine.flows.n_steps / 1.5
    assert "fewer steps than it is tested in" in said
    assert "samples" not in said
