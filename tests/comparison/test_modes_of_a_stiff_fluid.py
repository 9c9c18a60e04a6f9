"""A mode that relaxes in a hundredth of a second, fitted to steps held for a minute; by scipy."""

from dataclasses import replace

import numpy as np
import pytest
from discover.comparison.instrument import FittedAlong, before_learning
from discover.comparison.instrument.before_learning import CLASSICAL_EFFECTS
from independent import PhanThienTanner, steps

import discover as dc
from discover.laws.expansion import law_of_terms
from discover.learners import LearnerResult, RecoveredTerm
from discover.study.data import StudyData
from discover.study.in_memory import declared_fluid
from tensor_library.law_terms import LawTerms
from tensor_library.library import TermLibrary
from tensor_library.terms import parse_term


@pytest.fixture(autouse=True)
def two_classical_laws(monkeypatch):
    """The law of the fluid and another: each is fitted from many starts."""
    few = {name: CLASSICAL_EFFECTS[name] for name in ("giesekus", "ptt_linear")}
    monkeypatch.setattr(before_learning, "CLASSICAL_EFFECTS", few)


MODULUS, TIME, EXTENSIBILITY = 2.0, 0.03, 16.0
LIBRARY = TermLibrary((parse_term("sigma.sigma"), parse_term("tr(sigma)*sigma")))


def held(extensibility, noise=0.01):
    """From steady flow at one rate to another, which is held for half a minute."""
    law = PhanThienTanner(extensibility, modulus=MODULUS, relaxation_time=TIME)
    generator, settled, runs = np.random.default_rng(0), 200.0 * TIME, []
    times = np.geomspace(1e-3, 30.0, 50)
    for before, after in ((20.0, 0.5), (0.5, 20.0), (0.5, 8.0)):
        exact = law.respond(steps([0.0, settled], [before, after]), settled + times).sigma12
        off = noise * np.sqrt(np.mean(exact**2)) * generator.standard_normal(times.size)
        rate, name = np.full(times.size, after), f"from_{before:g}_to_{after:g}"
        flow = dc.start_up(after)
        runs.append(dc.Run(name, times, flow, rate, exact + off, rate_before=before))
    return dc.Dataset("steps", tuple(runs))


def along(data):
    fluid = dc.Fluid(dc.make_law("ucm"), 1.0, 0.3)
    declared = replace(declared_fluid(fluid, data), free=("modulus_Pa", "relaxation_time_s"))
    return FittedAlong(declared, StudyData(data, data, data.select([])), LIBRARY)


@pytest.mark.slow
def test_the_law_is_found_with_its_modulus_and_its_time():
    fitted = along(held(3.0))
    fit, free = fitted.before.classical["ptt_linear"], fitted.constants
    constants = [free.value_of(name, raw) for name, raw in free.raw(fit.theta).items()]
    assert constants == pytest.approx([MODULUS, TIME], rel=0.05)
    assert fit.theta[fitted.model.positions("ptt_linear")[0]] == pytest.approx(3.0, rel=0.1)
    assert np.all(fit.run_errors < 0.012)
    # the control: another law leaves more than the noise
    assert np.max(fitted.before.classical["giesekus"].run_errors) > 0.05


@pytest.mark.slow
def test_a_coefficient_beyond_the_range_of_the_loop_lies_in_its_own_interval(monkeypatch):
    own = {"ptt_linear": CLASSICAL_EFFECTS["ptt_linear"]}
    monkeypatch.setattr(before_learning, "CLASSICAL_EFFECTS", own)
    fitted = along(held(EXTENSIBILITY))
    term = RecoveredTerm("tr(sigma)*sigma", EXTENSIBILITY, ci95=(0.0, 20.0))
    law = law_of_terms(LawTerms.of([term]), True)
    found = LearnerResult(
        "tensor_sindy", law, (term,), 0.0, (np.ones(1), np.ones(1)), {}, "made up"
    )
    learned = fitted.learn(lambda *known: (found, None))
    (joint,) = learned.result.terms
    low, high = joint.ci95
    assert low < EXTENSIBILITY < high
    assert low < joint.coefficient < high
    assert high - low < 0.5 * EXTENSIBILITY
    assert learned.constants["relaxation_time_s"].value == pytest.approx(TIME, rel=0.1)
