"""Runs of unlike noise, fitted together: each weighs by its own."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from independent import Giesekus, Structured, start_up

import discover as dc
from discover.loop import own_noise

MOBILITY, MODULUS, TIME = 0.3, 100.0, 1.0
NOISES = {0.5: 0.06, 2.0: 0.06, 5.0: 0.002}
"""Relative noise of each start-up, by its rate in 1/s: slow flows hardly move the transducer."""

TIMES = np.linspace(0.05, 8.0, 80)


def loop_on(material):
    """Return the loop on start-ups by scipy, each with its own noise."""
    rng, runs = np.random.default_rng(3), []
    for rate, noise in NOISES.items():
        stress = material.respond(start_up(rate), TIMES).sigma12
        stress = stress + noise * np.sqrt(np.mean(stress**2)) * rng.standard_normal(len(TIMES))
        runs.append(dc.Run(f"{rate:g}.csv", TIMES, dc.start_up(rate), 0 * TIMES + rate, stress))
    return dc.close_loop(
        dc.Dataset("unlike noise", tuple(runs)),
        dc.Fluid(dc.make_law("ucm"), MODULUS, TIME),
        effects=["giesekus_mobility"],
        max_effects=1,
        explanations=1,
    )


def deviation() -> float:
    """Return the least standard deviation of α that any unbiased fit has, by scipy's derivative."""
    step, information = 0.01, 0.0
    for rate, noise in NOISES.items():
        low, own, high = (
            Giesekus(MOBILITY + d, MODULUS, TIME).respond(start_up(rate), TIMES).sigma12
            for d in (-step, 0.0, step)
        )
        slope = (high - low) / (2.0 * step) / np.sqrt(np.mean(own**2))
        information += float(slope @ slope) / noise**2
    return 1.0 / np.sqrt(information)


def test_a_quiet_run_beside_loud_ones_is_explained_and_tells_as_much_as_it_can():
    loop = loop_on(Giesekus(MOBILITY, MODULUS, TIME))
    assert loop.verdict == "effects_added"
    alpha = loop.stages[0].parameters["alpha"]
    assert alpha.ci95[0] < MOBILITY < alpha.ci95[1]
    assert abs(alpha.value - MOBILITY) < 3.0 * deviation()
    # how the one quiet run was read is known to 0.5 to 2 %, which is some 2 % of the mobility
    assert alpha.ci95[1] - alpha.ci95[0] < 0.1 * MOBILITY


def test_with_equal_weights_loud_runs_move_the_constant(monkeypatch):
    monkeypatch.setattr(own_noise, "weights_by_noise", lambda *_: None)
    loop = loop_on(Giesekus(MOBILITY, MODULUS, TIME))
    assert abs(loop.stages[0].parameters["alpha"].value - MOBILITY) > 0.5 * deviation()


@dataclass(frozen=True)
class TaskOf:
    """A search that finds given effects, and what is left is noise, with weights by noise alone."""

    effects: tuple[str, ...]
    fitted: tuple[dc.Run, ...]
    name: str = "search"
    silent: bool = False

    def say(self, line: str) -> None:
        del line

    def search(self, declared, laws):
        rng, weighed = np.random.default_rng(0), any(run.weight != 1.0 for run in self.fitted)
        sizes = np.array([0.05, 0.002])[:, None] / np.sqrt(len(TIMES))
        return SimpleNamespace(
            search=SimpleNamespace(
                active=list(self.effects) if weighed else ["giesekus_mobility"],
                explained=weighed,
                fit=SimpleNamespace(
                    residual=sizes * rng.standard_normal((2, len(TIMES))), usable=True
                ),
                problem=SimpleNamespace(weight=np.ones((2, len(TIMES)))),
            )
        )


@pytest.mark.parametrize(
    ("effects", "kept"),
    [(("giesekus_mobility",), True), ((), True), (("ptt_exponential", "thixotropy"), False)],
)
@pytest.mark.usefixtures("as_users_run_it")
def test_weights_by_noise_bring_in_no_effect_that_equal_weights_did_not_find(effects, kept):
    run = dc.Run("a.csv", TIMES, dc.start_up(1.0), 0 * TIMES + 1.0, TIMES)
    task = TaskOf(effects, (run, replace(run, name="b.csv")))
    _, ended = own_noise.searched_by_noise(task, task.search(None, ()), None, ())
    assert ended.search.explained == kept


def test_weights_by_noise_explain_no_fluid_of_another_kind():
    loop = loop_on(Structured(2.0, (2.0,), in_modulus=True, modulus=MODULUS, mobility=0.0))
    assert loop.verdict == "unexplained"
