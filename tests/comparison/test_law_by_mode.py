"""Constants that differ from mode to mode, beside one law for all modes, on records by scipy."""

from dataclasses import replace

import numpy as np
import pytest
from independent.flow import start_up as independent_start_up
from independent.giesekus import multimode_giesekus

from discover.comparison.fitting.law_by_mode import (
    SparseLaw,
    coefficient_in_modes,
    fit_law_by_mode,
)
from discover.comparison.judging.modes_apart import open_where_modes_differ, said_of_each_mode
from discover.comparison.judging.statements import IN_LIBRARY, Statement
from discover.dataset import Run
from discover.laws.maxwell import UpperConvectedMaxwell
from discover.learners import RecoveredTerm
from discover.protocols.protocol import start_up
from discover.report.plots.by_mode import by_mode_in_brief
from discover.statistics.residual import Expectation
from discover.study.declared_model import DeclaredModel

MODULI, RELAXATION_TIMES = (200.0, 100.0, 50.0), (0.1, 1.0, 10.0)
TIMES = np.geomspace(0.02, 20.0, 60)
FITTED, UNSEEN = (0.3, 1.0, 5.0), (3.0,)
NOISE = 0.01
MOBILITIES = (0.1, 0.25, 0.5)  # nearly linear in log λ on the scale of the link


def records(mobilities, rates, noise=NOISE):
    fluid = multimode_giesekus(mobilities, MODULI, RELAXATION_TIMES)
    generator, runs = np.random.default_rng(5), []
    for rate in rates:
        stress = fluid.respond(independent_start_up(rate), TIMES).sigma12
        size = noise * np.sqrt(np.mean(stress**2))
        stress = stress + size * generator.standard_normal(len(TIMES))
        runs.append(Run(f"at {rate:g}", TIMES, start_up(rate), np.full(len(TIMES), rate), stress))
    return runs


def known_part():
    modes = np.array(MODULI), np.array(RELAXATION_TIMES)
    return DeclaredModel(UpperConvectedMaxwell(), "ucm", {}, *modes, (), None)


def fitted(mobilities):
    """The answer, beside a law with the mean mobility in every mode as what was found."""
    model = known_part()
    mean = float(np.mean(mobilities))
    path = [
        {"support": [], "coefficients": [], "inner": {}},
        {"support": ["sigma.sigma"], "coefficients": [mean], "inner": {}},
    ]
    same = [run.stress for run in records([mean] * 3, FITTED, noise=0.0)]
    runs, unseen = records(mobilities, FITTED), records(mobilities, UNSEEN)
    sparse = SparseLaw(["sigma.sigma"], 1, same)
    return fit_law_by_mode(model, path, sparse, runs, unseen, Expectation(), 64)


@pytest.fixture(scope="module")
def law():
    return fitted(MOBILITIES)


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


def test_its_constants_are_told_in_few_words(law):
    brief = by_mode_in_brief("giesekus_mobility", law.constants["giesekus_mobility"])
    assert brief.startswith("Giesekus mobility from 0.1 at 0.1 s to 0.")
    assert brief.endswith("at 10 s")


def test_control_one_constant_for_all_modes_is_no_law_by_mode():
    assert fitted((0.25, 0.25, 0.25)) is None


def test_slow_runs_that_one_coefficient_explains_leave_that_of_the_fast_modes_open():
    term = RecoveredTerm("sigma.sigma", 0.5)
    slow = records(MOBILITIES, (0.02, 0.05, 0.1))
    found = coefficient_in_modes(known_part(), term, slow)
    assert found.degree == 0
    for mode, truth in zip(found.modes, MOBILITIES, strict=True):
        assert mode.left_open or mode.ci95[0] < truth < mode.ci95[1]
    fast, _, slowest = found.modes
    assert slowest.ci95[1] - slowest.ci95[0] < 0.1
    assert fast.left_open or fast.ci95[1] - fast.ci95[0] > 0.3
    said = said_of_each_mode("sigma.sigma", found, 3)
    assert said.startswith("The coefficient of sigma.sigma is taken to be the same in all 3 modes.")
    assert "at 10 s" in said


def test_control_runs_that_stretch_every_mode_determine_that_of_each():
    term = RecoveredTerm("sigma.sigma", 0.25)
    found = coefficient_in_modes(known_part(), term, records((0.25, 0.25, 0.25), (1.0, 5.0, 25.0)))
    assert found.degree == 0
    assert all(mode.ci95[1] - mode.ci95[0] < 0.1 for mode in found.modes)


def test_a_term_that_the_sweep_tells_is_only_said_to_be_the_same_in_all_modes():
    assert coefficient_in_modes(known_part(), RecoveredTerm("gammadot", 0.1), []) is None
    said = said_of_each_mode("gammadot", None, 3)
    assert said.endswith("the same in all 3 modes, which was not tested.")


NORMAL = [Statement(name, IN_LIBRARY, "The band is narrow.") for name in ("N1", "N2")]


def test_normal_stresses_are_open_where_constants_by_mode_describe_the_runs_as_well(law):
    said = open_where_modes_differ(NORMAL, law, in_library=True)
    assert [one.undetermined for one in said] == [True, True]
    assert "2 constants that differ from mode to mode describes these runs as well" in said[0].text


def test_normal_stresses_of_a_law_that_explains_nothing_are_not_called_those_of_the_fluid(law):
    said = open_where_modes_differ(NORMAL, law, in_library=False)
    assert "N1 of the law shown is not that of the fluid" in said[0].text


def test_control_they_stay_determined_where_such_a_law_is_worth_less_or_explains_nothing(law):
    worse = replace(law, gain=-20.0)
    unexplained = replace(law, left=replace(law.left, verdict="unexplained"))
    for other in (None, worse, unexplained):
        assert open_where_modes_differ(NORMAL, other, in_library=True) == NORMAL
