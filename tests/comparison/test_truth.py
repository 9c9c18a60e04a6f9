"""True terms of named laws against the equations of simulators that share nothing with them."""

from dataclasses import dataclass, field
from functools import cache, partial

import numpy as np
import pytest
from independent import (
    FenePeterlin,
    Giesekus,
    JohnsonSegalman,
    PhanThienTanner,
    StressLaw,
    UpperConvectedMaxwell,
    steps,
)  # fmt: skip
from independent.material import rate_tensor, stretched

from discover.comparison.flows import true_terms

LIMIT, UNIT = 12.0, np.eye(3)


def dumbbell_stress_rate(stress, gradient):
    """Return dσ/dt of FENE-P: A is parallel to σ + I = f A, and f = (L² − 3)/(L² − tr A)."""
    direction = stress + UNIT
    conformation = direction * LIMIT / (LIMIT - 3.0 + np.trace(direction))
    change = FenePeterlin(LIMIT).change(conformation.ravel(), gradient).reshape(3, 3)
    spring = (LIMIT - 3.0) / (LIMIT - np.trace(conformation))
    stiffening = spring / (LIMIT - np.trace(conformation)) * np.trace(change)
    return stiffening * conformation + spring * change


LAWS = {
    "ucm": ({}, UpperConvectedMaxwell().stress_change),
    "johnson_segalman": ({"xi": 0.4}, JohnsonSegalman(0.4).stress_change),
    "giesekus": ({"alpha": 0.3}, Giesekus(0.3).stress_change),
    "ptt_linear": ({"epsilon": 0.2}, PhanThienTanner(0.2).stress_change),
    "ptt_exponential": ({"epsilon": 0.2}, PhanThienTanner(0.2, "exponential").stress_change),
    "fene_p": ({"L2": LIMIT}, dumbbell_stress_rate),
}


@cache
def read(name):
    """Return a canonical spelling, read with the precedence of Python."""
    return compile(name.replace(".", " @ ").replace("^", "**"), name, "eval")


def rate_of_terms(terms, stress, gradient, relaxation=1.0):
    """Return dσ/dt of the law with these terms."""
    rate = rate_tensor(gradient)
    names = {"sigma": stress, "gammadot": rate, "I": UNIT, "tr": np.trace, "exp": np.exp}
    change = stretched(stress, gradient) + rate - relaxation * stress
    for term in terms:
        change = change - term.coefficient * eval(read(term.term), names | dict(term.inner))
    return change


@pytest.mark.parametrize("known_relaxation", [True, False])
@pytest.mark.parametrize("name", LAWS)
def test_true_terms_are_the_equation_of_the_law(name, known_relaxation):
    parameters, rate = LAWS[name]
    terms = true_terms(name, parameters, known_relaxation)
    generator = np.random.default_rng(11)
    for _ in range(4):
        root, gradient = generator.normal(size=(2, 3, 3))
        gradient = gradient - np.trace(gradient) / 3.0 * UNIT
        stress = 0.5 * root @ root.T - 0.3 * UNIT
        found = rate_of_terms(terms, stress, gradient, float(known_relaxation))
        np.testing.assert_allclose(found, rate(stress, gradient), rtol=1e-10, atol=1e-10)


@dataclass(frozen=True)
class OfTerms(StressLaw):
    """The law with these terms."""

    terms: list = field(default_factory=list)
    modulus: float = 1.0

    def stress_change(self, stress, rate):
        return rate_of_terms(self.terms, stress, rate)


def test_the_true_terms_of_fene_p_give_the_stress_of_its_conformation():
    """Integrated through a start-up at Wi = 3, a reversal and a rest."""
    flow, times = steps([0.0, 2.0, 4.0], [3.0, -3.0, 0.0]), np.linspace(0.0, 6.0, 61)
    wanted = FenePeterlin(LIMIT).respond(flow, times)

    def error(chosen):
        found = OfTerms(chosen).respond(flow, times)
        off = [getattr(found, name) - getattr(wanted, name) for name in ("sigma12", "N1", "N2")]
        return np.max(np.abs(off)) / np.max(np.abs(wanted.N1))

    of = partial(true_terms, "fene_p", known_relaxation=True)
    terms = of({"L2": LIMIT})
    assert error(terms) < 1e-6  # integrated to 1e-9
    assert len(terms) == 6
    # negative controls: without the smallest of the six, and with another extensibility
    smallest = min(terms, key=lambda term: abs(term.coefficient))
    assert error([term for term in terms if term is not smallest]) > 1e-2
    assert error(of({"L2": 1.05 * LIMIT})) > 1e-3


def test_a_law_that_is_no_sum_of_terms_has_no_true_terms(monkeypatch):
    from discover.laws import LAWS as NAMED
    from discover.laws.base import AbstractConstitutiveLaw, NamedLaw

    class Other(AbstractConstitutiveLaw):
        linear_relaxation: bool = True

        def extra_term(self, stress, rate):
            return stress

    monkeypatch.setitem(NAMED, "other", NamedLaw("other", Other, {}))
    assert true_terms("other", {}, True) is None
