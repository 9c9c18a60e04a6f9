"""Effects that are declared are part of the model, before and after, and no finding."""

import numpy as np
import pytest
from independent import Giesekus, start_up
from independent.noise import white

from discover.dataset import Dataset, Run
from discover.effects import known_effects
from discover.errors import InputError
from discover.forward import DeclaredModel
from discover.loop import run_loop
from discover.protocols import start_up as commanded

MOBILITY, GAIN = 0.3, -0.1
CANDIDATES = ["giesekus_mobility", "ptt_linear", "stress_gain"]
pytestmark = pytest.mark.usefixtures("without_curves", "verdict_alone")


@pytest.fixture(scope="module")
def data():
    """Start-ups of a Giesekus fluid whose stress is read ten per cent too small, 1 % noise."""
    times, rng, runs = np.geomspace(0.05, 8.0, 40), np.random.default_rng(2), []
    for rate in (0.2, 0.6, 2.0, 4.0):
        stress = (1.0 + GAIN) * Giesekus(MOBILITY).respond(start_up(rate), times).sigma12
        recorded = white(stress, 0.01, rng)
        runs.append(Run(f"{rate:g}", times, commanded(rate), np.full(40, rate), recorded))
    return Dataset("weak transducer", tuple(runs))


def closed(data, effects):
    declared = DeclaredModel.maxwell(1.0, 1.0, effects=known_effects(effects))
    return run_loop(data, declared, effects=CANDIDATES, max_effects=2, explanations=1)


@pytest.fixture(scope="module")
def fitted(data):
    return closed(data, {"stress_gain": "fit"})


@pytest.fixture(scope="module")
def known(data):
    return closed(data, {"stress_gain": {"gain_error": GAIN}})


def test_a_known_effect_is_not_found_again(fitted, known):
    for result in (fitted, known):
        assert [stage.effect for stage in result.stages] == ["giesekus_mobility"]
        alpha = result.stages[0].parameters["alpha"]
        assert alpha.ci95[0] <= MOBILITY <= alpha.ci95[1]
    (effect,) = known.declared_effects
    assert effect.parameters["gain_error"].ci95 is None
    assert effect.parameters["gain_error"].value == GAIN


def test_one_to_be_fitted_is_reported_with_its_interval(fitted):
    (effect,) = fitted.declared_effects
    low, high = effect.parameters["gain_error"].ci95
    assert low <= GAIN <= high
    assert high - low < 0.07  # 1 % noise on 160 samples, and a gain that is sound to 1 %
    said = fitted.to_json()["declared"]
    assert said["effects"][0]["effect"] == "stress_gain"
    assert said["law"]["terms"] == []


def test_the_error_before_has_the_known_effects_in_it(data, known):
    slow = data.runs[0]
    without = 0.2 * -np.expm1(-slow.time)  # a Maxwell fluid of G = 1 Pa and λ = 1 s in start-up
    assert np.linalg.norm(without - slow.stress) / np.linalg.norm(slow.stress) > 0.08
    # in slow flow that fluid and the gain are all there is
    assert known.records[0].errors[0] < 0.04


def test_what_shapes_a_command_is_refused_where_the_rate_was_measured(data):
    measured = Dataset("m", tuple(_measured(run) for run in data))
    with pytest.raises(InputError, match="measured at the tool"):
        closed(measured, {"rate_rise_time": {"tau": 0.02}})


def _measured(run):
    return Run(run.name, run.time, run.protocol, run.rate, run.stress, rate_is_measured=True)
