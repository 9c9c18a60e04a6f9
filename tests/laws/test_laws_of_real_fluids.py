"""Laws of melts, solutions and gels against the same equations on full tensors in scipy."""

import jax.numpy as jnp
import numpy as np
import pytest
from independent.authors import (
    ONE,
    cohen,
    giesekus_non_affine,
    ptt_exponential_non_affine,
    rolie_poly,
    rolie_poly_fene,
    saramito,
    stress,
    white_metzner,
    xpp,
)
from independent.homogeneous import UNIT

from discover.dataset.run import Run
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.laws import make_law
from discover.protocols import in_flow, start_up
from discover.simulate import simulate_homogeneous_flow

LAWS_AND_CONSTANTS = [
    (rolie_poly, {"stretch_time_ratio": 0.1, "beta": 0.7}),
    (xpp, {"q": 4.0, "stretch_time_ratio": 0.25, "alpha": 0.1}),
    (rolie_poly_fene, {"stretch_time_ratio": 0.3, "beta": 0.5, "maximum_stretch": 2.0}),
    (white_metzner, {"k": 0.8, "n": 0.4}),
    (saramito, {"yield_strain": 0.4}),
    (giesekus_non_affine, {"alpha": 0.2, "xi": 0.1}),
    (ptt_exponential_non_affine, {"epsilon": 0.2, "xi": 0.15}),
]
named = pytest.mark.parametrize(
    ("law", "constants"), LAWS_AND_CONSTANTS, ids=lambda p: getattr(p, "__name__", "")
)


def stress_of(law, constants, conformation):
    """Return σ/G of a conformation: A − I, times Cohen's spring where chains end."""
    if law is not rolie_poly_fene:
        return conformation - ONE
    limit = constants["maximum_stretch"] ** 2
    return cohen(np.trace(conformation) / 3, limit) * (conformation - ONE)


@named
def test_a_law_is_its_authors_at_any_conformation_in_any_flow(law, constants):
    """That programs follow such a law in time: below, and `test_law_accuracy.py` of every flow."""
    made, generator, step = make_law(law.__name__, constants), np.random.default_rng(0), 1e-5
    for size in (0.1, 0.4, 0.8):
        root = ONE + size * generator.uniform(-0.5, 0.5, (3, 3))
        a, gradient = root @ root.T, generator.normal(size=(3, 3))
        gradient -= np.trace(gradient) / 3 * ONE
        change = gradient @ a + a @ gradient.T + law(a, gradient, **constants)
        ahead, behind = (stress_of(law, constants, a + d * change) for d in (step, -step))
        found = made.stress_rate(jnp.asarray(stress_of(law, constants, a)), jnp.asarray(gradient))
        # the difference errs by the square of the step, times the cube of a rate of 10 or so
        size = np.max(np.abs(change))
        np.testing.assert_allclose(found, (ahead - behind) / (2 * step), atol=1e-6 * size)


def test_a_law_is_its_authors_in_a_flow_that_no_rheometer_makes():
    # all nine components, with a rotation about no axis of the strain
    gradient = np.array([[0.4, 1.0, -0.3], [0.2, -0.7, 0.5], [0.6, -0.4, 0.3]])
    times = np.linspace(0.05, 3.0, 30)
    law, constants = LAWS_AND_CONSTANTS[0]
    made = make_law(law.__name__, constants)
    found = simulate_homogeneous_flow(made, lambda t: jnp.asarray(gradient), times)
    exact = stress(law, constants, gradient, times)
    assert np.min(np.max(np.abs(exact), axis=0)) > 0.1
    np.testing.assert_allclose(found, exact, atol=1e-5 * np.max(np.abs(exact)))


@named
def test_four_components_say_what_full_tensors_say(law, constants):
    made = make_law(law.__name__, constants)
    full = np.array([[1.3, 0.6, 0.0], [0.6, 0.2, 0.0], [0.0, 0.0, -0.1]])
    rate = np.array([[0.4, 1.1, 0.0], [1.1, -0.3, 0.0], [0.0, 0.0, -0.1]])
    at = [0, 1, 2, 0], [0, 1, 2, 1]
    short = made.extra_term(jnp.asarray(full[at]), jnp.asarray(rate[at]))
    np.testing.assert_allclose(
        short, made.extra_term(jnp.asarray(full), jnp.asarray(rate))[at], rtol=1e-12, atol=1e-14
    )


@pytest.mark.slow
@pytest.mark.parametrize(("law", "constants"), LAWS_AND_CONSTANTS[:2], ids=["rolie_poly", "xpp"])
@pytest.mark.parametrize(("kind", "rate"), [("shear", 2.0), ("uniaxial", 0.5)])
def test_fast_modes_of_a_retracting_law_need_no_small_steps(law, constants, kind, rate):
    """The trace of the fastest mode relaxes within 1e-5 of a step."""
    modulus, time = np.array([1000.0, 300.0, 50.0]), np.array([1e-4, 1e-2, 3.0])
    times = np.linspace(0.1, 4.0, 40)
    declared = DeclaredModel.named(law.__name__, constants, modulus, time)
    model = AugmentedModel(declared, [])
    run = Run("run", times, in_flow(start_up(rate), kind), np.full(40, rate), np.ones(40))
    found = model.predict(model.zero(), make_batch([run]))[0]
    gradient = rate * UNIT[kind]
    exact = sum(
        g * stress(law, constants, gradient, times, t) for g, t in zip(modulus, time, strict=True)
    )
    wanted = exact[:, 0, 1] if kind == "shear" else exact[:, 0, 0] - exact[:, 1, 1]
    # what the fixed steps of a fit cost, 1e-6 of other laws; a retraction is ten times as fast
    np.testing.assert_allclose(found, wanted, atol=2e-4 * np.max(np.abs(wanted)))
