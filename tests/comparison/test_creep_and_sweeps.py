"""Creep, recovery, amplitude sweeps and flow curves in learners and comparisons: by scipy."""

import numpy as np
import pytest
from differences import nearly_giesekus, told_as_differences
from independent import Giesekus, Modes, PhanThienTanner, start_up
from independent.sweeps import modulus_of, strain_at
from noisy_runs import run_at

import discover as dc
from discover.comparison.known_part import without_instrument
from discover.effects import known_effects
from discover.errors import InputError
from discover.learners.tbnn_ude.problem import make_problem as make_training_problem
from discover.loop.from_posterior import FinishedSearch
from discover.protocols import imposed_stress, oscillations, steady_rates
from discover.report.predictions import comparison_predictions
from discover.study.data import StudyData
from tensor_library.library import build_library

MODULUS, TIME, SOLVENT, NOISE = (100.0, 30.0), (0.3, 3.0), 5.0, 0.01
BASE = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME, SOLVENT)
PAIRS = list(zip(MODULUS, TIME, strict=True))
TIMES = np.geomspace(0.05, 20.0, 40)
LIBRARY = build_library(degree=0)


def modes(law, constant):
    return Modes(*(law(constant, modulus=g, relaxation_time=t) for g, t in PAIRS))


GIESEKUS, PTT = modes(Giesekus, 0.3), modes(PhanThienTanner, 0.2)


def noisy(values, seed, size=None):
    size = np.sqrt(np.mean(values**2)) if size is None else size
    return values + NOISE * size * np.random.default_rng(seed).standard_normal(len(values))


def creep(law, stress, off=None):
    """Creep at a stress, and recovery right after one of the samples."""
    levels = [(0.0, stress)] if off is None else [(0.0, stress), (off, 0.0)]
    strain = noisy(strain_at(law, levels, SOLVENT, TIMES), int(stress))
    imposed = np.where((off or np.inf) >= TIMES, stress, 0.0)
    return dc.Run(
        f"creep_{stress:g}", TIMES, imposed_stress(TIMES, imposed), np.gradient(strain, TIMES),
        imposed, strain=strain,
    )  # fmt: skip


def oscillation_of_stress(law, stress):
    """Two cycles from rest; the rate is that of the noisy strain, as a file without one has it."""
    times = np.linspace(0.0, 4.0 * np.pi, 81)[1:]
    strain = strain_at(law, [(0.0, lambda t: stress * np.sin(t))], SOLVENT, times)
    strain, imposed = noisy(strain, int(stress)), stress * np.sin(times)
    return dc.Run(
        f"oscillation_{stress:g}", times, imposed_stress(times, imposed),
        np.gradient(strain, times), imposed, strain=strain,
    )  # fmt: skip


def sweep(law, strain):
    n = len(strain)
    moduli = np.array([modulus_of(law, each, 2.0, 12) for each in strain])
    storage, loss = moduli.real, moduli.imag + SOLVENT * 2.0
    storage, loss = noisy(storage, 1, storage), noisy(loss, 2, loss)
    return dc.Run(
        "amplitudes", np.arange(1.0, n + 1.0), oscillations(strain, np.full(n, 2.0)), 2.0 * strain,
        strain * np.hypot(storage, loss), strain=strain, storage_modulus=storage,
        loss_modulus=loss,
    )  # fmt: skip


def base_of(law):
    return BASE if isinstance(law, Modes) else dc.Fluid(dc.make_law("ucm"), 100.0, 1.0)


def start(law, rate):
    times = np.linspace(0.05, 10.0, 40)
    solvent = float(base_of(law).solvent_viscosity)
    stress = noisy(law.respond(start_up(rate), times).sigma12 + solvent * rate, int(rate))
    return run_at(rate, times, stress, f"at_{rate:g}")


def compared(runs, base=BASE, **options):
    data = dc.Dataset("planted", tuple(runs))
    options = {"learners": ["tensor_sindy"], "library": {"degree": 0}, **options}
    return dc.compare(data, base, **options)


def found_by_sindy(runs, library=LIBRARY):
    found = dc.TensorSINDy(base=BASE, library=library).fit(runs)
    return {term.term: term for term in found.terms_}


def few_samples():
    fewer = creep(GIESEKUS, 40.0).window(np.arange(40) % 4 == 0)
    return [fewer, *sweep(GIESEKUS, np.array([0.1, 2.0])).records]


@pytest.mark.slow
def test_the_network_is_told_of_creep_and_moduli_as_their_differences_say():
    problem = make_training_problem(few_samples(), BASE)
    along = told_as_differences(problem, nearly_giesekus(0.3), 1e-6, 2e-5)
    # what it misses is its own departure from the law that made them, and the noise
    missed = np.abs(along.recorded - problem.records.recorded)[0]
    assert np.max(missed) < 0.05 * np.max(problem.records.recorded[0])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("runs", "degree", "term", "constant"),
    [
        (lambda: [creep(GIESEKUS, 20.0), creep(GIESEKUS, 60.0)], 0, "sigma.sigma", 0.3),
        (lambda: [creep(GIESEKUS, 60.0, off=TIMES[30])], 0, "sigma.sigma", 0.3),
        (lambda: [sweep(GIESEKUS, np.geomspace(0.05, 10.0, 14))], 0, "sigma.sigma", 0.3),
        # only a library with invariants holds this term
        (lambda: [creep(PTT, s) for s in (20.0, 60.0)], 1, "tr(sigma)*sigma", 0.2),
    ],
    ids=["creep", "recovery", "sweep", "creep of a PTT fluid"],
)
def test_the_law_that_made_them_is_found_from_these_tests_alone(runs, degree, term, constant):
    terms = found_by_sindy(runs(), build_library(degree=degree))
    assert list(terms) == [term]
    low, high = terms[term].ci95
    # one of twenty intervals misses; half as wide again, one of three hundred
    assert abs(terms[term].coefficient - constant) < 0.75 * (high - low)
    assert high - low < 0.1 * constant


@pytest.mark.slow
@pytest.mark.parametrize(
    "runs",
    [lambda: [creep(GIESEKUS, 0.2)], lambda: [sweep(GIESEKUS, np.geomspace(1e-3, 1e-2, 14))]],
    ids=["creep", "sweep"],
)
def test_small_stress_and_small_strain_give_no_term_and_determine_nothing(runs):
    found = compared(runs())
    assert not found.outcomes["tensor_sindy"].terms
    assert {"N1", "N2"} <= set(found.undetermined)


@pytest.mark.slow
def test_an_oscillation_of_the_stress_is_explained_by_the_law_that_made_it():
    found = compared([oscillation_of_stress(GIESEKUS, stress) for stress in (30.0, 80.0)])
    assert found.verdict == "explained"
    assert [term.term for term in found.outcomes["tensor_sindy"].terms] == ["sigma.sigma"]


ONE, RATES = Giesekus(0.3, 100.0), np.geomspace(0.1, 20.0, 40)


def curve(material):
    """Where start-ups of a material end, with noise in proportion."""
    ends = [material.respond(start_up(rate), np.array([0.0, 20.0, 40.0])) for rate in RATES]
    stress = np.array([end.sigma12[-1] for end in ends])
    return dc.Run(
        "flow_curve.csv", np.arange(1.0, 41.0), steady_rates(RATES), RATES,
        noisy(stress, 0, stress),
    )  # fmt: skip


# the control is a run of another fluid
@pytest.mark.slow
@pytest.mark.parametrize("own", [True, False])
@pytest.mark.parametrize(
    ("law", "other", "quantity", "of"),
    [
        (GIESEKUS, PTT, "strain", lambda law: creep(law, 40.0)),
        (ONE, PhanThienTanner(0.2, modulus=100.0), "sigma12", curve),
    ],
    ids=["creep", "flow curve"],
)
def test_a_test_of_another_kind_judges_what_two_start_ups_give(law, other, quantity, of, own):
    judge = of(law if own else other)
    found = compared([start(law, 1.0), start(law, 3.0), judge], base_of(law), held_out=[judge.name])
    assert found.verdict == ("explained" if own else "unexplained")
    if own:
        table = comparison_predictions(found)
        lines = table[(table["run"] == judge.name) & (table["source"] == "tensor_sindy")]
        lines = lines[lines["quantity"] == quantity]
        np.testing.assert_allclose(lines["measured"], judge.recorded)
        assert (lines["low95"] <= lines["high95"]).all()


@pytest.mark.slow
def test_a_flow_curve_alone_gives_a_law_and_leaves_its_second_normal_stress_open():
    found = compared([curve(ONE)], base_of(ONE))
    assert found.verdict == "explained"
    terms = {term.term: term for term in found.outcomes["tensor_sindy"].terms}
    low, high = terms["sigma.sigma"].ci95
    assert low <= 0.3 <= high
    # N1 follows where the law is in the library; N2 has twins in it that give the same curve
    assert "N2" in found.undetermined
    table = comparison_predictions(found)
    sparse = table[(table["source"] == "tensor_sindy") & (table["quantity"] == "sigma12")]
    np.testing.assert_allclose(sparse["rate_1_s"], RATES)
    assert sparse["strain"].isna().all()  # a steady state does not know it
    # each sample is missed by its noise, over two decades of stress
    missed = sparse["value"].to_numpy() / sparse["measured"].to_numpy() - 1.0
    assert np.sqrt(np.mean(missed**2)) == pytest.approx(NOISE, rel=0.3)


def test_an_instrument_is_not_taken_out_of_creep():
    data = dc.Dataset("planted", (creep(GIESEKUS, 40.0),))
    effects = known_effects({"stress_gain": {"gain_error": 0.1}})
    divided, ended = StudyData(data, data, data.select([])), object.__new__(FinishedSearch)
    with pytest.raises(InputError, match=r"takes effects of an instrument \(stress_gain\)"):
        without_instrument(divided, ended, effects, np.zeros(1))
