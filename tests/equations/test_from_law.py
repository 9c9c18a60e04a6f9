"""Laws of the package as sums of terms."""

import jax.numpy as jnp
import numpy as np
import pytest

from discover.equations import Equation, law_terms
from discover.errors import InputError
from discover.laws import LibraryExpansion, TensorBasisNetwork, make_law
from tensor_library import LawTerm
from tensor_library.library import TermLibrary
from tensor_library.terms import parse_term

EXPONENTIAL = "(exp(epsilon*tr(sigma))-1)*sigma"
NAMED = {
    "ucm": {},
    "giesekus": {"alpha": 0.3},
    "johnson_segalman": {"xi": 0.4},
    "ptt_linear": {"epsilon": 0.2},
    "ptt_exponential": {"epsilon": 0.2},
    "fene_p": {"L2": 12.0},
}


def same_stress_rate(first, second):
    generator = np.random.default_rng(0)
    for _ in range(5):
        stress = generator.normal(size=(3, 3))
        stress = jnp.asarray(0.5 * (stress + stress.T))
        gradient = jnp.asarray(generator.normal(size=(3, 3)))
        gradient = gradient - jnp.trace(gradient) / 3 * jnp.eye(3)
        np.testing.assert_allclose(
            first.stress_rate(stress, gradient), second.stress_rate(stress, gradient), rtol=1e-9
        )


@pytest.mark.parametrize("name", NAMED)
def test_a_named_law_and_its_terms_are_the_same_law_in_any_flow(name):
    law = make_law(name, NAMED[name])
    same_stress_rate(Equation(law_terms(law)).law(), law)


def test_one_parameter_with_two_values_keeps_both():
    terms = tuple(LawTerm(EXPONENTIAL, c, {"epsilon": e}) for c, e in ((1.0, 0.1), (0.5, 0.3)))
    stress = jnp.asarray([0.7, 0.1, 0.2, 0.4])
    trace = 1.0
    wanted = (np.expm1(0.1 * trace) + 0.5 * np.expm1(0.3 * trace)) * np.asarray(stress)
    extra = Equation(terms).law().extra_term(stress, jnp.zeros(4))
    np.testing.assert_allclose(extra, wanted, rtol=1e-12)
    assert r"\epsilon = 0.1" in Equation(terms).latex()
    assert r"e^{0.3 " in Equation(terms).latex()


def test_a_network_that_is_more_than_constants_is_refused():
    import equinox as eqx
    import jax

    network = TensorBasisNetwork.initialise(jax.random.key(0))
    with pytest.raises(InputError, match="projection"):
        law_terms(network)
    constants = jnp.zeros(8).at[3].set(0.2)
    network = eqx.tree_at(
        lambda n: (n.network_mask, n.constants), network, (jnp.zeros(8), constants)
    )
    assert law_terms(network) == (LawTerm("sigma.sigma", float(constants[3])),)


def test_a_known_law_below_is_part_of_what_is_written():
    base = make_law("giesekus", {"alpha": 0.1})
    library = TermLibrary((parse_term("sigma.sigma"), parse_term("tr(sigma)*sigma")))
    law = LibraryExpansion(jnp.asarray([0.2, 0.3]), jnp.zeros(0), library, base=base)
    found = {t.term: t.coefficient for t in law_terms(law)}
    assert found == pytest.approx({"sigma.sigma": 0.3, "tr(sigma)*sigma": 0.3})
