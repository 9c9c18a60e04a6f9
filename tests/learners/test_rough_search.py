"""Ranking laws on a rough grid changes no answer; records by scipy."""

import numpy as np
import pytest
from independent import Giesekus, start_up
from independent.folders import write_table
from independent.sweeps import modulus_of

import discover as dc
from discover.learners import rough_grid
from discover.learners.known_part import known_part
from discover.learners.tbnn_ude import estimator as of_network
from discover.learners.tensor_sindy import rough_problem as of_search
from discover.learners.tensor_sindy.refit import refit
from discover.learners.trajectories.problem import make_problem
from discover.protocols import oscillations
from discover.protocols.control import steady_rates
from tensor_library.library import build_library

LIBRARY = build_library(degree=0)
FEW = LIBRARY.subset([LIBRARY.names.index(name) for name in ("sigma", "gammadot", "sigma.sigma")])
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


def make(runs, **limits):
    return make_problem(runs, FEW, MODULUS, TIME, base=BASE.law, **limits)


def problem_of(runs, **limits):
    return make(runs, strain_step=0.2, **limits)


@pytest.mark.slow
def test_a_rough_grid_ranks_laws_by_nearly_the_misfit_of_the_fine_one(monkeypatch):
    monkeypatch.setattr(of_search, "AFFORDABLE", 0.0)
    runs = records()
    fine = problem_of(runs)
    rough = of_search.rough_problem(fine, runs, make)
    assert rough is not None
    assert 2 * rough.flows.n_steps <= fine.flows.n_steps
    supports = [(0,), (1,), (2,)]
    begin = [(np.zeros(3), FEW.inner_default)] * 3
    scale = np.ones(3)
    misfits = [[f.misfit for f in refit(p, supports, begin, scale, 1)] for p in (rough, fine)]
    # sixty of ninety samples, each with its noise: the two differ by some per cent of the misfit
    assert misfits[0] == pytest.approx(misfits[1], rel=0.1)
    assert np.argmin(misfits[0]) == 2


def sweep_and_curve(noise=0.01, n=32):
    """Return an amplitude sweep at 1 rad/s and a flow curve of one Giesekus mode."""
    generator, material = np.random.default_rng(0), Giesekus(MOBILITY, 300.0, 2.0)
    strain, rates = np.geomspace(0.05, 5.0, n), np.geomspace(0.05, 5.0, n)
    moduli = np.array([modulus_of(material, each, 1.0, 4) for each in strain])
    off = 1.0 + noise * generator.standard_normal((3, n))
    stress = np.array([material.steady_shear(rate)[0] for rate in rates]) * off[0]
    counted, ones = np.arange(1.0, n + 1.0), np.ones(n)
    sweep = dc.Run(
        "sweep", counted, oscillations(strain, ones), strain, ones, strain=strain,
        storage_modulus=moduli.real * off[1], loss_modulus=moduli.imag * off[2],
    )  # fmt: skip
    return [*sweep.records, dc.Run("curve", counted, steady_rates(rates), rates, stress)]


@pytest.mark.slow
def test_sweeps_and_flow_curves_are_ranked_by_fewer_states(monkeypatch):
    monkeypatch.setattr(of_search, "AFFORDABLE", 0.0)
    runs = sweep_and_curve()

    def one_mode(runs, **limits):
        return make_problem(runs, LIBRARY, 300.0, 2.0, base=BASE.law, **limits)

    fine = one_mode(runs)
    rough = of_search.rough_problem(fine, runs, one_mode)
    assert rough is not None
    assert 3 * rough.flows.n_steps <= fine.flows.n_steps
    assert "16 of a sweep or flow curve" in of_search.ranked_in_words(fine, rough, 1)
    supports = [(LIBRARY.names.index(name),) for name in ("sigma", "gammadot", "sigma.sigma")]
    begin = [(np.zeros(len(LIBRARY)), LIBRARY.inner_default)] * 3
    misfits = [
        [f.misfit for f in refit(p, supports, begin, np.ones(len(LIBRARY)), 5)]
        for p in (rough, fine)
    ]
    # sixteen of 32 samples tell a misfit to a tenth or two, and wrong laws apart from the right
    assert misfits[0] == pytest.approx(misfits[1], rel=0.3)
    assert np.argmin(misfits[0]) == np.argmin(misfits[1]) == 2
    assert min(misfits[0][:2]) > 5.0 * misfits[0][2]


@pytest.mark.slow
def test_the_law_found_is_that_of_a_search_on_all_samples(monkeypatch):
    monkeypatch.setattr(of_search, "AFFORDABLE", 0.0)
    runs = records()
    settings = {"base": BASE, "max_terms": 2, "n_stability": 0}
    found = [
        dc.TensorSINDy(LIBRARY, screening=screening, **settings).fit(runs)
        for screening in ("auto", "exact")
    ]
    rough, exact = found
    assert rough.search_.scout is not None
    assert exact.search_.scout is None
    assert [term.term for term in rough.terms_] == ["sigma.sigma"]
    assert rough.coefficients_ == pytest.approx(exact.coefficients_, rel=1e-6, abs=1e-9)
    low, high = rough.terms_[0].ci95
    assert low < MOBILITY < high
    assert "ranked on at most 60 samples" in rough.result_.message
    assert "to save time" not in exact.result_.message
    # and what is told of rivals counts every law that was tried
    assert len(rough.search_.fits) < rough.search_.n_refitted


def test_cheap_runs_are_not_made_rougher():
    runs = records()
    fine = problem_of(runs)
    assert of_search.rough_problem(fine, runs, make) is None


def test_where_the_fine_grid_follows_the_fastest_relaxation_so_does_the_rough_one():
    runs = records()
    followed = problem_of(runs, max_step=0.05)
    assert rough_grid.rough_limits(followed.flows, TIME)["max_step"] == pytest.approx(0.1)
    # else the slowest one sets the limit
    assert rough_grid.rough_limits(problem_of(runs).flows, TIME)["max_step"] == pytest.approx(2.0)


def test_a_screening_that_does_not_exist_is_refused():
    with pytest.raises(dc.InputError, match="screening must be one of auto, exact"):
        dc.TensorSINDy(screening="none").fit(records())


def test_the_network_sees_every_state_of_a_sweep_in_fewer_steps(tmp_path):
    strains = np.geomspace(0.1, 10.0, 24)
    columns = {"strain": strains, "omega_rad_s": np.ones(24), "Gp_Pa": strains, "Gpp_Pa": strains}
    write_table(tmp_path / "amplitude_sweep.csv", columns)
    runs = list(dc.load_dataset(tmp_path).with_material_functions())
    known = known_part(dc.TBNNUDE(base=BASE))
    fine = of_network._problem(runs, known)
    rough, said = of_network._rougher(fine, runs, known, 100)
    assert np.array_equal(rough.records.recorded, fine.records.recorded)
    assert rough.flows.n_steps <= fine.flows.n_steps / 1.5
    assert "fewer steps than it is judged in" in said
    assert "samples" not in said
