"""Steps in pieces, which end early once steady; answers by scipy on full tensors."""

import numpy as np
import pytest
from independent import Giesekus, JohnsonSegalman, PhanThienTanner, Structured, steps
from vectors import vector_of

from discover.dataset import Run
from discover.effects import make_effect
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.forward.side_by_side.kernel import Kernel
from discover.protocols import after_steady_flow, start_up

BEFORE, AFTER = 5.0, 0.5
TIMES = np.geomspace(1e-3, 30.0, 50)


def run(before, after, times=TIMES):
    """Return a run from one rate to another, and how long the first had been held."""
    flow = after_steady_flow(start_up(after), before, end=float(times[-1]))
    ones = np.ones(times.size)
    return Run("step", times, flow, after * ones, ones, rate_before=before), -float(flow.begins)


def counted(monkeypatch):
    """Return the list to which every call adds the steps that it took."""
    taken, call = [], Kernel.__call__

    def counting(self, *arguments):
        before = self.steps_taken
        found = call(self, *arguments)
        taken.append(self.steps_taken - before)
        return found

    monkeypatch.setattr(Kernel, "__call__", counting)
    return taken


LAWS = {
    "ptt_exponential": ({"epsilon": 0.3}, PhanThienTanner(0.3, "exponential")),
    "ptt_linear": ({"epsilon": 5.8}, PhanThienTanner(5.8)),
    "giesekus": ({"alpha": 0.3}, Giesekus(0.3)),
    "johnson_segalman": ({"xi": 0.2}, JohnsonSegalman(0.2)),
}


@pytest.mark.parametrize(
    # the two that err most: a law that thins fast, and a jump of a hundred
    ("law", "before", "share"),
    [
        ("ptt_linear", BEFORE, 0.23), ("giesekus", 50.0, 0.73),
        *(pytest.param(law, BEFORE, share, marks=pytest.mark.slow)
          for law, share in (("ptt_exponential", 0.26), ("giesekus", 0.36),
                             ("johnson_segalman", 0.56))),
    ],
)  # fmt: skip
def test_a_run_from_a_steady_flow_is_exact_without_the_idle_pieces(law, before, share, monkeypatch):
    parameters, independent = LAWS[law]
    one, held = run(before, AFTER)
    taken, batch = counted(monkeypatch), make_batch([one])
    model = AugmentedModel(DeclaredModel.named(law, parameters, 1.0, 1.0), [])
    found = model.predict(model.zero(), batch)[0]
    exact = independent.respond(steps([0.0, held], [before, AFTER]), held + TIMES).sigma12
    # what the grid's own steps after the jump leave, most where a law thins fast
    most = 3e-5 if law == "ptt_linear" else 3e-6
    np.testing.assert_allclose(found, exact, atol=most * np.max(np.abs(exact)))
    # each law is steady after a time of its own, the sooner the more it thins, Johnson-Segalman,
    # which rings, latest; at 50 the flow before lasts a tenth as long. A fiftieth more is allowed
    assert taken[0] < share * int(np.sum(batch.parts[0].pieces))


STRUCTURE = "thixotropic_relaxation_two_times"
CRITICAL, BUILD_UP, SLOWNESS, SHARE = 0.7, 30.0, 8.0, 0.3


def test_a_flow_before_a_run_lasts_as_long_as_it_says():
    """A structure of 240 s is not steady after a minute, and no steady state stands in for it."""
    one, held = run(BEFORE, 0.1)
    model = AugmentedModel(DeclaredModel.maxwell(1.0, 0.4), [make_effect(STRUCTURE)])
    theta = vector_of(model, **{STRUCTURE: (1.0 / CRITICAL, BUILD_UP, SLOWNESS, SHARE)})
    fluid = Structured(
        CRITICAL, (BUILD_UP, SLOWNESS * BUILD_UP), 2.0 / 3.0, SHARE, modulus=1.0,
        relaxation_time=0.4, mobility=0.0,
    )  # fmt: skip

    def exact(held):
        return fluid.respond(steps([0.0, held], [BEFORE, 0.1]), held + TIMES).sigma12

    found, answer = model.predict(theta, make_batch([one]))[0], exact(held)
    size = np.max(np.abs(answer))
    # of second order in time at the jump: tests/effects/test_structure.py
    np.testing.assert_allclose(found, answer, atol=1e-4 * size)
    # the control: held until all is steady
    assert np.max(np.abs(exact(5.0 * held) - answer)) > 1e-2 * size


def test_steps_of_a_vector_do_not_depend_on_those_beside_it():
    one, _ = run(BEFORE, AFTER)
    model = AugmentedModel(
        DeclaredModel.maxwell(1.0, 1.0), [make_effect("giesekus_mobility"), make_effect(STRUCTURE)]
    )
    rng = np.random.default_rng(5)
    thetas = np.tile(model.zero(), (8, 1))
    thetas[:, 1] = rng.uniform(-3.0, 3.0, 8)
    thetas[:, model.positions("giesekus_mobility")[0]] = rng.uniform(0.05, 0.5, 8)
    batch = make_batch([one])
    together = model.predictions(thetas, batch)
    alone = [model.predict(theta, batch) for theta in thetas]
    # all are followed until the last is steady, to 1e-9
    np.testing.assert_allclose(together, alone, rtol=1e-9, atol=1e-13)


def test_a_signal_altered_by_nothing_is_the_signal():
    one, _ = run(BEFORE, AFTER)
    names = "transducer_lag", "time_delay"
    model = AugmentedModel(
        DeclaredModel.named("ptt_exponential", {"epsilon": 0.3}, 1.0, 1.0),
        [make_effect(name) for name in names],
    )
    batch = make_batch([one])
    plain = model.predict(model.zero(), batch)
    for name in names:
        theta = vector_of(model, **{name: 1e-12})
        np.testing.assert_allclose(model.predict(theta, batch), plain, rtol=1e-8)


def test_a_vector_that_runs_away_before_the_record_is_told_so():
    one, _ = run(BEFORE, AFTER)
    model = AugmentedModel(DeclaredModel.maxwell(1.0, 1.0), [make_effect("giesekus_mobility")])
    away = vector_of(model, giesekus_mobility=-5.0)
    found = model.predictions([away, model.zero()], make_batch([one]))
    assert not np.any(np.abs(found[0]) < 1e3)
    fading = AFTER + (BEFORE - AFTER) * np.exp(-TIMES)
    np.testing.assert_allclose(found[1, 0], fading, rtol=1e-9)
