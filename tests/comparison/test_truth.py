"""The true terms of the named laws against their equations, written here in numpy alone.

The laws are taken from where they come from: conformation tensors, or the Gordon–Schowalter
derivative, not the extra term h.
"""

import functools

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from discover.comparison.flows import true_terms

XI, ALPHA, EPSILON, LIMIT = 0.4, 0.3, 0.2, 12.0
UNIT = np.eye(3)


def convected(tensor, gradient):
    return gradient @ tensor + tensor @ gradient.T


def non_affine(stress, gradient):
    strain, vorticity = 0.5 * (gradient + gradient.T), 0.5 * (gradient - gradient.T)
    rotated = vorticity @ stress - stress @ vorticity
    stretched = strain @ stress + stress @ strain
    return rotated + (1.0 - XI) * stretched + 2.0 * strain - stress


def anisotropic_mobility(stress, gradient):
    conformation = stress + UNIT
    change = conformation - UNIT
    return convected(conformation, gradient) - (UNIT + ALPHA * change) @ change


def network(destruction):
    def rate(stress, gradient):
        drive = gradient + gradient.T
        return convected(stress, gradient) + drive - destruction(np.trace(stress)) * stress

    return rate


def spring(conformation):
    return (LIMIT - 3.0) / (LIMIT - np.trace(conformation))


def dumbbell(conformation, gradient):
    """dA/dt of FENE-P."""
    return convected(conformation, gradient) - (spring(conformation) * conformation - UNIT)


def dumbbell_stress_rate(stress, gradient):
    # A is parallel to σ + I = fA, and f = (L² − 3)/(L² − tr A) gives its length
    direction = stress + UNIT
    conformation = direction * LIMIT / (LIMIT - 3.0 + np.trace(direction))
    change = dumbbell(conformation, gradient)
    stiffening = spring(conformation) / (LIMIT - np.trace(conformation)) * np.trace(change)
    return stiffening * conformation + spring(conformation) * change


LAWS = {
    "ucm": ({}, network(lambda trace: 1.0)),
    "johnson_segalman": ({"xi": XI}, non_affine),
    "giesekus": ({"alpha": ALPHA}, anisotropic_mobility),
    "ptt_linear": ({"epsilon": EPSILON}, network(lambda trace: 1.0 + EPSILON * trace)),
    "ptt_exponential": ({"epsilon": EPSILON}, network(lambda trace: np.exp(EPSILON * trace))),
    "fene_p": ({"L2": LIMIT}, dumbbell_stress_rate),
}


@functools.cache
def read(name):
    return compile(name.replace(".", " @ ").replace("^", "**"), name, "eval")


def rate_of_terms(terms, stress, gradient, relaxation=1.0):
    """dσ/dt by the canonical spellings, read with the precedence of Python."""
    names = {"sigma": stress, "gammadot": gradient + gradient.T, "I": UNIT}
    rate = convected(stress, gradient) + names["gammadot"] - relaxation * stress
    for term in terms:
        value = eval(read(term.term), {"tr": np.trace, "exp": np.exp} | names | dict(term.inner))
        rate = rate - term.coefficient * value
    return rate


def states():
    generator = np.random.default_rng(11)
    for _ in range(4):
        root, gradient = generator.normal(size=(2, 3, 3))
        gradient = gradient - np.trace(gradient) / 3.0 * UNIT
        yield 0.5 * root @ root.T - 0.3 * UNIT, gradient


@pytest.mark.parametrize("known_relaxation", [True, False])
@pytest.mark.parametrize("name", LAWS)
def test_true_terms_are_the_equation_of_the_law(name, known_relaxation):
    parameters, rate = LAWS[name]
    terms = true_terms(name, parameters, known_relaxation)
    for stress, gradient in states():
        found = rate_of_terms(terms, stress, gradient, float(known_relaxation))
        np.testing.assert_allclose(found, rate(stress, gradient), rtol=1e-10, atol=1e-10)


def test_the_true_terms_of_fene_p_give_the_stress_of_its_conformation():
    """Integrated through a start-up at Wi = 3, a reversal and a rest."""

    def gradient(time):
        shear = np.zeros((3, 3))
        shear[0, 1] = 3.0 if time < 2.0 else -3.0 if time < 4.0 else 0.0
        return shear

    times = np.linspace(0.0, 6.0, 61)

    def integrated(rate, start):
        rows = [start.reshape(1, 9)]
        for first in (0, 20, 40):  # a piece ends where the rate jumps
            own = gradient(times[first])
            solution = solve_ivp(
                lambda t, y, own=own: rate(y.reshape(3, 3), own).ravel(),
                (times[first], times[first + 20]),
                rows[-1][-1],
                t_eval=times[first + 1 : first + 21],
                rtol=1e-8,
                atol=1e-9,
            )
            rows.append(solution.y.T)
        return np.concatenate(rows).reshape(-1, 3, 3)

    conformation = integrated(dumbbell, UNIT)
    wanted = np.array([spring(a) * a - UNIT for a in conformation])
    terms = true_terms("fene_p", {"L2": LIMIT}, True)
    scale = np.max(np.abs(wanted))

    def error(chosen):
        found = integrated(lambda s, g: rate_of_terms(chosen, s, g), np.zeros((3, 3)))
        return np.max(np.abs(found - wanted)) / scale

    assert error(terms) < 1e-6
    assert len(terms) == 6
    # negative controls: without the smallest of the six, and with another extensibility
    smallest = min(terms, key=lambda term: abs(term.coefficient))
    assert error([term for term in terms if term is not smallest]) > 1e-2
    assert error(true_terms("fene_p", {"L2": 1.05 * LIMIT}, True)) > 1e-3


def test_a_law_that_is_no_sum_of_terms_has_no_true_terms(monkeypatch):
    from discover.laws import LAWS as NAMED
    from discover.laws.base import AbstractConstitutiveLaw, NamedLaw

    class Other(AbstractConstitutiveLaw):
        linear_relaxation: bool = True

        def extra_term(self, stress, rate):
            return stress

    monkeypatch.setitem(NAMED, "other", NamedLaw("other", Other, {}))
    assert true_terms("other", {}, True) is None
