"""A comparison of a Giesekus fluid by scipy, behind a transducer that reads 10 % too much."""

from dataclasses import replace
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest
from fewer_hypotheses import few_candidates, verdict_alone
from independent import Giesekus, oscillation, start_up
from independent.folders import write_folder
from independent.instruments import Instrument
from independent.noise import white

import discover as dc
from discover.comparison.hypotheses import terms_of
from discover.effects import make_effect
from discover.inference.engine.fit import Fit
from discover.loop.loop import Found

MODULUS, MOBILITY, GAIN, NOISE = 100.0, 0.3, 1.1, 0.01
FLOWS = {
    "up.csv": (start_up(1.0), 6.0),
    "fast_up.csv": (start_up(3.0), 5.0),
    "wide.csv": (oscillation(3.0, 0.5), 14.0),
    "held.csv": (start_up(4.0), 4.0),
}


@pytest.fixture(scope="module")
def records():
    """Runs as recorded by a sound instrument without noise; N1 and N2 along."""
    material = Giesekus(MOBILITY, MODULUS)
    return {
        name: Instrument().record(material, flow, np.linspace(0.02, end, 60))
        for name, (flow, end) in FLOWS.items()
    }


@pytest.fixture(scope="module")
def found(records, tmp_path_factory):
    generator = np.random.default_rng(5)
    runs = {
        name: replace(run, stress=GAIN * white(run.stress, NOISE, generator))
        for name, run in records.items()
    }
    data = dc.load_dataset(write_folder(tmp_path_factory.mktemp("gain") / "data", runs))
    base = dc.Fluid(dc.make_law("ucm"), MODULUS, 1.0)
    with pytest.MonkeyPatch.context() as patch:
        few_candidates(patch)
        verdict_alone(patch, structure=True)
        return dc.compare(
            data, base, held_out=["held.csv"], learners=["tensor_sindy"], library={"degree": 0}
        )


def test_the_gain_is_found_and_what_the_learner_saw_is_the_fluid(found):
    assert found.verdict == "explained"
    assert {stage.effect for stage in found.posterior.stages} == {
        "giesekus_mobility",
        "stress_gain",
    }
    (term,) = found.outcomes["tensor_sindy"].terms
    assert term.term == "sigma.sigma"
    assert term.ci95[0] <= MOBILITY <= term.ci95[1]
    assert found.determined_terms


def test_the_band_of_n1_holds_the_truth_and_both_readings_of_a_tenth(found, records):
    (flow,) = found.judged
    band, truth = found.bands[flow.key], records["held.csv"].N1
    # 95 % of the samples should lie inside, and those of one run err together
    assert np.mean((band.low["N1"] <= truth) & (truth <= band.high["N1"])) > 0.9
    # a transducer that reads a tenth too much, or a fluid a tenth stiffer: N1 differs by a tenth
    assert 0.05 < band.half_widths()["N1"] < 0.2
    # of the record itself both say the same
    assert band.half_widths()["sigma12"] < 0.01


def test_normal_stresses_are_open(found):
    # N2: T1 tr(γ̇²)/2 − T5 acts on σ33 alone, which σ12 never sees; N1: see above
    assert set(found.undetermined) == {"N1", "N2"}


def test_classical_laws_stand_beside_the_same_gain_and_the_right_one_is_best(found):
    fits = {fit.law: fit for fit in found.classical}
    best = min(found.classical, key=lambda fit: np.inf if fit.criterion is None else fit.criterion)
    assert best.law == "giesekus"
    low, high = best.ci95["alpha"]
    assert low <= MOBILITY <= high
    assert best.misfit < 1.3 * NOISE < fits["ucm"].misfit  # the negative control


def test_json_names_the_answer_and_what_the_learner_is_worth(found):
    told = found.to_json()
    assert told["verdict"] == "explained"
    assert told["adequate"] is True
    assert told["use"]["law"] == "giesekus"
    assert told["learners"]["tensor_sindy"]["intervals_hold"] == "if_the_law_is_in_the_library"
    assert told["learners"]["tensor_sindy"]["probability"] > 0.5


def test_two_effects_with_a_term_in_common_are_one_law():
    effects = {e.name: e for e in (make_effect("ptt_linear"), make_effect("tr(sigma)*sigma"))}
    theta = np.array([0.2, 0.1])
    positions = {"ptt_linear": [0], "tr(sigma)*sigma": [1]}
    problem = SimpleNamespace(effects=effects, model=SimpleNamespace(positions=positions.get))
    found = Mock(Found, posterior=SimpleNamespace(problem=problem))
    (term,) = terms_of(Mock(Fit, names=tuple(effects), theta=theta), found)
    # ε tr(σ) σ of linear PTT, Phan-Thien & Tanner 1977
    assert (term.term, term.coefficient) == ("tr(sigma)*sigma", pytest.approx(0.3))
