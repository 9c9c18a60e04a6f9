"""Laws: what they refuse and contain, which share a program, and constants of each mode."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from compilations import compilations
from independent import Modes, PhanThienTanner, PomPom, multimode_giesekus
from independent import start_up as independent_start_up

import discover as dc
from discover.dataset import Run
from discover.effects import make_effect
from discover.equations import AugmentedLaw, law_parts
from discover.errors import InputError
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.forward.of_fluids import observed_in
from discover.identify.physics import _extension
from discover.laws import LAWS, AbstractConstitutiveLaw, Fluid, TensorBasisNetwork, make_law
from discover.laws.each_mode import law_of_each_mode, with_modes
from discover.laws.expansion import law_of_terms
from discover.learners.files import plain, restored
from discover.learners.tbnn_ude.problem import make_problem as make_training_problem
from discover.learners.tbnn_ude.session import initial_law
from discover.learners.tbnn_ude.variational import trajectories
from discover.protocols import in_flow, oscillatory_shear, start_up, steady_rates
from discover.simulate import SimulationError, simulate
from discover.simulate.synthetic import linear_sweep
from tensor_library import LawTerm, LawTerms, TermLibrary, parse_term
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


MODULI, TIMES = (200.0, 100.0, 50.0), (0.1, 1.0, 10.0)
MOBILITIES = (0.1, 0.3, 0.5)
SAMPLES = np.geomspace(0.02, 20.0, 40)
RATE = 5.0


def giesekus(mobilities=MOBILITIES):
    return law_of_each_mode([make_law("giesekus", {"alpha": a}) for a in mobilities])


def of_scipy(mobilities=MOBILITIES, moduli=MODULI, times=TIMES):
    flow = independent_start_up(RATE)
    return multimode_giesekus(mobilities, moduli, times).respond(flow, SAMPLES)


def apart(found, true):
    return float(np.max(np.abs(found - true)) / np.max(np.abs(true)))


def test_the_stresses_are_those_of_the_modes_by_scipy():
    stress = simulate(Fluid(giesekus(), MODULI, TIMES), start_up(RATE), SAMPLES)
    true = of_scipy()
    assert apart(stress.components[:, 3], true.sigma12) < 1e-6
    assert apart(stress.first_normal_stress_difference, true.N1) < 1e-6
    # control: with the constants in the other order they are others
    other = simulate(Fluid(giesekus(MOBILITIES[::-1]), MODULI, TIMES), start_up(RATE), SAMPLES)
    assert apart(other.components[:, 3], true.sigma12) > 0.05


@pytest.mark.slow
def test_of_a_law_with_a_stretch_too():
    arms = (5.0, 7.0, 9.0)
    constants = ({"q": q, "stretch_time_ratio": 0.4} for q in arms)
    law = law_of_each_mode([make_law("pom_pom_drag_strain", one) for one in constants])
    stress = simulate(Fluid(law, MODULI, TIMES), start_up(RATE), SAMPLES)
    modes = zip(arms, MODULI, TIMES, strict=True)
    true = Modes(*(PomPom(q, 0.4 * t, g, t) for q, g, t in modes))
    true = true.respond(independent_start_up(RATE), SAMPLES)
    assert apart(stress.components[:, 3], true.sigma12) < 1e-3


def test_the_model_of_the_loop_gives_an_added_mode_constants_between_its_neighbours():
    run = Run("a", SAMPLES, start_up(RATE), np.full(len(SAMPLES), RATE), of_scipy().sigma12)
    declared = DeclaredModel(giesekus(), np.array(MODULI), np.array(TIMES))
    model = AugmentedModel(declared, [make_effect("relaxation_mode")])
    assert apart(model.predict(model.zero(), make_batch([run]))[0], run.stress) < 1e-5
    theta = model.zero()
    theta[model.positions("relaxation_mode")] = 30.0, 10.0**0.5  # halfway between 1 and 10 s
    true = of_scipy((0.1, 0.3, 0.4, 0.5), (200.0, 100.0, 30.0, 50.0), (0.1, 1.0, 10.0**0.5, 10.0))
    assert apart(model.predict(theta, make_batch([run]))[0], true.sigma12) < 1e-5
    moved = with_modes(giesekus(), np.array(TIMES), np.array([10.0**0.5, 0.01, 100.0]))
    assert moved.law.mobility == pytest.approx([0.4, 0.1, 0.5])


def test_steady_states_and_linear_sweeps_are_those_of_each_mode():
    fluid = Fluid(giesekus(), MODULI, TIMES)
    curve = steady_rates(np.array([RATE])), np.array([1.0])
    of_modes = (
        Fluid(make_law("giesekus", {"alpha": alpha}), modulus, time)
        for alpha, modulus, time in zip(MOBILITIES, MODULI, TIMES, strict=True)
    )
    alone = sum(observed_in(one, *curve) for one in of_modes)
    assert observed_in(fluid, *curve) == pytest.approx(alone)
    sweep, omega = linear_sweep(fluid), linear_sweep(fluid).angular_frequency
    x = np.multiply.outer(omega, TIMES)
    assert sweep.storage_modulus == pytest.approx((x**2 / (1 + x**2)) @ np.array(MODULI))


def test_a_law_of_each_mode_is_written_with_its_name_and_goes_through_a_file():
    named, terms = law_parts(giesekus())
    assert (named.law, terms) == ("giesekus", ())
    assert [one["alpha"] for one in named.constants] == pytest.approx(MOBILITIES)
    effects = tuple(make_effect(name) for name in ("ptt_linear", "non_affine_motion"))

    def of_mode(epsilon, slip):
        values = jnp.asarray([epsilon]), jnp.asarray([slip])
        return AugmentedLaw(make_law("ucm", {}), values, effects)

    law = law_of_each_mode([of_mode(0.1, 0.2), of_mode(0.3, 0.05)])
    named, _ = law_parts(law)
    assert named.law == "ptt_linear_non_affine"
    pairs = zip((0.1, 0.3), (0.2, 0.05), MODULI, TIMES, strict=False)
    true = Modes(
        *(PhanThienTanner(e, slip=s, modulus=g, relaxation_time=t) for e, s, g, t in pairs)
    ).respond(independent_start_up(RATE), SAMPLES)
    stress = simulate(Fluid(law, MODULI[:2], TIMES[:2]), start_up(RATE), SAMPLES)
    assert apart(stress.components[:, 3], true.sigma12) < 1e-5
    # what no law with a name adds cannot be written
    term = (make_effect("tr(sigma.gammadot)*I"),)
    unnamed = [AugmentedLaw(make_law("ucm", {}), (jnp.asarray([c]),), term) for c in (0.1, 0.2)]
    with pytest.raises(InputError, match="differs from one relaxation mode to the next"):
        law_parts(law_of_each_mode(unnamed))

    # as it is from a file
    again = restored(plain(giesekus(), "law"))
    assert np.asarray(again.law.mobility) == pytest.approx(MOBILITIES)


def test_what_is_no_law_of_these_modes_is_refused():
    with pytest.raises(InputError, match="constants for 2 modes"):
        Fluid(giesekus(), MODULI[:2], TIMES[:2])
    with pytest.raises(InputError, match="of one kind"):
        law_of_each_mode([make_law("giesekus", {"alpha": 0.1}), make_law("ucm", {})])


def test_extension_is_bounded_where_it_is_in_every_mode():
    """A Maxwell mode stretches without bound from 0.5/λ on, be it not the slowest."""
    times = np.array([1.0, 10.0])
    times, moduli = np.array([1.0, 10.0]), MODULI[:2]
    bounded = _extension(Fluid(giesekus((0.1, 0.3)), moduli, times))
    unbounded = _extension(Fluid(giesekus((0.0, 0.3)), moduli, times))
    assert (bounded[0], unbounded[0]) == (True, False)
    assert unbounded[1] == pytest.approx(0.5, rel=0.05)


def test_learners_start_from_the_law_of_each_mode():
    """Their systems of states and sensitivities, with nothing added: the stress is the fluid's."""
    run = Run("a", SAMPLES, start_up(RATE), np.full(len(SAMPLES), RATE), of_scipy().sigma12)
    base = Fluid(giesekus(), MODULI, TIMES)
    sparse = dc.TensorSINDy(base=base, library=TermLibrary((parse_term("sigma.sigma"),)))
    assert not sparse.fit([run]).terms_
    # control: without the difference of modes a term stands for it
    mean = Fluid(make_law("giesekus", {"alpha": 0.5 * sum(MOBILITIES)}), MODULI, TIMES)
    assert sparse.set_params(base=mean).fit([run]).terms_
    network = make_training_problem([run], base)
    law = initial_law(jax.random.key(0), 4, True, jnp.ones(8), giesekus())
    recorded = np.asarray(trajectories(law, network).recorded)[0, : len(SAMPLES)]
    assert recorded == pytest.approx(run.stress, rel=1e-4)
