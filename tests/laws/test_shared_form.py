"""Laws that are sums of terms of degree one share a form, and with it every program."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from discover.laws import AbstractConstitutiveLaw, Fluid, TensorBasisNetwork, make_law
from discover.laws.expansion import in_shared_form, law_of_terms
from discover.programs.program_cache import Compiled
from discover.protocols import oscillatory_shear
from discover.simulate import simulate
from tensor_library import LawTerm, LawTerms
from tensor_library.algebra import Symmetric

STRESS, GRADIENT = jnp.array([1.3, -0.2, 0.1, 0.7]), jnp.array([0.4, -0.3, -0.1, 1.1])

SUMS = {
    "Maxwell": make_law("ucm"),
    "Giesekus": make_law("giesekus", {"alpha": 0.3}),
    "Johnson–Segalman": make_law("johnson_segalman", {"xi": 0.2}),
    "linear PTT": make_law("ptt_linear", {"epsilon": 0.2}),
    "learned": law_of_terms(
        LawTerms.of([LawTerm("sigma.sigma", 0.2), LawTerm("gammadot.gammadot", -0.1)]), True
    ),
    "relaxation learned too": law_of_terms(LawTerms.of([LawTerm("sigma", 0.9)]), False),
    "on a known law": law_of_terms(
        LawTerms.of([LawTerm("sigma.sigma", 0.1)]), True, make_law("giesekus", {"alpha": 0.3})
    ),
    "constants": TensorBasisNetwork(
        network=None, constants=0.1 * jnp.arange(8.0), network_mask=jnp.zeros(8)
    ),
}


class Own(AbstractConstitutiveLaw):
    """A user's own, which writes out another h than it computes."""

    linear_relaxation: bool = eqx.field(static=True, default=True)

    def extra_term(self, stress: Symmetric, rate: Symmetric) -> Symmetric:
        return 0.3 * stress

    def as_terms(self):
        return (LawTerm("sigma", 0.2),)


@pytest.mark.parametrize("name", SUMS)
def test_a_law_in_the_shared_form_is_the_same_law(name):
    law = SUMS[name]
    shared = in_shared_form(law)
    # one structure: nothing but numbers tells them apart, or whether −σ is known
    kind = jax.tree.structure(in_shared_form(SUMS["Maxwell"]))
    assert (jax.tree.structure(shared) == kind) == law.linear_relaxation
    np.testing.assert_allclose(
        shared.stress_rate(STRESS, GRADIENT), law.stress_rate(STRESS, GRADIENT), atol=1e-14
    )


@pytest.mark.parametrize(
    "law",
    [
        make_law("ptt_exponential", {"epsilon": 0.2}),  # an exponential has an inner constant
        make_law("rolie_poly", {"stretch_time_ratio": 0.1, "beta": 0.5}),  # it retracts
        Own(),
    ],
)
def test_any_other_law_stays_what_it_is(law):
    assert in_shared_form(law) is law


def test_such_laws_are_simulated_by_one_program(monkeypatch):
    flow, times = oscillatory_shear(2.0, 1.0), np.linspace(0.0, 5.0, 21)
    of_maxwell = simulate(Fluid.dimensionless(SUMS["Maxwell"]), flow, times)
    made, programs = Compiled._made, []
    monkeypatch.setattr(Compiled, "_made", lambda self, *of: programs.append(1) or made(self, *of))
    for name in ("Giesekus", "Johnson–Segalman", "learned", "constants"):
        found = simulate(Fluid.dimensionless(SUMS[name]), flow, times)
        assert np.max(np.abs(found.components - of_maxwell.components)) > 0.01
    assert not programs
    # negative control
    simulate(Fluid.dimensionless(Own()), flow, times)
    assert programs
