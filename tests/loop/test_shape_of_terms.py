"""Terms of the library in what a model leaves of runs that are loadings: in closed form."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from discover.closed_loop.judging import terms_beside
from discover.closed_loop.judging.terms_beside import judged_beside_terms
from discover.statistics.reading.reading_faults import Reading

pytestmark = pytest.mark.usefixtures("as_users_run_it")  # what stands for a model is none

TIMES = np.linspace(0.1, 8.0, 80)
RATES = (0.5, 1.0, 2.0)
STRESS = [rate * -np.expm1(-TIMES) for rate in RATES]
# of Maxwell in start-up: what a constant of the law does, and what a term that it lacks does
KNOWN = [rate * TIMES * np.exp(-TIMES) for rate in RATES]
LACKED = [rate**3 * np.exp(-TIMES) * TIMES**2 for rate in RATES]
NOISE = 0.01


def refutes(monkeypatch, size, noise=None, resolution=0.0, term=LACKED):
    """Whether terms refute a model that leaves so much of what one of them does, and noise."""
    lot, readings = np.random.default_rng(3), []
    for stress, known, lacked in zip(STRESS, KNOWN, term, strict=True):
        left = NOISE * np.sqrt(np.mean(stress**2)) * lot.standard_normal(len(TIMES))
        # each record is a loading of its own: its factor is left open
        columns = np.stack([known, stress])
        readings.append(Reading(TIMES, stress, left + size * lacked, columns))
    weights = [one.weight for one in readings]
    change = np.concatenate([w * own for w, own in zip(weights, term, strict=True)])
    monkeypatch.setattr(
        terms_beside, "_of_terms", lambda *_: (change / np.linalg.norm(change))[None]
    )
    judgement: Any = SimpleNamespace(
        explains=True, description="", refuted=lambda text, reason, advice: reason
    )
    tolerated: Any = SimpleNamespace(
        expectation=SimpleNamespace(noise=noise),
        resolution=SimpleNamespace(limit=lambda *_: resolution),
    )
    model: Any = None
    runs: Any = readings
    said = judged_beside_terms(judgement, model, model, np.zeros(0), (), runs, readings, tolerated)
    return "follows terms of the library" in str(said)


def test_what_follows_a_term_that_the_model_lacks_refutes_it(monkeypatch):
    assert refutes(monkeypatch, 0.003)


def test_control_noise_refutes_nothing(monkeypatch):
    assert not refutes(monkeypatch, 0.0)


def test_a_noise_that_is_given_may_hold_it(monkeypatch):
    assert not refutes(monkeypatch, 0.003, noise=NOISE)


def test_what_arithmetic_leaves_is_no_term(monkeypatch):
    assert not refutes(monkeypatch, 0.003, resolution=1.0)


def test_a_term_that_does_what_a_constant_does_is_not_asked(monkeypatch):
    assert not refutes(monkeypatch, 0.003, term=KNOWN)
