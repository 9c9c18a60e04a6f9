"""Comparing learners: errors, how parts end, and flows within the fitted range or beyond it."""

import threading
from dataclasses import replace

import numpy as np
import pytest
from independent import Giesekus
from independent import start_up as flow_at
from independent.noise import white
from scipy.integrate import cumulative_trapezoid

from discover.comparison import compare
from discover.comparison.flows import (
    Flow,
    comparison_flows,
    relative_errors,
    thinned_to,
    true_terms,
    without_spikes_in_fit,
)
from discover.comparison.learning import run_concurrently
from discover.comparison.outcome import place
from discover.comparison.run_comparison import data_in_words
from discover.dataset import Dataset, Run
from discover.dataset.records.thinning import evenly_chosen, followed_rate, thin_run
from discover.laws import Fluid, make_law
from discover.progress import Stopped, require_wanted, silent
from discover.protocols import measured_rate, start_up, strains
from discover.protocols.protocol import in_flow, oscillatory_shear
from discover.study import parse_study
from discover.study.data import StudyData
from discover.study.in_memory import declared_fluid


def test_n2_error_is_relative_to_n1_and_what_was_not_measured_has_no_error():
    reference = {"sigma12": np.ones(4), "N1": 2.0 * np.ones(4), "N2": np.zeros(4)}
    prediction = {"sigma12": 1.1 * np.ones(4), "N1": 2.0 * np.ones(4), "N2": 0.2 * np.ones(4)}
    errors = relative_errors(prediction, reference)
    assert errors["sigma12"] == pytest.approx(0.1)
    assert errors["N1"] == 0.0
    assert errors["N2"] == pytest.approx(0.1)
    errors = relative_errors({"sigma12": np.ones(3), "N1": np.ones(3), "N2": np.ones(3)},
                             {"sigma12": np.ones(3)})  # fmt: skip
    assert errors == {"sigma12": 0.0, "N1": None, "N2": None}
    assert relative_errors(None, {"sigma12": np.ones(3)})["sigma12"] is None


@pytest.mark.parametrize(
    ("law", "parameters", "terms"),
    [
        ("ucm", {}, []),
        ("giesekus", {"alpha": 0.3}, [("sigma.sigma", 0.3)]),
        ("saramito", {"yield_strain": 0.1}, None),
    ],
)
def test_true_terms_are_those_of_the_law_and_of_an_unknown_relaxation(law, parameters, terms):
    for known, more in ((True, []), (False, [("sigma", 1.0)])):
        found = true_terms(law, parameters, known)
        told = None if found is None else [(one.term, one.coefficient) for one in found]
        assert told == (None if terms is None else [*more, *terms])


@pytest.mark.parametrize("says", [True, False])
def test_when_one_part_fails_the_others_end_where_they_say_or_ask_something(says):
    ended = []

    def fails(say):
        raise ValueError("no law")

    def goes_on(say):
        try:
            for _ in range(100_000):
                threading.Event().wait(0.001)
                say("at work", 0.0) if says else require_wanted()
        except Stopped:
            ended.append(True)
            raise

    with pytest.raises(ValueError, match="no law"):
        run_concurrently({"goes on": goes_on, "fails": fails}, silent)
    assert ended == [True]


def test_an_interrupt_of_the_caller_ends_all_parts():
    def goes_on(say):
        while True:
            threading.Event().wait(0.001)
            say("at work", 0.0)

    def interrupted(text, fraction):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_concurrently({"one": goes_on, "other": goes_on}, interrupted)


TIME = np.linspace(0.0, 20.0, 201)


def oscillation(weissenberg, deborah):
    rate = weissenberg * np.cos(deborah * TIME)
    return Flow("osc", "test", oscillatory_shear(weissenberg, deborah), TIME, rate, {})


def started(rate, duration=20.0):
    times = np.linspace(0.0, duration, 201)
    return Flow("start", "test", start_up(rate), times, np.full(201, rate), {})


PAPER = [oscillation(wi, de) for de in (0.25, 0.5, 0.75, 1.0) for wi in (1.0, 2.0)]


def test_flows_are_inside_or_beyond_in_rate_frequency_and_strain():
    assert place(PAPER[3], PAPER).inside
    assert place(oscillation(0.1, 0.9), PAPER).inside
    placed = place(oscillation(3.0, 1.5), PAPER)
    assert placed.beyond == pytest.approx({"shear rate": 1.5, "frequency": 1.5})
    assert placed.text.startswith("beyond the fitted range: shear rate (Wi) 1.5 times")
    # strain 40 against the largest of the eight series, 2/0.25
    placed = place(started(2.0), PAPER)
    assert placed.beyond == pytest.approx({"strain": 5.0}, rel=0.01)
    assert place(started(2.0, duration=3.0), PAPER).inside
    assert place(oscillation(1.0, 5.0), [started(2.0)]).inside
    assert not place(oscillation(1.0, 5.0), PAPER).inside
    placed = place(started(1.0), [started(0.0)])
    assert set(placed.beyond) == {"shear rate", "strain"}


def test_an_extension_is_beyond_wherever_only_shear_was_fitted():
    pull = replace(started(0.1), protocol=in_flow(start_up(0.1), "uniaxial"))
    placed = place(pull, [started(2.0)])
    assert not placed.inside
    said = "beyond the fitted range: uniaxial extension, of which nothing was fitted"
    assert placed.text == said
    assert placed.to_json()["new_flow"] == "uniaxial"
    # among extensions of its own kind it is held against those, whatever the shear was
    faster = replace(started(0.3), protocol=in_flow(start_up(0.3), "uniaxial"))
    assert place(pull, [started(0.01), faster]).inside
    assert place(faster, [started(9.0), pull]).beyond["Hencky rate"] == pytest.approx(3.0)


SAMPLED = np.linspace(0.1, 8.0, 80)
KNOCKS = [20, 45]


def knocked_start_up(rate, knocked):
    exact = Giesekus(0.3, 100.0).respond(flow_at(rate), SAMPLED).sigma12
    stress = white(exact, 0.01, np.random.default_rng(int(10 * rate)))
    stress[KNOCKS] += knocked * np.sqrt(np.mean(exact**2)) * np.array([1.0, -0.6])
    return Run(f"{rate}.csv", SAMPLED, start_up(rate), np.full(80, rate), stress)


def with_knocks(knocked):
    runs = tuple(knocked_start_up(rate, knocked) for rate in (0.5, 2.0, 3.0))
    fit, held = Dataset("fit", runs[:2]), Dataset("held", runs[2:])
    return StudyData(Dataset("all", runs), fit, held)


def test_knocks_are_left_out_of_the_fitted_runs_and_told():
    left, told = without_spikes_in_fit(with_knocks(0.8))
    for one in left.fit.runs:
        np.testing.assert_array_equal(one.time, np.delete(SAMPLED, KNOCKS))
    assert "2 of 0.5.csv, 2 of 2.0.csv" in told
    # what judges is whole
    assert len(left.held_out.runs[0]) == len(SAMPLED)


@pytest.mark.parametrize("knocked", [0.0, 0.01])
def test_of_a_record_without_a_knock_nothing_is_left_out(knocked):
    whole = with_knocks(knocked)
    left, told = without_spikes_in_fit(whole)
    assert left is whole
    assert told == ""


class _Seen(Exception):
    """What a learner was given; nothing is trained."""


def oscillations(samples: int, count: int = 2) -> StudyData:
    """Return a record of a linear fluid to fit and one to judge: stress in phase and out of it."""
    times = np.linspace(0.01, 20.0, samples)
    runs = []
    for i in range(count):
        rates = (1.0 + i) * np.cos(times)
        flow = measured_rate(times, rates)
        runs.append(Run(f"{i}.csv", times, flow, rates, 0.5 * (rates + (1.0 + i) * np.sin(times))))
    dataset = Dataset("waves", tuple(runs))
    return StudyData(dataset, dataset.select(["0.csv"]), dataset.select(["1.csv"]))


@pytest.mark.parametrize(("options", "expected"), [({}, 1000), ({"most_samples": 150}, 150)])
def test_learners_are_given_no_more_samples_than_a_study_allows(monkeypatch, options, expected):
    def given(learner, study, model, runs, *rest):
        raise _Seen([len(run) for run in runs])

    monkeypatch.setattr("discover.comparison.learning.train", given)
    # what else could explain the runs is not looked for: it changes no run
    monkeypatch.setattr("discover.comparison.hypotheses.MOST_EFFECTS", 0)
    monkeypatch.setattr("discover.loop.loop.simple_material_result", lambda *_: None)
    compared = {"learners": ["tensor_sindy"], "high_deborah": [1.5], **options}
    study = parse_study({"data": {"folder": "waves"}, "compare": compared})
    data = oscillations(2001)
    declared = declared_fluid(Fluid(make_law("ucm"), 1.0, 1.0), data.dataset)
    with pytest.raises(_Seen) as seen:
        compare(study, data=data, declared=declared)
    assert set(seen.value.args[0]) == {expected}


def test_a_thinned_record_is_said_and_follows_the_same_strain_and_a_short_one_is_left():
    data = oscillations(3000)
    study = parse_study({"data": {"folder": "waves"}})
    assert "3000 samples" in data_in_words(data, study)
    thinned = thinned_to(data, 400)
    assert "0.csv, 1.csv: kept 400 of 3,000 samples" in data_in_words(thinned, study)
    for run in (*thinned.fit, *thinned.held_out):
        strain = strains(run.protocol, run.time[-1:]).item()
        amplitude = float(run.name[0]) + 1.0
        # before the first sample, the first rate
        assert strain == pytest.approx(amplitude * np.sin(20.0), abs=1e-3)
    whole = data.fit["0.csv"]
    kept = np.isin(whole.time, thinned.fit["0.csv"].time)
    np.testing.assert_array_equal(whole.recorded[kept], thinned.fit["0.csv"].recorded)
    run = replace(oscillations(600).fit["0.csv"], metadata={"thinned": "kept 600 of 9,000 samples"})
    said = thin_run(thin_run(run, 300), 100).metadata["thinned"]
    assert said == (
        "kept 600 of 9,000 samples; of these kept 300 of 600 samples, evenly in their order; "
        "of these kept 100 of 300 samples, evenly in their order"
    )
    data = oscillations(400)
    thinned = thinned_to(data, 400)
    assert all(one is other for one, other in zip(data.fit, thinned.fit, strict=True))
    assert "kept" not in data_in_words(thinned, parse_study({"data": {"folder": "waves"}}))


def test_a_ringing_rate_keeps_the_knots_that_it_needs_also_where_an_outlier_stood():
    times = np.linspace(0.0, 20.0, 4001)
    ringing = np.cos(times) + np.exp(-5.0 * times) * np.cos(60.0 * times)
    strain = np.sin(times) + np.real((np.exp((-5.0 + 60.0j) * times) - 1.0) / (-5.0 + 60.0j))
    keep = evenly_chosen(len(times), 150)
    knots, rates = followed_rate(times, ringing, keep)
    followed = cumulative_trapezoid(rates, knots, initial=0.0)
    # 0.1 % of the range is what it may be off at all samples; at every 27th alone it is off by 1 %
    assert np.max(np.abs(followed - np.interp(knots, times, strain))) < 1e-3 * np.ptp(strain)
    some = cumulative_trapezoid(ringing[keep], times[keep], initial=0.0)
    assert np.max(np.abs(some - strain[keep])) > 5e-3 * np.ptp(strain)
    assert np.sum(keep) < len(knots) < 500
    # where it rings, twice as close as spread evenly
    assert np.mean(knots < 1.0) > 2.0 / 20.0
    times = np.linspace(0.0, 10.0, 201)
    keep = evenly_chosen(len(times), 21)
    keep[[0, -1]] = False
    knots, rates = followed_rate(times, np.sin(times), keep)
    assert (knots[0], knots[-1]) == (0.0, 10.0)
    # the strain is right to 0.1 % of its range, 1 − cos from 0 to 2
    strain = cumulative_trapezoid(rates, knots, initial=0.0)
    assert np.max(np.abs(strain - (1.0 - np.cos(knots)))) < 2e-3


def recorded(name, rate):
    stress = 1.0 - np.exp(-TIME)
    return Run(
        name, TIME, start_up(rate), np.full(201, rate), stress,
        first_normal_stress_difference=rate * stress**2,
    )  # fmt: skip


@pytest.mark.parametrize("fitted", [True, False])
def test_a_normal_stress_that_is_a_record_of_its_own_stands_once(fitted):
    data = Dataset("both", (recorded("slow", 0.1), recorded("fast", 0.2))).quantity_by_quantity()
    fit, held_out = ["slow"], ["fast", "fast (N1)"]
    (fit if fitted else held_out).append("slow (N1)")
    divided = StudyData(data, data.select(fit), data.select(held_out))
    flows = {flow.name: flow for flow in comparison_flows(divided, ())}
    # fitted or tested as the σ12 of its run is, it is in that flow, else in one of its own
    assert set(flows) == {"slow", "fast"} | (set() if fitted else {"slow (N1)"})
    assert ("N1" in flows["slow"].reference) is fitted
    assert "N1" in flows["fast"].reference


def test_a_normal_stress_is_not_compared_where_no_fluid_can_have_it():
    run = recorded("slow", 1.0)
    early = TIME < 0.5  # more than the elastic limit, stress × strain, at strains below 0.5
    bad = np.where(early, 5.0, run.first_normal_stress_difference)
    data = Dataset("lag", (replace(run, first_normal_stress_difference=bad),))
    (flow,) = comparison_flows(StudyData(data, data, Dataset("none", ())), ())
    assert np.all(np.isnan(flow.reference["N1"][early]))
    true = {"sigma12": run.stress, "N1": run.first_normal_stress_difference, "N2": 0.0 * TIME}
    assert relative_errors(true, flow.reference)["N1"] == 0.0
