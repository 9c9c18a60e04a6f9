"""What is said of several explanations, on records by scipy and closed forms."""

import tomllib

import numpy as np
import pytest
from independent import Giesekus, JohnsonSegalman, UpperConvectedMaxwell
from independent.flow import oscillation, start_up
from independent.folders import with_noise, write_folder
from independent.instruments import Instrument
from sklearn.linear_model import BayesianRidge

import discover as dc
from discover.closed_loop.explanations.bands.discrepancy import posterior
from discover.closed_loop.explanations.probabilities import _inclusion, unexplained_probability
from discover.closed_loop.judging.judgement import Judgement
from discover.closed_loop.results.error_pair import ErrorPair
from discover.closed_loop.results.explanation import Explanation
from discover.closed_loop.results.loop_result import LoopResult
from discover.closed_loop.results.run_record import RunRecord
from discover.errors import InputError
from discover.report.predictions import loop_predictions
from discover.statistics.lack_of_fit import LackOfFit
from discover.statistics.noise.whiteness import SIGNIFICANCE
from discover.study import parse_study

MODULUS, TIME, NOISE = 100.0, 1.0, 0.01
BASE = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME)
FLOWS = {
    "up.csv": (start_up(1.5), 6.0),
    "swing.csv": (oscillation(2.0, 1.0), 10.0),
    "wide.csv": (oscillation(4.0, 0.5), 12.0),
}


def records(folder, material, instrument=None, seed=0):
    runs = {
        name: (instrument or Instrument()).record(material, flow, np.linspace(0.02, end, 120))
        for name, (flow, end) in FLOWS.items()
    }
    noisy = with_noise(runs, NOISE, np.random.default_rng(seed))
    return dc.load_dataset(write_folder(folder, noisy))


def explained(folder, material, effects, most=2):
    return dc.close_loop(records(folder, material), BASE, effects=effects, max_effects=most)


def adds_up(loop):
    told = loop.explanations
    whole = told.unexplained_probability + sum(e.probability for e in told.likeliest_first)
    return whole == pytest.approx(1.0)


@pytest.fixture(scope="module")
def giesekus(tmp_path_factory):
    effects = ["giesekus_mobility", "ptt_linear", "non_affine_motion", "stress_gain"]
    folder = tmp_path_factory.mktemp("giesekus")
    return explained(folder, Giesekus(0.3, MODULUS, TIME), effects)


def test_what_was_planted_is_the_likeliest_explanation(giesekus):
    first, *_ = giesekus.explanations.likeliest_first
    assert first.effects == ("giesekus_mobility",)
    assert adds_up(giesekus)
    # nothing speaks for something unheard of; what is left for it is the prior at even odds at 1 %,
    # and that one constant was tried on two flows more than it takes
    assert giesekus.explanations.unexplained_probability < 0.35
    assert giesekus.explanations.inclusion["giesekus_mobility"] == pytest.approx(first.probability)
    assert giesekus.explanations.inclusion_by_kind["constitutive"] > 0.6


def test_the_band_holds_as_many_samples_as_it_says(giesekus):
    inside = [(r.band[0] <= r.measured) & (r.measured <= r.band[1]) for r in giesekus.records]
    # 95 % of 360 samples, within three standard deviations of a binomial share
    assert np.mean(np.concatenate(inside)) == pytest.approx(
        0.95, abs=3 * np.sqrt(0.95 * 0.05 / 360)
    )


def test_named_dimensions_hold_what_the_loop_holds(giesekus):
    pytest.importorskip("xarray")
    labelled = giesekus.to_xarray()
    told = giesekus.explanations
    assert float(labelled["probability"].sum()) == pytest.approx(1.0)
    assert labelled["probability"].sel(explanation="unexplained") == told.unexplained_probability
    assert set(labelled["effect"].values) == set(told.inclusion)
    alpha = labelled.sel(constant="giesekus_mobility.alpha")
    (found,) = [s.parameters["alpha"] for s in giesekus.stages if s.effect == "giesekus_mobility"]
    assert (alpha["constant_low95"], alpha["constant_high95"]) == found.ci95
    # planted: 0.3, of which a noise of 1 % leaves some 0.01 open
    assert alpha["constant_by_explanation"].sel(explanation="giesekus_mobility") == pytest.approx(
        0.3, abs=0.03
    )
    assert alpha["unit"] == "1"
    table = loop_predictions(giesekus)
    last = table[table["source"] == table["source"].iloc[-1]]
    for ours, theirs in (("found", "value"), ("low95", "low95"), ("measured", "measured")):
        np.testing.assert_array_equal(labelled[ours], last[theirs], err_msg=ours)
    assert list(labelled["run"].values) == list(last["run"])
    # the likeliest explanation is what was found, fitted anew; none of them predicts nothing
    likeliest, unexplained = labelled["predicted"][0], labelled["predicted"][-1]
    np.testing.assert_allclose(likeliest, labelled["found"], atol=NOISE * MODULUS)
    assert np.all(np.isnan(unexplained))


def test_nothing_is_the_explanation_of_the_declared_fluid(tmp_path):
    loop = explained(
        tmp_path, UpperConvectedMaxwell(MODULUS, TIME), ["giesekus_mobility", "stress_gain"]
    )
    first, *_ = loop.explanations.likeliest_first
    assert first.effects == ()
    # noise of one draw in some looks like a gain of its own, but never as likely as none
    assert first.probability > 0.5 > sum(loop.explanations.inclusion.values())


def test_effects_as_probable_as_one_another_are_told_in_the_order_of_their_names():
    # the order of a set of names is another in every process
    error = ErrorPair(0.1, None)
    told = [Explanation(("b", "a", "c"), 0.6, error, {}), Explanation(("c",), 0.4, error, {})]
    assert list(_inclusion(told)) == ["c", "a", "b"]


@pytest.mark.slow
def test_twins_share_one_probability(tmp_path):
    # in shear σ12 is the same with ξ as with c tr(σ) γ̇, c = ξ (1 − ξ/2), in every history
    twins = {("non_affine_motion",), ("tr(sigma)*gammadot",)}
    effects = ["tr(sigma)*gammadot", "non_affine_motion", "giesekus_mobility"]
    loop = explained(tmp_path, JohnsonSegalman(0.3, MODULUS, TIME), effects)
    first, *_ = loop.explanations.likeliest_first
    assert set(first.members) == twins
    inclusion = loop.explanations.inclusion
    assert inclusion["non_affine_motion"] == pytest.approx(inclusion["tr(sigma)*gammadot"])
    assert first.parameters[first.effects[0]]
    assert adds_up(loop)


def test_named_dimensions_are_there_where_nothing_was_explained():
    pytest.importorskip("xarray")
    nothing = ErrorPair(0.5, None)
    empty = LoopResult("no_signal", nothing, nothing, 0.5, (), {}).to_xarray()
    assert empty["probability"].to_series().to_dict() == {"unexplained": 1.0}
    assert empty.sizes["constant"] == empty.sizes["effect"] == 0


def test_what_no_candidate_holds_is_left_to_none_of_them(tmp_path):
    material, effects = Giesekus(0.3, MODULUS, TIME), ["stress_offset", "stress_gain"]
    loop = explained(tmp_path, material, effects, most=1)
    assert loop.verdict == "unexplained"
    assert loop.explanations.unexplained_probability > 0.99
    assert adds_up(loop)


def judgement(probability, verdict, structured=False, misfit=NOISE, missed=0.0, carries=True):
    left = LackOfFit("explained" if verdict == "explained" else "unexplained", misfit, NOISE, 0.0,
                     probability, 0, "", NOISE)  # fmt: skip
    one = np.zeros(1)
    worst = RunRecord("a", False, one, one, one, one, one, np.zeros((1, 1)), one)
    return Judgement(
        "unexplained" if structured else "effects_added", structured, left, 0.0, True, carries, (),
        worst, "", missed, 2,
    )  # fmt: skip


def test_odds_are_even_where_the_verdict_turns():
    at_the_level = judgement(SIGNIFICANCE * 1.001, "explained")
    assert unexplained_probability(at_the_level, 100.0) == pytest.approx(0.5, abs=0.01)
    doubted = judgement(1e-6, "unexplained", structured=True)
    assert unexplained_probability(doubted, 100.0) > 0.99
    # a prior of some 11 % is left where nothing speaks for it
    assert unexplained_probability(judgement(0.6, "explained"), 100.0) == pytest.approx(
        0.11, abs=0.01
    )


def test_held_out_runs_that_are_missed_by_far_leave_little_to_what_was_found():
    near = judgement(0.6, "explained", structured=True, missed=2.0, carries=False)
    far = judgement(0.6, "explained", structured=True, missed=8.0, carries=False)
    assert 0.5 <= unexplained_probability(near, 50.0) < unexplained_probability(far, 50.0)
    assert unexplained_probability(far, 50.0) > 0.95


def test_the_width_of_the_prior_is_that_of_scikit_learn():
    generator = np.random.default_rng(0)
    design = generator.standard_normal((400, 6))
    target = design @ generator.standard_normal(6) + 0.3 * generator.standard_normal(400)
    mean, root = posterior(design, target, 400.0)
    known = BayesianRidge(fit_intercept=False).fit(design, target)
    # both choose noise and width by evidence; theirs counts the constants off the samples
    assert mean == pytest.approx(known.coef_, rel=0.02)
    assert root.T @ root == pytest.approx(known.sigma_, rel=0.05, abs=1e-5)


def test_noise_asks_for_no_other_candidate():
    generator = np.random.default_rng(1)
    design = generator.standard_normal((400, 30))
    design /= np.linalg.norm(design, axis=0)
    noise = 0.1 * generator.standard_normal(400)
    mean, root = posterior(design, noise, 400.0)
    added = np.mean((design @ mean) ** 2) + np.mean(np.sum((root @ design.T) ** 2, axis=0))
    assert added < 0.2 * np.mean(noise**2)


def test_the_contract_holds_in_the_json(giesekus):
    told = giesekus.to_json()
    assert told["explanations"][0]["effects"] == ["giesekus_mobility"]
    assert set(told["explanations"][0]) >= {"effects", "probability", "error"}
    shares = [one["probability"] for one in told["explanations"]]
    assert shares == sorted(shares, reverse=True)
    assert sum(shares) + told["unexplained_probability"] == pytest.approx(1.0)
    assert set(told["inclusion"]) <= {e for one in told["explanations"] for e in one["effects"]}


def test_the_band_stands_in_the_predictions_with_what_was_found(giesekus):
    table = loop_predictions(giesekus)
    assert table[table.source == "augmented"].low95.notna().all()
    assert table[table.source == "declared"].low95.isna().all()


def test_each_explanation_keeps_what_it_predicts_of_every_run(giesekus):
    told = giesekus.explanations
    place = [*told.likeliest_first].index(told.holding([s.effect for s in giesekus.stages]))
    for record in giesekus.records:
        assert len(record.by_explanation) == len(told.likeliest_first)
        # what was found is fitted once more on finer steps, a thousandth of the noise away
        found = record.by_explanation[place]
        size = np.sqrt(np.mean(record.measured**2))
        assert np.max(np.abs(found - record.predicted[-1])) < 1e-3 * NOISE * size + 1e-4 * size


@pytest.mark.parametrize("value", ["0", "65", '"many"'])
def test_a_number_of_explanations_that_cannot_be_is_refused(value):
    loop = tomllib.loads(f"explanations = {value}")
    with pytest.raises(InputError, match="explanations"):
        parse_study({"data": {"folder": "x"}, "loop": loop})


def test_one_explanation_is_what_the_search_found(tmp_path):
    data = records(tmp_path, Giesekus(0.3, MODULUS, TIME))
    effects = ["giesekus_mobility", "ptt_linear"]
    loop = dc.close_loop(data, BASE, effects=effects, max_effects=1, explanations=1)
    assert [e.effects for e in loop.explanations.likeliest_first] == [("giesekus_mobility",)]
