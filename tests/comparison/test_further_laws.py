"""Laws that a study names beside the classical ones, fitted to what scipy integrated."""

import numpy as np
import pytest
from discover.comparison.fitting.further_laws import fit_further_laws
from discover.comparison.outcomes.flows import Flow
from independent import RoliePoly
from independent.flow import start_up as independent_start_up

from discover.dataset import Run
from discover.errors import InputError
from discover.laws.textbook.maxwell import UpperConvectedMaxwell
from discover.protocols.protocol import start_up
from discover.study import parse_study
from discover.study.declared_model import DeclaredModel

MODULUS, TIME = 100.0, 2.0
TIMES = np.linspace(0.0, 8.0, 41)
RATES = {"slow": 0.5, "fast": 2.0, "unseen": 1.0}


@pytest.fixture(scope="module")
def fits():
    law = RoliePoly(0.5, 0.2 * TIME, modulus=MODULUS, relaxation_time=TIME)
    generator, runs, flows = np.random.default_rng(3), [], []
    for name, rate in RATES.items():
        found = law.respond(independent_start_up(rate), TIMES)
        size = 0.01 * np.sqrt(np.mean(found.sigma12**2))
        seen = found.sigma12 + size * generator.standard_normal(len(TIMES))
        truth = {"sigma12": found.sigma12, "N1": found.N1, "N2": found.N2}
        fitted = name != "unseen"
        kind = "training" if fitted else "held_out"
        rates = np.full(len(TIMES), rate)
        flows.append(
            Flow(
                name, kind, start_up(rate), TIMES, rates, truth, None if name == "unseen" else seen
            )
        )
        runs.append(Run(name, TIMES, start_up(rate), rates, seen))
    modes = np.array([MODULUS]), np.array([TIME])
    model = DeclaredModel(UpperConvectedMaxwell(), "ucm", {}, *modes, (), None)
    names = ["rolie_poly", "saramito"]
    found = fit_further_laws(names, model, runs[:2], flows, lambda flow, stresses: stresses)
    return {fit.law: fit for fit in found}


def test_the_law_that_made_the_records_is_fitted_with_all_its_constants(fits):
    fit = fits["rolie_poly"]
    # 1 % noise on 82 samples
    assert fit.parameters["stretch_time_ratio"] == pytest.approx(0.2, rel=0.1)
    assert fit.parameters["beta"] == pytest.approx(0.5, abs=0.1)
    assert fit.misfit == pytest.approx(0.01, rel=0.3)
    assert fit.errors["unseen"]["N1"] < 0.02


def test_another_law_fits_worse_and_says_so(fits):
    assert fits["saramito"].misfit > 5.0 * fits["rolie_poly"].misfit
    assert fits["saramito"].criterion > fits["rolie_poly"].criterion + 10.0


@pytest.mark.parametrize("laws", [["rolie_poly", "rolie_poly"], ["no_such_law"]])
def test_a_study_names_each_law_once_and_one_that_there_is(laws):
    content = {"data": {"folder": "x"}, "compare": {"laws": laws}}
    with pytest.raises(InputError, match="laws"):
        parse_study(content)
