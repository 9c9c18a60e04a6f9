"""Two modes, of which one follows another law: by scipy, told by the right linear spectrum."""

import numpy as np
import pytest
from discover.comparison.fitting.coefficients_in_modes import coefficients_in_modes
from discover.comparison.judging.constants.modes_apart import said_of_each_mode
from discover.comparison.outcomes.flows import Flow
from independent import Giesekus, Modes, PhanThienTanner
from independent import start_up as independent_start_up

from discover.dataset import Run
from discover.laws.textbook.maxwell import UpperConvectedMaxwell
from discover.learners import RecoveredTerm
from discover.protocols.protocol import start_up
from discover.study.declared_model import DeclaredModel

MODULUS, SLOW, FAST = 60.0, 1.0, 0.2
TIMES = np.linspace(0.1, 8.0, 80)
TERM = RecoveredTerm("sigma.sigma", 0.3)
GIESEKUS = Giesekus(0.3, MODULUS, SLOW)
LINEAR_PTT = PhanThienTanner(0.3, "linear", modulus=MODULUS, relaxation_time=FAST)
MIXED = Modes(GIESEKUS, LINEAR_PTT)
ALIKE = Modes(GIESEKUS, Giesekus(0.3, MODULUS, FAST))


def runs_of(fluid, rates, seed):
    lot, runs = np.random.default_rng(seed), []
    for rate in rates:
        stress = fluid.respond(independent_start_up(rate), TIMES).sigma12
        size = 0.01 * np.sqrt(np.mean(stress**2))
        stress = stress + size * lot.standard_normal(len(TIMES))
        runs.append(Run(f"at {rate:g}", TIMES, start_up(rate), np.full(80, rate), stress))
    return runs


def asked(fluid, rates, seed=1):
    modes = np.array([MODULUS, MODULUS]), np.array([SLOW, FAST])
    known = DeclaredModel(UpperConvectedMaxwell(), "ucm", {}, *modes, (), None)
    runs = runs_of(fluid, rates, seed)
    flows = [
        Flow(r.name, "training", r.protocol, TIMES, r.rate, {"sigma12": r.stress}, r.stress)
        for r in runs
    ]
    return coefficients_in_modes(known, [TERM], runs, flows)


@pytest.fixture(scope="module")
def mixed():
    return asked(MIXED, (0.5, 1.0, 2.0))


def test_a_mode_that_the_flow_hardly_stretches_may_follow_another_law(mixed):
    assert "ptt_linear" in mixed.others.names[FAST]
    assert SLOW not in mixed.others.names
    said = said_of_each_mode("sigma.sigma", mixed.constants["sigma.sigma"], 2, mixed.others)
    assert "The law of the mode of 0.2 s is not determined by these data" in said
    assert "at 0.2 s" not in said


def test_bands_hold_the_normal_stresses_of_such_a_fluid(mixed):
    true = MIXED.respond(independent_start_up(2.0), TIMES)
    band = mixed.bands["training/at 2"]
    for column, truth in ((1, true.N1), (2, true.N2)):
        low, high = band.rivals_low[:, column], band.rivals_high[:, column]
        assert np.mean((low <= truth) & (truth <= high)) > 0.95


def test_control_runs_that_stretch_both_modes_tell_the_law_of_each():
    found = asked(ALIKE, (1.0, 5.0, 12.0))
    assert not found.others.names
    said = said_of_each_mode("sigma.sigma", found.constants["sigma.sigma"], 2, found.others)
    assert "at 0.2 s" in said
    assert "not determined" not in said
    # and leave neither intervals nor bands wide
    constant = found.constants["sigma.sigma"]
    assert constant.degree == 0
    assert all(mode.ci95[1] - mode.ci95[0] < 0.1 for mode in constant.modes)
    assert all(0.5 * band.widths()["N1"] < 0.02 for band in found.bands.values())  # the noise: 1 %
