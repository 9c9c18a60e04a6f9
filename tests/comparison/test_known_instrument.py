"""A known instrument is taken out of the records; what cannot be is refused in words."""

from dataclasses import replace

import numpy as np
import pytest
from independent import Giesekus, start_up
from independent.instruments import Instrument
from noisy_runs import run_at, waves

from discover.comparison import compare
from discover.comparison.in_memory import compare as compare_in_memory
from discover.comparison.known_part import known_part, without_instrument
from discover.dataset import Dataset
from discover.errors import InputError
from discover.laws import Fluid, make_law
from discover.learners import LearnerResult, RecoveredTerm
from discover.loop.loop import search
from discover.loop.task import Task
from discover.simulate import simulate
from discover.study import RunFolder, parse_study
from discover.study.data import StudyData
from discover.study.declared_model import forward_model
from discover.study.in_memory import declared_fluid, with_known

MOBILITY, NOISE = 0.3, 0.01


def oscillations(gain: float, offset: float = 0.0) -> Dataset:
    """Return four oscillations whose stress is recorded with a gain, in 1 % noise."""
    pairs, times = ((1.0, 0.5), (2.0, 0.5), (1.0, 1.0), (2.0, 1.0)), np.linspace(0.0, 16.0, 81)
    data = waves(Giesekus(MOBILITY), pairs, times, NOISE, factor=gain)
    return Dataset("planted", tuple(replace(run, stress=run.stress + offset) for run in data))


def start_ups(instrument: Instrument) -> Dataset:
    """Return start-ups as recorded, with the commanded rate as what is known."""
    times, runs = np.geomspace(0.02, 8.0, 40), []
    for rate in (0.5, 2.0):
        recorded = instrument.record(Giesekus(MOBILITY), start_up(rate), times)
        runs.append(run_at(rate, times, recorded.stress))
    return Dataset("slow", tuple(runs))


GIESEKUS = Fluid.dimensionless(make_law("giesekus", {"alpha": MOBILITY}))


def divided(data):
    return StudyData(data, data, data.select([]))


def taken_out(data, effects, of_fluid=("giesekus_mobility",)):
    """Return data without known effects, beside what a short search finds, and what these did."""
    declared = with_known(declared_fluid(Fluid(), data), effects)
    task = Task.of_runs(data, forward_model(declared), effects=of_fluid, max_effects=1)
    ended = search(task).ended()
    return without_instrument(divided(data), ended, declared.effects, ended.fit.theta)


def taken(data, effects):
    """Return what learners are given where effects are known."""
    declared = with_known(declared_fluid(Fluid(), data), effects)
    task = Task.of_runs(data, forward_model(declared), effects=["stress_offset"], max_effects=0)
    return known_part(declared, search(task).ended(), divided(data), (), ())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("instrument", "effect"),
    [(Instrument(rise_time=0.2), "rate_rise_time"), (Instrument(lag=0.2), "transducer_lag")],
    ids=["motor", "transducer"],
)
def test_what_a_slow_motor_or_transducer_did_is_taken_out(instrument, effect):
    data = start_ups(instrument)
    for found, limit in ((taken_out(data, {effect: {"tau": 0.2}})[0].fit, 3e-3), (data, 0.1)):
        worst = 0.0
        for run in found:
            stress = simulate(GIESEKUS, run.protocol, run.time).shear_stress
            worst = max(worst, np.max(np.abs(stress - run.stress)) / np.max(np.abs(stress)))
        # the law is fitted to records without noise; as recorded the start is missed by far
        assert bool(worst < limit) is (found is not data)


def test_gain_and_offset_are_undone_to_the_noise_that_the_law_leaves():
    data = oscillations(gain=1.25, offset=0.1)
    found, added = taken_out(
        data, {"stress_gain": {"gain_error": 0.25}, "stress_offset": {"offset": 0.1}}
    )
    for before, after in zip(data, found.fit, strict=True):
        np.testing.assert_allclose(after.stress + added[after.name]["sigma12"], before.stress)
        exact = (before.stress - 0.1) / 1.25
        # a quarter of the noise, which the law does not follow; five deviations
        size = NOISE * float(np.sqrt(np.mean(before.stress**2)))
        np.testing.assert_allclose(after.stress, exact, atol=5.0 * 0.2 * size)
        assert after.protocol is before.protocol


def test_a_known_effect_of_the_fluid_becomes_its_law_its_modes_and_its_solvent():
    data = oscillations(gain=1.0)
    effects = {
        "giesekus_mobility": {"alpha": 0.2},
        "relaxation_mode": {"G": 2.0, "lambda": 5.0},
        "solvent_viscosity": {"eta_s": 0.3},
        "stress_gain": {"gain_error": 0.1},
    }
    found = taken(data, effects).model
    assert [(t.term, t.coefficient) for t in found.law.as_terms()] == [("sigma.sigma", 0.2)]
    assert found.modulus.tolist() == [1.0, 2.0]
    assert found.relaxation_time.tolist() == [1.0, 5.0]
    assert found.solvent_viscosity == pytest.approx(0.3)
    assert [known.name for known in taken(data, effects).effects] == ["stress_gain"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effects", "words"),
    [
        ({"viscous_heating": {"heating": 1e-7, "heat_loss_time": 1.0}}, "a state that no law"),
        ({"yield_stress": {"yield_strain": 0.1}}, "not a sum of library terms"),
    ],
)
def test_what_a_learner_cannot_be_told_is_refused(effects, words):
    with pytest.raises(InputError, match="compare cannot take") as caught:
        taken(oscillations(gain=1.0), effects)
    assert words in str(caught.value)


def test_an_effect_of_no_size_is_none_and_refused_by_nobody():
    effects = {"tool_compliance": {"compliance": 0.0}, "transducer_lag": {"tau": 0.0}}
    assert taken(oscillations(gain=1.0), effects).effects == ()


def trained(learner, study, model, runs, seed=0, progress=None, library=None):
    law = make_law("giesekus", {"alpha": MOBILITY})
    term = RecoveredTerm("sigma.sigma", MOBILITY, coefficient_penalised=MOBILITY, ci95=(0.29, 0.31))
    result = LearnerResult(learner, law, (term,), 1.5, {"rivals": []}, "fake")
    return result, Fluid(law, model.modulus, model.relaxation_time)


def compared(data, store=None, **model):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("discover.comparison.learning.train", trained)
        asked = {"data": {"folder": "f"}, "compare": {"library": {"degree": 0}}, "model": model}
        study, known = parse_study(asked), (model.get("effects"), model.get("free", ()))
        declared = with_known(declared_fluid(Fluid(), data), *known)
        whole = StudyData(data, data.select(data.names[1:]), data.select(data.names[:1]))
        return compare(study, data=whole, declared=declared, store=store)


@pytest.fixture(scope="module")
def weak():
    return oscillations(gain=0.9)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("kept")


@pytest.fixture(scope="module")
def with_gain(weak, folder):
    """Both learners with the gain fitted along, kept in a folder."""
    return compared(weak, RunFolder(folder / "out", "print"), effects={"stress_gain": "fit"})


@pytest.mark.slow
def test_both_learners_see_records_without_the_gain_and_resume_the_same(weak, with_gain, folder):
    known = compared(weak, effects={"stress_gain": {"gain_error": -0.1}})
    for found in (with_gain, known):
        for name in ("tensor_sindy", "tbnn_ude"):
            for flow in [*found.flows_of("training"), *found.unseen_flows]:
                # the noise, and a gain that is known to a fraction of it
                assert found.errors(name, flow)["sigma12"] == pytest.approx(0.01, rel=0.35)
    again = compared(weak, RunFolder(folder / "out", "print"), effects={"stress_gain": "fit"})
    assert again.to_json()["learners"] == with_gain.to_json()["learners"]


@pytest.mark.slow
def test_without_the_gain_the_same_law_misses_by_it_and_python_takes_what_a_study_does(weak):
    found = compared(weak)
    (flow,) = found.unseen_flows
    before = found.errors("before", flow)["sigma12"]
    assert before > 0.09  # the gain is 10 %
    # the learner is given records without it
    assert found.errors("tensor_sindy", flow)["sigma12"] == pytest.approx(0.01, rel=0.35)
    # a gain that nobody declared is found all the same
    assert "stress_gain" in [stage.effect for stage in found.posterior.stages]
    options = {"learners": ["tensor_sindy"], "library": {"degree": 0}, "held_out": weak.names[:1]}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("discover.comparison.learning.train", trained)
        found = compare_in_memory(weak, known_effects={"stress_gain": "fit"}, **options)
        factor = compare_in_memory(weak, free=["modulus_Pa"], **options)
    (gain,) = [e for e in found.posterior.declared_effects if e.effect == "stress_gain"]
    low, high = gain.parameters["gain_error"].ci95
    assert low <= -0.1 <= high
    modulus = factor.posterior.declared_parameters["modulus_Pa"]
    assert modulus.ci95[0] <= 0.9 <= modulus.ci95[1]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"free": ["alpha"]}, "'alpha' cannot be fitted: the base has modulus_Pa"),
        ({"free": "modulus_Pa"}, "free must be a list"),
        ({"known_effects": {"stress_gain": {"gain": 1.0}}}, "no parameter 'gain'"),
    ],
)
def test_python_says_what_is_wrong_before_anything_is_fitted(weak, options, words):
    with pytest.raises(InputError) as caught:
        compare_in_memory(weak, **options)
    assert words in str(caught.value)


@pytest.mark.parametrize("name", ["normal_force_gain", "stress_gain"])
def test_a_gain_is_taken_out_of_what_its_transducer_read(name):
    times, rate = np.linspace(0.1, 4.0, 20), 1.0
    seen = Giesekus(MOBILITY).respond(start_up(rate), times)
    of_force = name == "normal_force_gain"
    torque, force = (1.0, 1.15) if of_force else (1.15, 1.0)
    run = run_at(rate, times, torque * seen.sigma12, first_normal_stress_difference=force * seen.N1)
    (found,) = taken_out(Dataset("one", (run,)), {name: {"gain_error": 0.15}})[0].fit
    for read, exact in (
        (found.stress, seen.sigma12), (found.first_normal_stress_difference, seen.N1)
    ):  # fmt: skip
        # a law fitted to 20 samples without noise
        np.testing.assert_allclose(read, exact, atol=5e-3 * np.max(exact))
