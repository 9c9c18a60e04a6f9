"""Effects: what each changes, where its ranges come from, and the letters of its constants."""

import re
from dataclasses import replace
from itertools import combinations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from independent import JohnsonSegalman
from independent import start_up as flow_of

from discover.dataset import Run
from discover.effects import (
    ConstitutiveEffect,
    KinematicEffect,
    ModeEffect,
    RadialAverage,
    Record,
    SeriesElement,
    SignalEffect,
    StateEffect,
    known_effects,
    library_effects,
    make_effect,
    named_effects,
)
from discover.effects.kinematic import first_order_lag
from discover.effects.registry import spelled_distinctly
from discover.equations import Equation
from discover.equations.files import equation_latex
from discover.equations.parts import StatePart
from discover.errors import InputError
from discover.forward import data_scales
from discover.laws import LAWS
from discover.protocols import after_step_strain, start_up

NAMED = list(named_effects().values())
STRESS = jnp.array([1.3, -0.2, 0.1, 0.7])
RATE = jnp.array([0.0, 0.0, 0.0, 1.5])
TIMES = jnp.linspace(0.0, 4.0, 81)
SIGNAL = jnp.sin(TIMES) + 0.3


def values_of(effect, amplitude):
    return jnp.array([amplitude, *(p.first_trial for p in effect.parameters[1:])])


def response(effect, amplitude):
    """Return all that an effect can change, as one vector."""
    values = values_of(effect, amplitude)
    if isinstance(effect, ModeEffect):
        return effect.mode(values)[0]
    if isinstance(effect, StateEffect):
        source, decay = effect.source_and_decay(values, jnp.asarray(1.5), jnp.asarray(0.7))
        state = effect.rest + 0.1 * (source - decay * effect.rest)
        factors = [effect.modulus_factor(values, state), effect.time_factor(values, state)]
        return jnp.stack(factors) - 1.0
    if isinstance(effect, SeriesElement):
        return jnp.stack(effect.slip_and_compliance(values))
    if isinstance(effect, ConstitutiveEffect):
        at_once = effect.instantaneous_stress(values, jnp.array([2.0]))
        return jnp.concatenate([effect.extra_term(values, STRESS, RATE), at_once])
    if isinstance(effect, RadialAverage):
        # of a stress in proportion to the third power of the rate
        mean = np.dot(effect.of_stress, np.power(effect.radii, 3)) * SIGNAL
        return values[0] * (mean - SIGNAL)
    if isinstance(effect, KinematicEffect):
        return effect.felt_rate(values, TIMES, SIGNAL) - SIGNAL
    assert isinstance(effect, SignalEffect)
    return effect.recorded_stress(values, record()) - SIGNAL


def run():
    flow = start_up(1.0)
    return Run("run", np.asarray(TIMES), flow, np.ones(len(TIMES)), np.asarray(SIGNAL))


def record(clock_factor=1.0):
    return Record(TIMES, jnp.cos(TIMES), SIGNAL, jnp.asarray(clock_factor))


@pytest.mark.parametrize("effect", [*NAMED, *library_effects(degree=0)], ids=lambda e: e.name)
def test_an_effect_of_zero_amplitude_changes_nothing_and_of_another_something(effect):
    np.testing.assert_array_equal(response(effect, 0.0), 0.0)
    assert np.max(np.abs(response(effect, 0.3))) > 1e-6


@pytest.mark.parametrize("effect", [*NAMED, library_effects()[0]], ids=lambda e: e.name)
def test_an_effect_and_its_ranges_say_where_they_come_from_and_how_to_confirm_it(effect):
    assert effect.source
    assert effect.check
    assert effect.equation
    assert effect.visible or effect not in NAMED
    assert effect.parameters[0].low <= 0.0 <= effect.parameters[0].high
    for parameter in effect.parameters:
        assert -np.inf < parameter.low < parameter.high < np.inf
        assert len(parameter.range_source) > 20
        if parameter.range_scale != "one":
            assert parameter.range_scale in data_scales([run()])


@pytest.mark.parametrize("law", LAWS.values(), ids=list(LAWS))
def test_every_parameter_of_a_declared_law_has_a_range_with_a_source(law):
    for name, (low, high) in law.parameters.items():
        assert -np.inf < low < high < np.inf
        assert len(law.range_sources[name]) > 20


def test_no_liquid_is_warmed_by_more_than_its_heat_capacity_allows_and_heat_leaves_a_gap_in_time():
    heating = make_effect("viscous_heating").parameters[0]
    most = heating.high * data_scales([run()])[heating.range_scale]
    # 0.1 1/K in water, 4.2 MJ/(m³ K), and 0.03 1/K in oil, 1.7 MJ/(m³ K), are possible; 25 is not
    assert heating.low < 0.1 / 4.2e6 < 0.03 / 1.7e6 * 10 < most < 1e-5
    # on the clock of the instrument
    loss = make_effect("viscous_heating").parameters[1]
    assert loss.range_scale == "shift_factor"
    assert data_scales([replace(run(), clock_factor=131.2)])["shift_factor"] == pytest.approx(131.2)
    # H²/(π² a) of a gap of 1 mm is a second; of one of 10 cm, which no rheometer has, hours
    one, large = (h**2 / (np.pi**2 * 1e-7) for h in (1e-3, 0.1))
    assert loss.low < one < loss.high < large


def test_shift_factors_say_how_much_heat_can_shorten_times():
    def at(celsius, shift):
        return replace(run(), metadata={"temperature_C": celsius}, clock_factor=shift)

    def most(*runs):
        return data_scales(*runs)["softening_by_heat"]

    # 0.168 1/K, as of polyisoprene, at no less than 1 J/(cm³ K)
    melt = [at(-10.0, 131.2), at(-23.0, 14.77)]
    assert most(melt) == pytest.approx(np.log(131.2 / 14.77) / 13.0 / 1e6)
    # runs that are only predicted tell temperatures too; several at one temperature tell nothing
    assert most(melt[:1], melt[1:]) == most(melt)
    assert most([melt[0], at(-10.2, 131.2)]) == most([run()])


@pytest.mark.parametrize(
    "effect", [e for e in NAMED if e.kind == "constitutive"], ids=lambda e: e.name
)
def test_the_shear_path_of_a_constitutive_effect_agrees_with_full_tensors(effect):
    values = values_of(effect, 0.3)

    def whole(four):
        a11, a22, a33, a12 = four
        return jnp.array([[a11, a12, 0.0], [a12, a22, 0.0], [0.0, 0.0, a33]])

    full = effect.extra_term(values, whole(STRESS), whole(RATE))
    shear = effect.extra_term(values, STRESS, RATE)
    np.testing.assert_allclose(full, whole(shear), atol=1e-14)


def test_full_constraint_release_keeps_the_trace_of_the_conformation():
    # Rolie-Poly without stretch: tr A = 3 + tr(sigma) must not change in flow
    stress = jnp.array([0.9, -0.4, -0.5, 0.7])
    effect = make_effect("convective_constraint_release")
    term = effect.extra_term(jnp.array([1 / 3, 0.4]), stress, RATE)
    assert float(jnp.sum(stress[:3])) == pytest.approx(0.0, abs=1e-15)
    growth = 2.0 * RATE[3] * stress[3]
    assert float(jnp.sum(term[:3])) == pytest.approx(float(growth), rel=1e-12)


def test_a_lag_answers_a_step_and_a_ramp_exactly_and_leaves_the_signal_alone_where_short():
    lagged = first_order_lag(TIMES, jnp.ones_like(TIMES), jnp.asarray(0.7))
    np.testing.assert_allclose(lagged, 1 - jnp.exp(-TIMES / 0.7), atol=1e-13)
    ramp = first_order_lag(TIMES, TIMES, jnp.asarray(0.7))
    np.testing.assert_allclose(ramp, TIMES - 0.7 * (1 - jnp.exp(-TIMES / 0.7)), atol=1e-13)

    @jax.jit
    def lag_and_slope(tau):
        return jax.jvp(lambda tau: first_order_lag(TIMES, SIGNAL, tau), (tau,), (jnp.ones(()),))

    lagged, _ = lag_and_slope(jnp.asarray(1e-8))
    np.testing.assert_allclose(lagged[1:], SIGNAL[1:], atol=1e-6)
    _, slope = lag_and_slope(jnp.asarray(0.0))
    assert np.all(np.isfinite(slope))


@pytest.mark.parametrize("effect", [e for e in NAMED if e.takes_numpy], ids=lambda e: e.name)
def test_arrays_of_numpy_of_many_vectors_and_runs_give_what_jax_gives_of_each(effect):
    rng = np.random.default_rng(0)
    values = 0.3 * (1.0 + rng.random((2, len(effect.parameters))))
    times = np.cumsum(rng.random((3, 40)), axis=1)
    clock, before = np.array([1.0, 0.8, 1.1]), np.array([0.0, 2.0, 5.0])
    stress, rate, of_tool = rng.normal(size=(3, 2, 3, 40))

    def of_all(times, clock, before, stress, rate, of_tool, values):
        if isinstance(effect, KinematicEffect):
            return effect.felt_rate(values, times / clock, rate)
        return effect.recorded_stress(values, Record(times, rate, stress, clock, before, of_tool))

    given = (times, clock[:, None], before[:, None], stress, rate, of_tool)
    found = of_all(*given, values.T[..., None, None])
    assert isinstance(found, np.ndarray)
    of_runs = jax.vmap(of_all, (0, 0, 0, 0, 0, 0, None))
    of_vectors = jax.jit(jax.vmap(of_runs, (None, None, None, 0, 0, 0, 0)))
    expected = of_vectors(times, clock, before, stress, rate, of_tool, values)
    # the same sums in another order
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


def test_signal_effects_run_on_the_clock_of_the_instrument_and_a_delay_shifts_the_record():
    slow, fast = record(1.0), record(10.0)
    drift = make_effect("stress_drift")
    at_1 = drift.recorded_stress(jnp.array([2.0]), slow) - SIGNAL
    at_10 = drift.recorded_stress(jnp.array([2.0]), fast) - SIGNAL
    np.testing.assert_allclose(at_1, 10.0 * at_10, atol=1e-12)
    delayed = make_effect("time_delay").recorded_stress(jnp.array([0.05]), record())
    np.testing.assert_allclose(delayed[1:], SIGNAL[:-1], atol=1e-12)
    assert float(delayed[0]) == 0.0


def test_inertia_grows_as_the_square_of_frequency_in_phase_with_the_strains_acceleration():
    inertia = make_effect("instrument_inertia")

    def added(frequency):
        # strain sin(ωt), so that the rate is ω cos(ωt) and the acceleration −ω² sin(ωt)
        times = jnp.linspace(0.0, 2 * jnp.pi / frequency, 2001)
        rate = frequency * jnp.cos(frequency * times)
        flow = Record(times, rate, jnp.zeros_like(times), jnp.ones(()))
        return jnp.sin(frequency * times), inertia.recorded_stress(jnp.array([0.1]), flow)

    (strain, slow), (_, fast) = added(1.0), added(2.0)
    # central differences of step 2π/2000: error of 2e-6, one-sided at the ends
    np.testing.assert_allclose(slow[1:-1], -0.1 * strain[1:-1], atol=1e-6)
    np.testing.assert_allclose(fast[1:-1], 4.0 * slow[1:-1], atol=4e-6)


def test_friction_turns_with_the_direction_and_an_edge_loses_its_share_beyond_a_strain():
    friction = make_effect("bearing_friction").recorded_stress(jnp.array([0.2]), record()) - SIGNAL
    np.testing.assert_allclose(friction, 0.2 * jnp.sign(jnp.cos(TIMES)), atol=1e-15)
    offset = make_effect("stress_offset").recorded_stress(jnp.array([0.2]), record()) - SIGNAL
    np.testing.assert_allclose(offset, 0.2, atol=1e-15)
    steady = Record(TIMES, jnp.full_like(TIMES, 2.0), SIGNAL, jnp.ones(()))
    ratio = make_effect("edge_fracture").recorded_stress(jnp.array([0.3, 3.0]), steady) / SIGNAL
    strain = 2.0 * TIMES
    np.testing.assert_allclose(ratio, jnp.exp(-0.3 * jnp.maximum(strain - 3.0, 0)), rtol=1e-12)


def test_any_library_term_is_an_effect_that_repeats_no_named_one_and_an_unknown_name_is_refused():
    term = make_effect("tr(sigma)*sigma.sigma")
    assert term.kind == "constitutive"
    with pytest.raises(InputError, match="giesekus_mobility"):
        make_effect("gremlins")
    names = {effect.name for effect in library_effects()}
    assert names.isdisjoint({"sigma.sigma", "tr(sigma)*sigma", "sigma.gammadot+gammadot.sigma"})
    assert "tr(sigma)*gammadot" in names


@pytest.mark.parametrize("xi", [0.2, 0.7])
def test_of_two_slips_that_shear_cannot_tell_apart_one_is_possible(xi):
    flow, times = flow_of(2.0), np.geomspace(0.05, 10.0, 60)
    one, other = (JohnsonSegalman(x, 100.0).respond(flow, times) for x in (xi, 2.0 - xi))
    np.testing.assert_allclose(one.sigma12, other.sigma12, atol=1e-6 * np.max(one.sigma12))
    np.testing.assert_allclose(one.N1, other.N1, atol=1e-6 * np.max(one.N1))
    assert np.max(np.abs(one.N2 - other.N2)) > 0.1 * np.max(one.N1)
    slip = make_effect("non_affine_motion").parameters[0]
    assert (slip.low, slip.high) == (0.0, 1.0)


def test_an_effect_has_the_values_that_were_written_and_the_rest_to_be_fitted():
    (known,) = known_effects({"edge_fracture": {"critical_strain": 3.0, "loss": "fit"}})
    # in the order of the dictionary of effects, whatever order they were written in
    assert known.values == (None, 3.0)
    assert known.free == ("loss",)
    assert "to be fitted" in known.text
    (every,) = known_effects({"stress_gain": "fit"})
    assert every.values == (None,)


@pytest.mark.parametrize(
    ("written", "words"),
    [
        ({"stress_gian": "fit"}, "Unknown effect 'stress_gian'"),
        ({"stress_gain": {"gain": 0.1}}, "no parameter 'gain'. Write gain_error"),
        ({"edge_fracture": {"loss": 0.1}}, "needs critical_strain too"),
        ({"stress_gain": {"gain_error": 7.0}}, "between -0.8 and 4"),
        ({"stress_gain": {"gain_error": "free"}}, 'a number or "fit"'),
        ({"stress_gain": 0.1}, 'must be "fit", or give its parameters: gain_error'),
        (["stress_gain"], "must name effects with their values"),
    ],
)
def test_what_is_wrong_is_said_in_one_sentence(written, words):
    with pytest.raises(InputError, match="effects") as caught:
        known_effects(written, "[model] effects")
    assert words in str(caught.value)


RESERVED = {"G", "I", "G_k", "h", "k", "t", "s", r"\lambda", r"\sigma", r"\tau", r"\gamma"}
"""Letters that every page has: modes, stress, strain, time, the structure."""


def letters(effect):
    return {one.symbol.removeprefix("1/") for one in effect.parameters}


def test_letters_of_effects_are_their_own_whatever_their_order_and_none_of_every_pages():
    for effect in named_effects().values():
        assert not letters(effect) & RESERVED, effect.name
    clashes = 0
    for pair in combinations(named_effects().values(), 2):
        spelled = spelled_distinctly(pair)
        own = [*spelled[pair[0].name].symbols.values(), *spelled[pair[1].name].symbols.values()]
        own += [state for one in spelled.values() for state in one.states]
        assert len(set(own)) == len(own), [one.name for one in pair]
        clashes += bool(letters(pair[0]) & letters(pair[1]))
    assert clashes  # without any there would be nothing to spell apart
    # a table lists effects as they were added, an equation as they act
    for pair in combinations(named_effects().values(), 2):
        assert spelled_distinctly(pair) == spelled_distinctly(pair[::-1]), [
            one.name for one in pair
        ]


def test_an_equation_has_the_letters_of_its_table_and_an_exported_law_each_once():
    pair = map(make_effect, ("thixotropy", "thixotropic_relaxation"))
    first, second = spelled_distinctly(pair).values()
    assert first.equation == make_effect("thixotropic_relaxation").equation
    for letter in second.symbols.values():
        assert letter.removeprefix("1/") in second.equation
    assert r"\frac{ds'}{dt} = \frac{1 - s'}{t_\mathrm{b}'}" in second.equation
    assert r"G_k \to s'\,G_k" in second.equation
    values = {"breakdown": 0.2, "build_up_time": 5.0}
    others = {"inverse_critical_rate": 2.0, "build_up_time": 7.0, "exponent": 0.5}
    states = StatePart("thixotropy", values), StatePart("thixotropic_relaxation", others)
    law = Equation((), (1.0,), (1.0,), states=states)
    text = equation_latex(law)
    assert len(re.findall(r"t_\\mathrm\{b\}' = 5", text)) == 1
    assert len(re.findall(r"t_\\mathrm\{b\} = 7", text)) == 1
    assert r"\frac{ds'}{dt}" in law.latex()


@pytest.mark.parametrize("strain", [0.01, 0.1, 1.0])
def test_the_compliance_of_a_sound_tool_times_a_modulus_is_the_same_whatever_the_strain(strain):
    time = np.linspace(0.1, 5.0, 20)
    step = after_step_strain(start_up(0.0), strain, first=0.1)
    stress = strain * 100.0 * np.exp(-time)
    relaxation = Run("step", time, step, 0.0 * time, stress, strain=strain + 0.0 * time)
    size = np.sqrt(np.mean((100.0 * np.exp(-time)) ** 2))
    assert data_scales([relaxation])["compliance"] * size == pytest.approx(1.0)
