"""Which laws by mode are fitted on all samples, and which are told: with fits that are made up."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from discover.comparison.fitting import law_by_mode
from discover.comparison.fitting.law_by_mode import SparseLaw, fit_laws_by_mode
from discover.inference.by_mode.degrees import Degree

from discover.dataset import Run
from discover.protocols.protocol import start_up
from discover.statistics import LackOfFit
from discover.statistics.residual import Expectation

NAME, SLIP, NOISE = "giesekus_mobility", "non_affine_motion", 0.01
UNFITTED: Any = None  # the declared model, of which nothing is asked here


@pytest.fixture
def made_up(monkeypatch, as_users_run_it):
    """Sets of terms that are ranked without a fit, each so far behind, and laws that are made up.

    Keeps how many samples each ranking was given, and of which sets.
    """
    behind = {("giesekus_mobility",): 0.0, ("ptt_linear",): 3.0, (SLIP,): 30.0}
    fit, asked = SimpleNamespace(usable=True, theta=np.zeros(1), free=[0]), []
    monkeypatch.setattr(law_by_mode, "_NAMED", tuple(behind))

    def problem_of(model, names, runs, n_candidates):
        del model, names, n_candidates
        return SimpleNamespace(
            samples=sum(map(len, runs)), model=None, batch=None, fit=lambda *_: fit,
            worth=lambda *_: 0.0, lack_of_fit=lambda *_: LackOfFit("", NOISE, NOISE, 0.0, 0.0),
        )  # fmt: skip

    def ranked(problem, sets):
        asked.append((problem.samples, list(sets)))
        found = [law_by_mode._Ranked(fit, {of[0]: Degree(1)}, behind[of], 1.0) for of in sets]
        return sorted(found, key=lambda one: one.behind)

    def with_more(problem, fit, degrees, least):
        del problem, degrees
        return fit, {name: Degree(degree) for name, degree in least.items()}

    for place, instead in {
        "problem_by_mode": problem_of,
        "_best_first": ranked,
        "_worth_of": lambda *_: 0.0,
        "fitted_readings": lambda *_: [],
        "told_by_mode": lambda problem, fit, degrees, *_: ({**degrees}, {}),
        "one_degree_more": lambda model, degrees: {
            name: one.degree + 1 for name, one in degrees.items() if one.degree < 3
        },
        "choose_degrees": with_more,
    }.items():
        monkeypatch.setattr(law_by_mode, place, instead)
    return asked


def of_made_up(samples=60, **options):
    runs = [
        Run("a", times, start_up(1.0), np.ones(samples), np.ones(samples))
        for times in [np.linspace(0.1, 1.0, samples)]
    ]
    asked = runs, [], Expectation(), 64
    return fit_laws_by_mode(UNFITTED, [], SparseLaw([], 0, []), *asked, **options)


def test_sets_of_terms_far_behind_on_few_samples_are_not_fitted_on_all(made_up):
    close = [("giesekus_mobility",), ("ptt_linear",)]
    found = next(of_made_up(samples=200))
    (few, ranked), (every, fitted_on_all) = made_up
    assert (few, every) == (60, 200)
    assert set(ranked) == {*close, (SLIP,)}
    assert fitted_on_all == close
    assert found.left_out.startswith("1 of 3 sets of terms were ranked on at most 60 samples")
    # controls: who asks for it has all fitted on all, and of few samples none is left out
    for options in ({"samples": 200, "ranks_on_all": True}, {"samples": 60}):
        made_up.clear()
        assert not next(of_made_up(**options)).left_out
        ((_, fitted_on_all),) = made_up
        assert set(fitted_on_all) == {*close, (SLIP,)}


@pytest.mark.usefixtures("made_up")
def test_a_law_of_more_degrees_that_runs_away_in_a_run_held_out_is_not_told(monkeypatch):
    def degrees(*errors):
        told = iter(errors)
        monkeypatch.setattr(law_by_mode, "_errors", lambda *_: {"held": next(told)})
        return [one.constants[NAME].degree for one in of_made_up()]

    assert degrees(0.02, None, None) == [1]
    assert degrees(None, None, None) == [1]  # the first is told whatever it does there
    assert degrees(0.02, 0.02, None) == [1, 2]
    # the control
    assert degrees(0.02, 0.02, 0.02) == [1, 2, 3]
