"""Comparing learners: errors, what stays open, what is kept, what JSON holds."""

import json
import time

import jax.numpy as jnp
import numpy as np
import pytest
from discover.comparison.judging.explanation import Explanation
from discover.comparison.judging.identifiability import find_rivals
from discover.comparison.judging.next_measurement import NextMeasurement
from discover.comparison.judging.statements import make_statements
from discover.comparison.flows import comparison_flows, predict
from discover.comparison.truth import true_terms

from discover.comparison import LearnerOutcome, compare, relative_errors
from discover.comparison.comparison import Comparison
from discover.errors import InputError
from discover.laws import Fluid, make_law
from discover.laws.expansion import law_of_terms
from discover.learners import LearnerResult, RecoveredTerm
from discover.study import RunFolder, parse_study
from discover.study.data import load_study_data
from discover.study.declared_model import declared_model
from tensor_library.law_terms import LawTerms
from tensor_library.library import build_library


def fake_study(**compare_options):
    return parse_study(
        {
            "data": {
                "synthetic": {
                    "law": "giesekus",
                    "parameters": {"alpha": 0.2},
                    "noise": 0.01,
                    "samples": 21,
                    "seed": 1,
                }
            },
            "compare": {"high_deborah": [1.5], "library": {"degree": 0}, **compare_options},
        }
    )


def trained(learner, study, model, runs, seed=0, progress=None):
    mobility = 0.2 if learner == "tensor_sindy" else 0.22
    law = make_law("giesekus", {"alpha": mobility})
    term = RecoveredTerm("sigma.sigma", mobility, coefficient_penalised=0.19, ci95=(0.19, 0.21))
    history = (np.arange(1, 3), np.array([1.0, 0.1]))
    result = LearnerResult(learner, law, (term,), 1.5, history, {}, "fake")
    return result, Fluid.dimensionless(law)


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("discover.comparison.learning.train", trained)
        # what has tests of its own, and stands on the page of test_reports
        patch.setattr("discover.comparison.learning.physics_of", lambda *_: {"checks": []})
        patch.setattr(
            "discover.comparison.judgement.next_measurement", lambda *_: NextMeasurement()
        )
        return compare(fake_study())


@pytest.mark.slow
def test_a_perfect_learner_has_no_error_and_a_wrong_one_has(comparison):
    for flow in comparison.flows_of("test"):
        assert max(comparison.errors("tensor_sindy", flow).values()) < 1e-6  # solver tolerance
        assert comparison.errors("tbnn_ude", flow)["N1"] > 0.01
        assert comparison.errors("before", flow)["sigma12"] > 0.3


def test_n2_error_is_relative_to_n1():
    reference = {"sigma12": np.ones(4), "N1": 2.0 * np.ones(4), "N2": np.zeros(4)}
    prediction = {"sigma12": 1.1 * np.ones(4), "N1": 2.0 * np.ones(4), "N2": 0.2 * np.ones(4)}
    errors = relative_errors(prediction, reference)
    assert errors["sigma12"] == pytest.approx(0.1)
    assert errors["N1"] == 0.0
    assert errors["N2"] == pytest.approx(0.1)


def test_what_was_not_measured_has_no_error():
    errors = relative_errors({"sigma12": np.ones(3), "N1": np.ones(3), "N2": np.ones(3)},
                             {"sigma12": np.ones(3)})  # fmt: skip
    assert errors == {"sigma12": 0.0, "N1": None, "N2": None}
    assert relative_errors(None, {"sigma12": np.ones(3)})["sigma12"] is None


def test_an_outcome_comes_back_from_its_state_unchanged():
    term = RecoveredTerm("sigma.sigma", 0.22, coefficient_penalised=0.19, ci95=(0.19, 0.21))
    wave = {"sigma12": np.sin(np.arange(5.0)) / 3.0, "N1": np.array([0.1, np.nan])}
    history = (np.arange(2), np.ones(2))
    outcome = LearnerOutcome(
        "tbnn_ude", (term,), 1.5, history, predictions={"test/a": wave, "test/b": None}
    )
    again = LearnerOutcome.from_state(json.loads(json.dumps(outcome.to_state())))
    assert again.terms == outcome.terms
    assert again.predictions["test/b"] is None
    for quantity, values in wave.items():
        np.testing.assert_array_equal(again.predictions["test/a"][quantity], values)


@pytest.mark.slow
def test_a_finished_learner_is_not_trained_again(tmp_path, monkeypatch):
    calls, kept = [], tmp_path / "state" / "tensor_sindy.json"

    def counting(learner, *args, **kwargs):
        calls.append(learner)
        if calls.count("tbnn_ude") == 1 and learner == "tbnn_ude":
            # the two are trained side by side: stopped once the other one has ended
            deadline = time.monotonic() + 60.0
            while not kept.is_file() and time.monotonic() < deadline:
                time.sleep(0.01)
            raise KeyboardInterrupt
        return trained(learner, *args, **kwargs)

    monkeypatch.setattr("discover.comparison.learning.train", counting)
    study = fake_study()
    with pytest.raises(KeyboardInterrupt):
        compare(study, store=RunFolder(tmp_path, "x"))
    compare(study, store=RunFolder(tmp_path, "x"))
    assert sorted(calls[:2]) == ["tbnn_ude", "tensor_sindy"]
    assert calls[2:] == ["tbnn_ude"]


@pytest.fixture(scope="module")
def slip_case():
    study = parse_study(
        {
            "data": {
                "synthetic": {"law": "johnson_segalman", "parameters": {"xi": 0.4}, "samples": 21}
            }
        }
    )
    data = load_study_data(study)
    return declared_model(study, data.dataset), comparison_flows(data, ())


@pytest.mark.slow
def test_the_twin_of_johnson_segalman_is_found_and_separated_by_n2(slip_case):
    model, flows = slip_case
    chosen = [RecoveredTerm("sigma.gammadot+gammadot.sigma", 0.2)]
    # even where the library that was searched does not hold the twin
    rivals = find_rivals(chosen, [], model, flows, build_library(degree=0))
    twin = next(r for r in rivals if set(r.law.coefficients) == {"tr(sigma)*gammadot"})
    assert "does not hold tr(sigma)*gammadot" in twin.reason
    assert twin.terms["tr(sigma)*gammadot"] == pytest.approx(0.32)  # ξ(1 − ξ/2) at ξ = 0.4
    assert twin.errors_to_chosen["sigma12"] < 1e-6
    assert twin.errors_to_chosen["N1"] < 1e-6
    assert twin.separated_by["quantity"] == "N2"
    statements = make_statements(Explanation(), flows, rivals)
    # N1 is the same in both laws, but nothing says that the fluid is either
    assert [s.quantity for s in statements if s.undetermined] == ["N2", "N1"]
    assert "Checked by simulation" in statements[0].text


@pytest.mark.slow
def test_rivals_of_other_terms_are_simulated_in_one_program(slip_case, monkeypatch):
    model, flows = slip_case
    chosen = [RecoveredTerm("sigma.gammadot+gammadot.sigma", 0.2)]
    exponential = "(exp(epsilon*tr(sigma))-1)*sigma"
    met = [
        {"support": ["sigma.sigma"], "coefficients": [0.3], "inner": {}},
        {"support": [exponential], "coefficients": [1.0], "inner": {"epsilon": 0.2}},
    ]
    simulated = []

    def watched(fluid, flow):
        simulated.append((fluid, flow, predict(fluid, flow)))
        return simulated[-1][-1]

    monkeypatch.setattr("discover.comparison.judging.identifiability.predict", watched)
    known = {flow.key: predict(model.fluid, flow) for flow in flows}
    rivals = find_rivals(chosen, met, model, flows, build_library(degree=0), known)
    assert {frozenset(r.law.coefficients) for r in rivals} >= {
        frozenset(row["support"]) for row in met
    }
    assert len({fluid.law.library for fluid, _, _ in simulated}) == 1
    # the zeros for the others' terms change nothing
    _, flow, together = simulated[-1]
    law = law_of_terms(LawTerms.from_json(met[-1]), True, model.law)
    alone = predict(Fluid(law, model.modulus, model.relaxation_time), flow)
    np.testing.assert_allclose(together["N1"], alone["N1"], rtol=1e-9, atol=1e-9)


@pytest.mark.slow
def test_a_pair_on_33_is_no_rival_where_the_trace_feels_it(slip_case):
    # negative control: with tr σ in the law, σ33 acts back on σ12
    model, flows = slip_case
    rivals = find_rivals([RecoveredTerm("tr(sigma)*sigma", 0.3)], [], model, flows)
    assert rivals == []


def test_true_terms_make_the_true_law():
    parameters = {
        "ucm": {},
        "johnson_segalman": {"xi": 0.4},
        "giesekus": {"alpha": 0.2},
        "ptt_linear": {"epsilon": 0.3},
        "ptt_exponential": {"epsilon": 0.3},
    }
    stress, rate = jnp.array([1.7, -0.2, 0.1, 0.6]), jnp.asarray(1.3)
    for name, values in parameters.items():
        wanted = make_law(name, values).stress_rate(stress, rate)
        for known in (True, False):
            terms = true_terms(name, values, known)
            law = law_of_terms(LawTerms.of(terms), known)
            assert np.allclose(law.stress_rate(stress, rate), wanted, rtol=1e-12), name


def test_constants_of_the_law_need_somebody_who_fits_them():
    content = fake_study().model_dump(exclude_none=True, by_alias=True)
    content["model"] = {"law": "giesekus", "parameters": {"alpha": "fit"}}
    with pytest.raises(InputError, match="close-loop"):
        compare(parse_study(content))


def test_a_sweep_has_no_instrument():
    sweep = {"laws": ["ptt_linear"], "parameter": "epsilon", "values": [0.1]}
    content = fake_study(sweep=sweep).model_dump(exclude_none=True, by_alias=True)
    content["model"] = {"effects": {"stress_gain": {"gain_error": 0.1}}}
    with pytest.raises(InputError, match="sweep computes data that hold no instrument"):
        compare(parse_study(content))


def test_a_sweep_over_an_unknown_parameter_is_refused():
    sweep = {"laws": ["ptt_linear"], "parameter": "alpha", "values": [0.1]}
    with pytest.raises(InputError, match="'alpha'"):
        compare(fake_study(sweep=sweep))
