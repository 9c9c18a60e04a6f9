"""Laws: what they refuse, what they contain, and those that share a form and its programs."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from compilations import compilations

from discover.errors import InputError
from discover.laws import LAWS, AbstractConstitutiveLaw, Fluid, TensorBasisNetwork, make_law
from discover.laws.expansion import law_of_terms
from discover.protocols import in_flow, oscillatory_shear, start_up
from discover.simulate import SimulationError, simulate
from tensor_library import LawTerm, LawTerms
from tensor_library.algebra import Symmetric


def test_the_network_is_objective_and_a_runaway_stress_is_an_error_that_says_so(monkeypatch):
    law = TensorBasisNetwork.initialise(jax.random.key(0))
    a = jax.random.normal(jax.random.key(1), (3, 3))
    b = jax.random.normal(jax.random.key(2), (3, 3))
    q, _ = jnp.linalg.qr(jax.random.normal(jax.random.key(3), (3, 3)))
    s, g = a + a.T, b + b.T
    turned = law.extra_term(q @ s @ q.T, q @ g @ q.T)
    np.testing.assert_allclose(turned, q @ law.extra_term(s, g) @ q.T, atol=1e-11)
    monkeypatch.setattr("discover.simulate.solve.MAX_STEPS", 20_000)  # not 400,000, for time
    with pytest.raises(SimulationError, match="diverges"):
        simulate(
            Fluid.dimensionless(make_law("giesekus", {"alpha": 0.0})),
            in_flow(start_up(50.0), "uniaxial"),
            np.linspace(0, 8, 5),  # a double ends at e^(2 · 50 · 7.1)
        )


@pytest.mark.parametrize(
    ("name", "parameters", "message"),
    [
        ("oldroyd", {}, "Unknown law 'oldroyd'"),
        ("giesekus", {}, "needs its parameter 'alpha'"),
        ("giesekus", {"alpha": 0.1, "xi": 1.0}, "has no parameter 'xi'"),
        ("giesekus", {"alpha": 1.7}, "from 0 to 1"),
        ("giesekus", {"alpha": float("nan")}, "from 0 to 1"),
    ],
)
def test_a_wrong_law_is_refused_with_what_was_wanted(name, parameters, message):
    with pytest.raises(InputError, match=message):
        make_law(name, parameters)


PTT = ("ptt_linear", "ptt_exponential")
CONTAINED = [
    ("johnson_segalman", "ucm", {"xi": 0.0}),
    ("giesekus", "ucm", {"alpha": 0.0}),
    *((law, "ucm", {"epsilon": 0.0}) for law in PTT),
    ("fene_p", "ucm", {"L2": 1e6}),
    ("saramito", "ucm", {"yield_strain": 0.0}),
    ("rolie_poly_fene", "rolie_poly", {"maximum_stretch": 100.0}),
    *((f"{law}_non_affine", law, {"xi": 0.0}) for law in ("giesekus", *PTT)),
    ("giesekus_non_affine", "johnson_segalman", {"alpha": 0.0}),
    *((f"{law}_non_affine", "johnson_segalman", {"epsilon": 0.0}) for law in PTT),
]  # the blend: test_rolie_poly_blend.py


@pytest.mark.parametrize(("law", "below", "fixed"), CONTAINED, ids=lambda part: str(part)[:40])
def test_a_law_is_the_one_that_it_contains_as_its_constant_vanishes_or_ends(law, below, fixed):
    known = {name: 0.3 for name in LAWS[below].parameters}
    own = {name: {**known, **fixed}[name] for name in LAWS[law].parameters}
    stress = jnp.array([[1.1, 0.5, 0.0], [0.5, 0.2, 0.0], [0.0, 0.0, -0.1]])
    rate = jnp.array([[0.3, 0.8, 0.0], [0.8, -0.3, 0.0], [0.0, 0.0, 0.0]])
    wanted = make_law(below, known).extra_term(stress, rate)
    found = make_law(law, own).extra_term(stress, rate)
    # L² = 1e6 and a largest stretch of 100 are limits: (stretch/100)² of the terms
    np.testing.assert_allclose(found, wanted, atol=1e-3)


LEARNED = (LawTerm("sigma.sigma", 0.2), LawTerm("gammadot.gammadot", -0.1))
SUMS = {
    "Maxwell": make_law("ucm"),
    "Giesekus": make_law("giesekus", {"alpha": 0.3}),
    "Johnson–Segalman": make_law("johnson_segalman", {"xi": 0.2}),
    "learned": law_of_terms(LawTerms.of(LEARNED), True),
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


def test_such_laws_are_simulated_by_one_program():
    flow, times = oscillatory_shear(2.0, 1.0), np.linspace(0.0, 5.0, 21)
    of_maxwell = simulate(Fluid.dimensionless(SUMS["Maxwell"]), flow, times)
    programs = compilations()
    for name in [*SUMS][1:]:
        found = simulate(Fluid.dimensionless(SUMS[name]), flow, times)
        assert np.max(np.abs(found.components - of_maxwell.components)) > 0.01
    assert not programs
    # negative control
    simulate(Fluid.dimensionless(Own()), flow, times)
    assert programs
