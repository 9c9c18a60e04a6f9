import jax
import jax.numpy as jnp
import numpy as np
import pytest

import tensor_library as tl
from discover.errors import InputError
from discover.laws import (
    LAWS,
    FenePeterlin,
    Fluid,
    Giesekus,
    LibraryExpansion,
    TensorBasisNetwork,
    UpperConvectedMaxwell,
    make_law,
)
from discover.laws.registry import starting_values
from discover.protocols import in_flow, start_up
from discover.simulate import SimulationError, simulate

NONLINEAR = [
    ("johnson_segalman", {"xi": 0.4}),
    ("giesekus", {"alpha": 0.2}),
    ("ptt_linear", {"epsilon": 0.4}),
    ("ptt_exponential", {"epsilon": 0.4}),
    ("fene_p", {"L2": 30.0}),
]


@pytest.mark.parametrize(("name", "parameters"), [*NONLINEAR, ("ucm", {})])
def test_shear_components_agree_with_the_full_tensor(name, parameters):
    law = make_law(name, parameters)
    stress = jnp.array([0.9, -0.1, 0.05, 0.6])
    fast = law.stress_rate(stress, jnp.array(1.4))
    full = law.stress_rate(tl.from_shear(stress), tl.simple_shear(jnp.array(1.4)))
    np.testing.assert_allclose(tl.to_shear(full), fast, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("johnson_segalman", {"xi": 0.0}),
        ("giesekus", {"alpha": 0.0}),
        ("ptt_linear", {"epsilon": 0.0}),
        ("ptt_exponential", {"epsilon": 0.0}),
    ],
)
def test_each_law_reduces_to_maxwell_when_its_parameter_is_zero(name, parameters):
    stress, rate = jnp.array([0.9, -0.1, 0.05, 0.6]), jnp.array(1.4)
    expected = UpperConvectedMaxwell().stress_rate(stress, rate)
    np.testing.assert_allclose(make_law(name, parameters).stress_rate(stress, rate), expected)


def test_fene_p_tends_to_maxwell_as_chains_grow_long():
    stress, rate = jnp.array([0.9, -0.1, 0.05, 0.6]), jnp.array(1.4)
    errors = [
        float(
            jnp.max(jnp.abs(FenePeterlin(limit).extra_term(stress, tl.rate_of_deformation(rate))))
        )
        for limit in (1e2, 1e4)
    ]
    assert errors[1] == pytest.approx(errors[0] / 100, rel=0.1)  # h is of first order in 1/L²


def test_linear_ptt_is_the_first_order_of_the_exponential():
    stress, rate = jnp.array([0.3, 0.0, 0.0, 0.2]), jnp.zeros(4)
    differences = [
        float(
            jnp.max(
                jnp.abs(
                    make_law("ptt_exponential", {"epsilon": e}).extra_term(stress, rate)
                    - make_law("ptt_linear", {"epsilon": e}).extra_term(stress, rate)
                )
            )
        )
        for e in (0.02, 0.01)
    ]
    assert differences[0] / differences[1] == pytest.approx(4.0, rel=0.02)  # second order in ε


def test_an_expansion_with_one_term_is_the_named_law():
    library = tl.build_library()
    coefficients = jnp.zeros(8).at[library.names.index("sigma.sigma")].set(0.2)
    expansion = LibraryExpansion(coefficients, jnp.zeros(0), library)
    stress, rate = jnp.array([0.9, -0.1, 0.05, 0.6]), jnp.array(1.4)
    np.testing.assert_allclose(
        expansion.stress_rate(stress, rate), Giesekus(0.2).stress_rate(stress, rate), rtol=1e-14
    )


def test_the_network_is_objective_for_random_weights():
    law = TensorBasisNetwork.initialise(jax.random.key(0))
    a = jax.random.normal(jax.random.key(1), (3, 3))
    b = jax.random.normal(jax.random.key(2), (3, 3))
    q, _ = jnp.linalg.qr(jax.random.normal(jax.random.key(3), (3, 3)))
    s, g = a + a.T, b + b.T
    turned = law.extra_term(q @ s @ q.T, q @ g @ q.T)
    np.testing.assert_allclose(turned, q @ law.extra_term(s, g) @ q.T, atol=1e-11)


def test_two_equal_modes_are_one_mode_of_twice_the_modulus():
    times = np.linspace(0, 5, 11)
    one = simulate(Fluid(Giesekus(0.3), 2.0, 1.5), start_up(1.0), times)
    two = simulate(Fluid(Giesekus(0.3), [1.0, 1.0], [1.5, 1.5]), start_up(1.0), times)
    np.testing.assert_allclose(one.components, two.components, atol=1e-7)


def test_units_scale_out():
    # the same fluid in dimensionless and in SI units
    times = np.linspace(0, 5, 11)
    scaled = simulate(Fluid.dimensionless(Giesekus(0.3)), start_up(2.0), times)
    in_units = simulate(Fluid(Giesekus(0.3), 150.0, 4.0), start_up(2.0 / 4.0), 4.0 * times)
    np.testing.assert_allclose(in_units.components, 150.0 * scaled.components, atol=150 * 1e-6)


def test_solvent_adds_its_viscous_stress_only():
    times = np.linspace(0, 3, 7)
    dry = simulate(Fluid(Giesekus(0.3), 1.0, 1.0), start_up(2.0), times)
    wet = simulate(Fluid(Giesekus(0.3), 1.0, 1.0, solvent_viscosity=0.25), start_up(2.0), times)
    np.testing.assert_allclose(wet.components - dry.components, [[0, 0, 0, 0.5]] * 7, atol=1e-12)


def test_extension_of_maxwell_matches_the_analytic_solution():
    rate, times = 0.3, np.linspace(0, 4, 9)
    fluid = Fluid.dimensionless(UpperConvectedMaxwell())
    stress = simulate(fluid, in_flow(start_up(rate), "uniaxial"), times).components
    expected = 2 * rate / (1 - 2 * rate) * (1 - np.exp(-(1 - 2 * rate) * times))
    np.testing.assert_allclose(stress[:, 0], expected, atol=1e-7)


def test_runaway_stress_is_an_error_that_says_so():
    with pytest.raises(SimulationError, match="diverges"):
        simulate(
            Fluid.dimensionless(make_law("giesekus", {"alpha": 0.0})),
            in_flow(start_up(50.0), "uniaxial"),
            np.linspace(0, 40, 5),
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


CONTAINED = [
    (law, below, fixed)
    for law, entry in LAWS.items()
    for below, fixed in entry.contains.items()
    if not make_law(law, starting_values(law)).variables  # the blend: test_rolie_poly_blend.py
]


@pytest.mark.parametrize(("law", "below", "fixed"), CONTAINED, ids=lambda part: str(part)[:40])
def test_a_law_is_the_one_that_it_contains_where_it_says_so(law, below, fixed):
    known = {name: 0.3 for name in LAWS[below].parameters}
    own = {name: {**known, **fixed}[name] for name in LAWS[law].parameters}
    stress = jnp.array([[1.1, 0.5, 0.0], [0.5, 0.2, 0.0], [0.0, 0.0, -0.1]])
    rate = jnp.array([[0.3, 0.8, 0.0], [0.8, -0.3, 0.0], [0.0, 0.0, 0.0]])
    wanted = make_law(below, known).extra_term(stress, rate)
    found = make_law(law, own).extra_term(stress, rate)
    # L² = 1e6 and a largest stretch of 100 are limits: (stretch/100)² of the terms
    np.testing.assert_allclose(found, wanted, atol=1e-3)
