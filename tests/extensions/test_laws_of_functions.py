"""A law of one's own as a plain function: the same law as a class makes."""

import jax.numpy as jnp
import numpy as np
import pytest

import discover as dc
from discover.laws import LAWS
from tensor_library import square, trace


@pytest.fixture
def registered():
    before = set(LAWS.present)
    yield
    for name in set(LAWS.present) - before:
        del LAWS[name]


def test_a_law_of_a_function_is_the_law_that_is_built_in(registered):
    def mobility(stress, rate, alpha):
        return alpha * square(stress)

    dc.register_law("own_mobility", extra_term=mobility, parameters={"alpha": (0.0, 1.0)})
    own, built_in = (dc.make_law(n, {"alpha": 0.3}) for n in ("own_mobility", "giesekus"))
    for stress in (np.array([0.5, -0.1, 0.0, 0.7]), np.diag([0.4, 0.1, -0.2])):
        rate = jnp.asarray(2.0) if stress.ndim == 1 else jnp.eye(3, k=1)
        ours, theirs = (law.stress_rate(jnp.asarray(stress), rate) for law in (own, built_in))
        np.testing.assert_allclose(ours, theirs, rtol=1e-14)
    assert "own_mobility" in dc.laws().index


def test_constants_of_such_a_law_are_fitted(registered):
    def softening(stress, rate, k):
        return k * trace(stress) ** 2 * stress

    dc.register_law("softening", extra_term=softening, parameters={"k": (0.0, 10.0)})
    data = dc.synthetic_dataset("softening", {"k": 0.3}, noise=0.01, n_samples=41)
    base = dc.Fluid(modulus=1.0, relaxation_time=1.0)
    fitted = dc.fit("softening", data, base=base)
    low, high = fitted.conf_int(0.999).loc["k"]
    assert low < 0.3 < high
    # negative control: the law's function decides what is fitted
    other = dc.fit("ptt_linear", data, base=base)
    assert other.misfit.misfit > 2.0 * fitted.misfit.misfit


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({}, "either build"),
        ({"build": dc.AbstractConstitutiveLaw, "extra_term": trace}, "either build"),
        ({"extra_term": lambda stress: stress}, "def mine(stress, rate, k)"),
        ({"extra_term": lambda stress, rate, q: stress}, "def mine(stress, rate, k)"),
        ({"extra_term": lambda stress, rate, k: k * trace(stress)}, "shape"),
    ],
)
def test_what_is_no_law_is_refused(registered, options, said):
    with pytest.raises(dc.InputError) as error:
        dc.register_law("mine", parameters={"k": (0.0, 1.0)}, **options)
    assert said in str(error.value)
    assert "mine" not in LAWS
