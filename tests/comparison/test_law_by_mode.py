"""Constants that differ from mode to mode, beside one law for all modes, on records by scipy."""

from dataclasses import replace

import numpy as np
import pytest
from independent import Modes, PhanThienTanner, multimode_giesekus
from independent.flow import start_up as independent_start_up

from discover.comparison.fitting import law_by_mode
from discover.comparison.fitting.coefficients_in_modes import (
    CoefficientsInModes,
    coefficients_in_modes,
)
from discover.comparison.fitting.law_by_mode import SparseLaw, fit_laws_by_mode
from discover.comparison.fitting.stresses_by_mode import bands_by_mode
from discover.comparison.instrument import Frame
from discover.comparison.judging.constants.asked_of_modes import ask_of_modes
from discover.comparison.judging.constants.modes_apart import (
    holding_modes_apart,
    open_where_modes_differ,
    said_of_each_mode,
    with_intervals_of_modes,
)
from discover.comparison.judging.explanation import Explanation
from discover.comparison.judging.statements import IN_LIBRARY, Statement
from discover.comparison.outcomes.flows import Flow, columns_of
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.dataset import Dataset, Run
from discover.dataset.run import Loading
from discover.effects import make_effect
from discover.inference.by_mode.constants import ConstantByMode
from discover.inference.by_mode.draws import ConstantsDrawn
from discover.laws import Fluid
from discover.laws.textbook.maxwell import UpperConvectedMaxwell
from discover.learners import RecoveredTerm
from discover.protocols.protocol import start_up
from discover.report.plots.by_mode import by_mode_in_brief, by_mode_picture
from discover.report.wording import terms_text
from discover.statistics import LackOfFit
from discover.statistics.residual import Expectation
from discover.study.data import StudyData
from discover.study.declared_model import DeclaredModel

pytestmark = pytest.mark.usefixtures("optimised")

MODULI, RELAXATION_TIMES = (200.0, 100.0, 50.0), (0.1, 1.0, 10.0)
TIMES = np.geomspace(0.02, 20.0, 60)
FITTED, UNSEEN = (0.3, 1.0, 5.0), (3.0,)
NOISE = 0.01
MOBILITIES = (0.1, 0.25, 0.5)  # nearly linear in log λ on the scale of the link
NAME, SLIP = "giesekus_mobility", "non_affine_motion"


def records(mobilities, rates, noise=NOISE, fluid=None, times=TIMES):
    fluid = fluid or multimode_giesekus(mobilities, MODULI, RELAXATION_TIMES)
    generator, runs = np.random.default_rng(5), []
    for rate in rates:
        stress = fluid.respond(independent_start_up(rate), times).sigma12
        size = noise * np.sqrt(np.mean(stress**2))
        stress = stress + size * generator.standard_normal(len(times))
        runs.append(Run(f"at {rate:g}", times, start_up(rate), np.full(len(times), rate), stress))
    return runs


def known_part():
    modes = np.array(MODULI), np.array(RELAXATION_TIMES)
    return DeclaredModel(UpperConvectedMaxwell(), "ucm", {}, *modes, (), None)


def flows_of(runs, kind):
    return [
        Flow(
            run.name,
            kind,
            run.protocol,
            run.time,
            run.rate,
            {"sigma12": run.stress},
            run.stress if kind == "training" else None,
        )
        for run in runs
    ]


def normal_stresses(mobilities, rate):
    fluid = multimode_giesekus(mobilities, MODULI, RELAXATION_TIMES)
    seen = fluid.respond(independent_start_up(rate), TIMES)
    return {"N1": seen.N1, "N2": seen.N2}


def off(band, truth, quantity, of="N1"):
    """How far a true curve lies outside a band, relative to its own size or that of N1."""
    low, high = columns_of(band.rivals_low)[quantity], columns_of(band.rivals_high)[quantity]
    outside = truth[quantity] - np.clip(truth[quantity], low, high)
    return np.linalg.norm(outside) / np.linalg.norm(truth[of])


def laws_of(mobilities, fluid=None, times=TIMES, ranks_on_all=False):
    """The answers, beside a law with the mean mobility in every mode as what was found."""
    model = known_part()
    mean = float(np.mean(mobilities))
    path = [
        {"support": [], "coefficients": [], "inner": {}},
        {"support": ["sigma.sigma"], "coefficients": [mean], "inner": {}},
    ]
    same = [run.stress for run in records([mean] * 3, FITTED, noise=0.0, times=times)]
    runs, unseen = (records(mobilities, rates, NOISE, fluid, times) for rates in (FITTED, UNSEEN))
    sparse = SparseLaw(["sigma.sigma"], 1, same)
    flows = [*flows_of(runs, "training"), *flows_of(unseen, "held_out")]
    asked = Expectation(), 64, flows, ranks_on_all
    return fit_laws_by_mode(model, path, sparse, runs, unseen, *asked)


def fitted(mobilities, fluid=None):
    """The best of them."""
    return next(laws_of(mobilities, fluid), None)


# one constant by mode and rivals of each kind; that of the fluid among all of them is a slow test
FEW = ("giesekus_mobility",), ("ptt_linear",), (SLIP,), ("giesekus_mobility", SLIP)


@pytest.fixture(scope="module")
def law():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(law_by_mode, "_NAMED", FEW)
        return fitted(MOBILITIES)


@pytest.mark.slow
def test_the_law_is_the_same_among_all_that_are_asked(law):
    found = fitted(MOBILITIES)
    assert list(found.constants) == list(law.constants)
    for own, one in zip(
        found.constants["giesekus_mobility"].modes,
        law.constants["giesekus_mobility"].modes,
        strict=True,
    ):
        assert own.value == pytest.approx(one.value, rel=1e-6)


def test_the_constant_of_each_mode_is_found_and_predicts_a_run_that_no_fit_saw(law):
    ((name, constant),) = law.constants.items()
    assert name == "giesekus_mobility"
    for mode, truth in zip(constant.modes, MOBILITIES, strict=True):
        low, high = mode.ci95
        # 95 % intervals, widened by half: three of them must hold at once
        assert low - (high - low) / 4 < truth < high + (high - low) / 4
    assert law.explains
    assert law.gain > 6.0  # strong evidence (Kass & Raftery 1995)
    assert law.errors["at 3"] < 1.5 * NOISE
    said = law.to_json()
    assert said["verdict"] == "explained"
    assert len(said["constants"]["giesekus_mobility"]["modes"]) == 3


@pytest.mark.slow
def test_terms_ranked_on_few_samples_are_fitted_on_all(monkeypatch):
    monkeypatch.setattr(law_by_mode, "_NAMED", FEW[:2])
    kept, fit = [], law_by_mode._best_first

    def listening(problem, sets):
        kept.append((problem.weight.shape[1], len(sets)))
        return fit(problem, sets)

    monkeypatch.setattr(law_by_mode, "_best_first", listening)
    times = np.geomspace(0.02, 20.0, 200)
    of_few = next(laws_of(MOBILITIES, times=times))
    (few, all_sets), (every, still_in) = kept
    assert (few, every) == (60, 200)
    assert still_in < all_sets
    left_out = (
        f"{all_sets - still_in} of {all_sets} sets of terms were ranked on at most 60 samples"
    )
    assert of_few.left_out.startswith(left_out)
    assert of_few.left_out in by_mode_picture(of_few.constants, False, of_few.left_out).caption
    of_all = next(laws_of(MOBILITIES, times=times, ranks_on_all=True))
    assert [*of_few.constants] == [*of_all.constants]
    assert not of_all.left_out
    # both are at the minimum of all samples, to the tolerance of the fits
    for one, other in zip(*(law.constants[NAME].modes for law in (of_few, of_all)), strict=True):
        assert one.value == pytest.approx(other.value, rel=1e-3)


@pytest.mark.slow
def test_of_more_degrees_no_law_is_told_that_runs_away_in_a_run_held_out(monkeypatch, law):
    monkeypatch.setattr(law_by_mode, "_NAMED", FEW[:1])
    freer = laws_of(MOBILITIES)
    assert next(freer).constants[NAME].degree == law.constants[NAME].degree
    assert next(freer).constants[NAME].degree > law.constants[NAME].degree  # control
    monkeypatch.setattr(law_by_mode, "_errors", lambda *_: {"at 3": None})
    assert [one.constants[NAME].degree for one in laws_of(MOBILITIES)] == [
        law.constants[NAME].degree
    ]


IN_INTEGRATION = 1e-3
"""What independent integrations of these laws may differ by, of the size of N1."""


def test_its_normal_stresses_in_a_run_that_no_fit_saw_are_those_of_the_fluid(law):
    band, truth = law.bands["held_out/at 3"], normal_stresses(MOBILITIES, 3.0)
    half = {quantity: 0.5 * width for quantity, width in band.widths().items()}
    for quantity in ("N1", "N2"):
        assert off(band, truth, quantity) < IN_INTEGRATION
        assert half[quantity] < 2.0 * NOISE
    # one mobility for all modes has another N1, though a little of many terms may hide it in σ12
    alike = normal_stresses([float(np.mean(MOBILITIES))] * 3, 3.0)
    assert off(band, alike, "N1") > 0.02


def test_modes_followed_one_by_one_add_up_to_the_fluid_that_scipy_solves():
    exact = ConstantsDrawn(("giesekus_mobility",), np.array([[MOBILITIES]]), (1,))
    model = known_part()
    fluid = Fluid(model.law, model.modulus, model.relaxation_time, solvent_viscosity=7.0)
    flows = flows_of(records(MOBILITIES, (3.0,)), "test")
    effects, inner = [make_effect("giesekus_mobility")], {"giesekus_mobility": np.zeros(0)}
    (band,) = bands_by_mode(exact, effects, inner, fluid, flows).values()
    truth = normal_stresses(MOBILITIES, 3.0)
    predicted = columns_of(band.chosen)
    for quantity in ("N1", "N2"):
        apart = predicted[quantity] - truth[quantity]
        assert np.linalg.norm(apart) < IN_INTEGRATION * np.linalg.norm(truth["N1"])
    # the solvent flows beside all modes, once
    polymer = records(MOBILITIES, (3.0,), noise=0.0)[0].stress
    assert predicted["sigma12"] - polymer == pytest.approx(21.0, abs=1e-3 * np.max(polymer))


def test_its_constants_are_told_in_few_words(law):
    brief = by_mode_in_brief("giesekus_mobility", law.constants["giesekus_mobility"])
    assert brief.startswith("Giesekus mobility from 0.1 at 0.1 s to 0.")
    assert brief.endswith("at 10 s")


def test_control_one_constant_for_all_modes_is_no_law_by_mode(monkeypatch):
    monkeypatch.setattr(law_by_mode, "_NAMED", FEW)
    assert fitted((0.25, 0.25, 0.25)) is None


@pytest.fixture(scope="module")
def of_slow_runs():
    """What one coefficient leaves open of runs that hardly stretch the fast modes."""
    slow, fast = records(MOBILITIES, (0.02, 0.05, 0.1)), records(MOBILITIES, (3.0,))
    flows = [*flows_of(slow, "training"), *flows_of(fast, "held_out")]
    return coefficients_in_modes(known_part(), [RecoveredTerm("sigma.sigma", 0.5)], slow, flows)


def test_slow_runs_that_one_coefficient_explains_leave_that_of_the_fast_modes_open(of_slow_runs):
    found = of_slow_runs.constants["sigma.sigma"]
    assert found.degree == 0
    for mode, truth in zip(found.modes, MOBILITIES, strict=True):
        assert mode.left_open or mode.ci95[0] < truth < mode.ci95[1]
    fast, _, slowest = found.modes
    assert slowest.ci95[1] - slowest.ci95[0] < 0.1
    assert fast.left_open or fast.ci95[1] - fast.ci95[0] > 0.3
    said = said_of_each_mode("sigma.sigma", found, 3)
    assert said.startswith("The coefficient of sigma.sigma is taken to be the same in all 3 modes.")
    assert "at 10 s" in said


def test_bands_hold_the_normal_stress_of_modes_that_the_runs_leave_open(of_slow_runs):
    found = of_slow_runs
    band, truth = found.bands["held_out/at 3"], normal_stresses(MOBILITIES, 3.0)
    # one mobility for all modes meets σ12 of the slow runs, and is that of the slowest mode
    one = float(found.constants["sigma.sigma"].value)
    assert off(band, truth, "N1") < IN_INTEGRATION
    narrow = replace(band, low=band.chosen, high=band.chosen)
    narrow = replace(narrow, rivals_low=0.99 * band.chosen, rivals_high=1.01 * band.chosen)
    alike = normal_stresses([one] * 3, 3.0)
    missed = np.linalg.norm(alike["N1"] - truth["N1"]) / np.linalg.norm(truth["N1"])
    assert missed > 0.05
    assert off(narrow, truth, "N1") > 0.05
    held = holding_modes_apart({"held_out/at 3": narrow}, found)["held_out/at 3"]
    assert off(held, truth, "N1") < IN_INTEGRATION


@pytest.mark.slow
def test_control_bands_and_intervals_stay_narrow_where_the_runs_determine_every_mode():
    equal = (0.25, 0.25, 0.25)
    runs, fast = records(equal, (1.0, 5.0, 25.0)), records(equal, (3.0,))
    flows = [*flows_of(runs, "training"), *flows_of(fast, "held_out")]
    term = RecoveredTerm("sigma.sigma", 0.25)
    found = coefficients_in_modes(known_part(), [term], runs, flows)
    assert all(0.5 * band.widths()["N1"] < NOISE for band in found.bands.values())
    constant = found.constants["sigma.sigma"]
    assert constant.degree == 0
    assert all(mode.ci95[1] - mode.ci95[0] < 0.1 for mode in constant.modes)


def test_an_interval_holds_coefficients_that_differ_and_keeps_that_of_equal_ones_beside_it():
    term = RecoveredTerm("sigma.sigma", 0.5, ci95=(0.48, 0.52))
    none = np.zeros(0)
    outcome = LearnerOutcome("tensor_sindy", (term,), 0.0, (none, none))
    constant = ConstantByMode(
        0.5, (0.2, 0.51), "", mean_time_s=1.0, degree=0, evidence=(0.0,), modes=()
    )
    found = CoefficientsInModes({"sigma.sigma": constant}, {})
    (wider,) = with_intervals_of_modes({"tensor_sindy": outcome}, found)["tensor_sindy"].terms
    assert wider.ci95 == (0.2, 0.52)
    assert wider.ci95_given_equal_modes == (0.48, 0.52)
    told = terms_text(replace(outcome, terms=(wider,)))
    assert "0.48 to 0.52 if it is the same in all modes, else 0.2 to 0.52" in told


def test_there_is_no_band_where_laws_that_differ_from_mode_to_mode_run_away(law):
    band = law.bands["held_out/at 3"]
    lost = replace(band, rivals_low=np.full_like(band.low, np.nan), reason="it runs away")
    found = CoefficientsInModes(law.constants, {"held_out/at 3": lost})
    held = holding_modes_apart({"held_out/at 3": band}, found)["held_out/at 3"]
    assert held.reason == "it runs away"
    assert np.all(np.isnan(held.rivals_low))


@pytest.mark.slow
def test_coefficients_of_equal_modes_hold_whatever_the_loadings():
    term = RecoveredTerm("sigma.sigma", 0.25)
    loaded = [
        replace(run, stress=factor * run.stress, loading=Loading(0.03))
        for run, factor in zip(
            records((0.25, 0.25, 0.25), (1.0, 5.0, 25.0)), (1.03, 0.98, 1.02), strict=True
        )
    ]
    found = coefficients_in_modes(known_part(), [term], loaded).constants["sigma.sigma"]
    assert found.degree == 0
    assert all(mode.ci95[0] < 0.25 < mode.ci95[1] for mode in found.modes)


def test_a_term_that_the_sweep_tells_is_only_said_to_be_the_same_in_all_modes():
    assert coefficients_in_modes(known_part(), [RecoveredTerm("gammadot", 0.1)], []) is None
    said = said_of_each_mode("gammadot", None, 3)
    assert said.endswith("the same in all 3 modes, which was not tested.")


UNSEEN_FLOWS = flows_of(records(MOBILITIES, UNSEEN), "held_out")

NORMAL = [Statement(name, IN_LIBRARY, "The band is narrow.") for name in ("N1", "N2")]


def test_normal_stresses_are_open_where_constants_by_mode_describe_the_runs_as_well(law):
    said = open_where_modes_differ(NORMAL, law, in_library=True)
    assert [one.undetermined for one in said] == [True, True]
    assert "2 constants that differ from mode to mode describes these runs as well" in said[0].text


def test_normal_stresses_of_a_law_that_explains_nothing_are_not_called_those_of_the_fluid(law):
    said = open_where_modes_differ(NORMAL, law, in_library=False, flows=UNSEEN_FLOWS)
    assert "If that is the fluid's, its N1 is known to ± " in said[0].text
    assert "N1 of the law shown is not that of the fluid" in said[0].text


def test_control_they_stay_determined_where_such_a_law_is_worth_less_or_explains_nothing(law):
    worse = replace(law, gain=-20.0)
    unexplained = replace(law, left=replace(law.left, verdict="unexplained"))
    for other in (None, worse, unexplained):
        assert open_where_modes_differ(NORMAL, other, in_library=True) == NORMAL


@pytest.fixture
def asked(monkeypatch):
    """`asked_of`, with one law to choose: which is chosen is for the tests above."""
    monkeypatch.setattr(law_by_mode, "_NAMED", (("giesekus_mobility",),))
    return asked_of


def asked_of(fitted_rates, mobilities, unseen, explained=True):
    """What is said where one coefficient misses a run held out, and may explain those fitted."""
    runs = records(mobilities, fitted_rates)
    flows = [*flows_of(runs, "training"), *flows_of(unseen, "held_out")]
    parts = (Dataset("all", (*runs, *unseen)), Dataset("a", (*runs,)), Dataset("b", (*unseen,)))
    nothing = np.zeros(0)
    outcome = LearnerOutcome(
        "tensor_sindy",
        (RecoveredTerm("sigma.sigma", mobilities[-1]),),
        0.0,
        (nothing, nothing),
        predictions={flow.key: {"sigma12": 1.1 * flow.reference["sigma12"]} for flow in flows},
    )
    missed = Explanation({"tensor_sindy": LackOfFit("unexplained", NOISE, NOISE, 0.0, 0.0)})
    frame = Frame(known_part(), StudyData(*parts), flows)
    return ask_of_modes(outcome, frame, explained, missed, Expectation(), 64, flows)


TO_BE_FITTED = "would, as another law may: fit one of them too."


def test_a_run_held_out_that_coefficients_by_mode_would_allow_is_told_as_one_to_fit(asked):
    found = asked((0.02, 0.05, 0.1), MOBILITIES, records(MOBILITIES, UNSEEN))
    assert found.law is None
    assert found.said.endswith(TO_BE_FITTED)


def test_control_a_run_held_out_of_another_fluid_is_not(asked):
    (run,) = records(MOBILITIES, UNSEEN)
    stiffer = replace(run, stress=1.5 * run.stress)
    assert asked((0.02, 0.05, 0.1), MOBILITIES, [stiffer]).said == ""


@pytest.mark.slow
def test_a_law_by_mode_that_a_run_held_out_refutes_explains_nothing(asked):
    (run,) = records(MOBILITIES, UNSEEN)
    stiffer = replace(run, stress=1.5 * run.stress)
    law = asked(FITTED, MOBILITIES, [stiffer], explained=False).law
    assert law.refuted
    assert not law.explains
    assert "runs held out are missed" in law.left.reason
    assert open_where_modes_differ(NORMAL, law, in_library=True) == NORMAL


@pytest.mark.slow
def test_control_one_that_foretells_it_explains_both(asked):
    law = asked(FITTED, MOBILITIES, records(MOBILITIES, UNSEEN), explained=False).law
    assert law.explains
    assert not law.refuted


@pytest.mark.slow
def test_networks_that_slip_and_whose_junctions_are_lost_by_mode_are_found_with_their_n2(
    monkeypatch,
):
    # either alone, both, and the rival with slip that has as many constants
    named = ("ptt_linear",), (SLIP,), ("giesekus_mobility", SLIP), ("ptt_linear", SLIP)
    monkeypatch.setattr(law_by_mode, "_NAMED", named)
    slip, losses = 0.15, (0.05, 0.12, 0.3)
    modes = zip(losses, MODULI, RELAXATION_TIMES, strict=True)
    fluid = Modes(
        *(PhanThienTanner(e, slip=slip, modulus=g, relaxation_time=t) for e, g, t in modes)
    )
    law = fitted(losses, fluid)
    assert list(law.constants) == ["ptt_linear", SLIP]
    assert law.constants[SLIP].degree == 0
    low, high = law.constants[SLIP].ci95
    assert low - 0.25 * (high - low) < slip < high + 0.25 * (high - low)
    seen = fluid.respond(independent_start_up(3.0), TIMES)
    truth = {"N1": seen.N1, "N2": seen.N2}
    for quantity in ("N1", "N2"):
        assert off(law.bands["held_out/at 3"], truth, quantity) < 2.0 * IN_INTEGRATION


def test_control_without_a_run_held_out_none_is_said_to_miss_one_coefficient(asked):
    # runs left out in turn may speak against a law too
    assert asked((0.02, 0.05, 0.1), MOBILITIES, []).said == ""
