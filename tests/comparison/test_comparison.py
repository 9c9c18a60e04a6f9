"""Comparing learners: errors, how parts side by side end, and one answer with `close-loop`."""

import threading
from dataclasses import replace

import numpy as np
import pytest
from independent import Giesekus, multimode_giesekus, oscillation, start_up
from independent.folders import write_folder
from independent.instruments import Instrument
from independent.noise import white

import discover as dc
from discover.comparison import relative_errors
from discover.comparison.flows import true_terms
from discover.comparison.learning import at_once
from discover.progress import Stopped, require_wanted, silent


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
def test_true_terms_are_those_of_the_law_and_of_a_relaxation_that_is_not_known(
    law, parameters, terms
):
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
        at_once({"goes on": goes_on, "fails": fails}, silent)
    assert ended == [True]


def test_an_interrupt_of_the_caller_ends_all_parts():
    def goes_on(say):
        while True:
            threading.Event().wait(0.001)
            say("at work", 0.0)

    def interrupted(text, fraction):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        at_once({"one": goes_on, "other": goes_on}, interrupted)


MODULUS, MOBILITY = 100.0, 0.3
FLOWS = {
    "up.csv": (start_up(1.0), 6.0),
    "fast_up.csv": (start_up(3.0), 5.0),
    "wide.csv": (oscillation(3.0, 0.5), 14.0),
}
HELD_OUT = {"faster_up.csv": (start_up(5.0), 4.0)}
EFFECTS = ["giesekus_mobility", "stress_gain", "ptt_linear"]


def asked(tmp_path, material, recorded):
    """Return what both say of a material whose stress is recorded so, told a Maxwell fluid."""
    generator = np.random.default_rng(5)
    runs = {}
    for name, (flow, end) in {**FLOWS, **HELD_OUT}.items():
        record = Instrument().record(material, flow, np.linspace(0.02, end, 60))
        runs[name] = replace(record, stress=recorded(record.stress, generator))
    data = dc.load_dataset(write_folder(tmp_path / "data", runs))
    base = dc.Fluid(dc.make_law("ucm"), MODULUS, 1.0)
    compared = dc.compare(
        data, base, held_out=list(HELD_OUT), learners=["tensor_sindy"], library={"degree": 0}
    )
    looped = dc.close_loop(
        data, base, held_out=list(HELD_OUT), effects=EFFECTS, max_effects=2, explanations=1
    )
    return compared, looped


def noisy(stress, generator):
    return white(stress, 0.01, generator)


@pytest.mark.slow
def test_of_two_modes_told_one_neither_has_an_explanation_and_in_noise_no_signal(tmp_path):
    two = multimode_giesekus([0.1, 0.6], [60.0, 40.0], [1.0, 0.3])
    compared, looped = asked(tmp_path, two, noisy)
    assert (compared.verdict, looped.verdict) == ("unexplained", "unexplained")
    compared, looped = asked(
        tmp_path, Giesekus(MOBILITY), lambda s, g: 5.0 * g.standard_normal(len(s))
    )
    assert (compared.verdict, looped.verdict) == ("no_signal", "no_signal")
    assert compared.lack_of_fit["tensor_sindy"].verdict == "no_signal"
