"""Constants of the declared law that differ from mode to mode; stresses by scipy."""

from functools import cache

import numpy as np
import pytest
from independent import Giesekus, multimode_giesekus
from independent import start_up as flow
from independent.folders import write_table
from independent.homogeneous import GiesekusFluid
from independent.noise import white
from noisy_runs import run_at, start_ups

import discover as dc
from discover.dataset import Dataset, Run
from discover.effects import known_effects, make_effect
from discover.errors import InputError
from discover.forward import AugmentedModel, make_batch
from discover.forward.declared import DEGREE
from discover.inference import Problem
from discover.inference.fits import Fitter
from discover.inference.search import Search, without_by_mode
from discover.loop import DeclaredModel
from discover.protocols import in_flow, start_up
from discover.report.plots.loop.residual import by_mode_picture

MODULI, TIMES = (30.0, 100.0, 300.0), (5.0, 0.5, 0.05)
RATES, NOISE = (0.3, 1.0, 4.0, 15.0, 60.0), 0.01
pytestmark = pytest.mark.usefixtures("without_curves", "verdict_alone")


@cache
def data(mobilities, rates=RATES):
    """Return start-ups of shear with white noise, each of 12 s over the root of the rate."""
    generator, runs = np.random.default_rng(0), []
    fluid = multimode_giesekus(mobilities, MODULI, TIMES)
    for rate in rates:
        times = np.geomspace(0.02, 12.0, 50) / np.sqrt(rate)
        stress = white(fluid.respond(flow(rate), times).sigma12, NOISE, generator)
        runs.append(run_at(rate, times, stress, f"{rate}"))
    return Dataset("three modes", tuple(runs))


def assert_near(modes, mobilities):
    """Assert that each lies in twice its interval: of six of 95 % one may miss."""
    for mode, mobility in zip(modes, mobilities, strict=True):
        low, high = mode.ci95
        assert low - 0.5 * (high - low) <= mobility <= high + 0.5 * (high - low)


@cache
def loop(mobilities, rates=RATES, by_mode=("alpha",)):
    base = dc.Fluid(dc.make_law("giesekus", {"alpha": 0.2}), MODULI, TIMES)
    return dc.close_loop(
        data(mobilities, rates), base, free=["alpha"], by_mode=by_mode, effects=["stress_gain"],
        max_effects=1, explanations=1,
    )  # fmt: skip


@pytest.mark.parametrize(
    "mobilities", [(0.1, 0.3, 0.6), pytest.param((0.5, 0.1, 0.5), marks=pytest.mark.slow)]
)
def test_the_constant_of_each_mode_is_found(mobilities):
    result = loop(mobilities)
    found = result.declared_parameters["alpha"]
    assert result.verdict == "no_effect_needed"
    # the noise alone is left
    assert result.error_after.fit == pytest.approx(NOISE, rel=0.1)
    assert result.differing_by_mode == ("alpha",)
    assert_near(found.modes, mobilities)
    for mode in found.modes:
        assert mode.ci95[1] - mode.ci95[0] < 0.1
    # one constant leaves some 9 %
    assert found.evidence[-1] > 100.0


@pytest.mark.slow
def test_a_mode_that_no_flow_reaches_is_not_determined_and_the_picture_says_so():
    # at 1 1/s the fastest mode feels a Weissenberg number of 0.05
    loop_of_slow = loop((0.1, 0.3, 0.6), rates=(0.1, 0.3, 1.0))
    slow = loop_of_slow.declared_parameters["alpha"]
    assert [mode.left_open for mode in slow.modes] == [False, False, True]
    assert slow.modes[2].ci95 is None
    drawn = by_mode_picture(loop_of_slow.by_mode, False)
    assert "not determined by these data" in drawn.svg
    assert by_mode_picture({}, False) is None


@pytest.mark.slow
def test_an_effect_that_the_loop_adds_gets_a_constant_for_each_mode():
    base = dc.Fluid(dc.make_law("ucm"), MODULI, TIMES)
    asked = {"effects": ["giesekus_mobility", "stress_gain"], "by_mode": ["giesekus_mobility"]}
    result = dc.close_loop(data((0.1, 0.3, 0.6)), base, **asked)
    stage = next(one for one in result.stages if one.effect == "giesekus_mobility")
    found = stage.parameters["alpha"]
    of_law = loop((0.1, 0.3, 0.6)).declared_parameters["alpha"]
    assert (result.verdict, result.differing_by_mode) == ("effects_added", ("giesekus_mobility",))
    # the same fluid as the Giesekus law by mode, to where fits stop
    for mode, same in zip(found.modes, of_law.modes, strict=True):
        assert mode.value == pytest.approx(same.value, rel=1e-2)
    named = result.equation().named
    assert named.law == "giesekus"
    assert [one["alpha"] for one in named.constants] == [mode.value for mode in found.modes]
    # and with equal mobilities it stays one constant
    equal = dc.close_loop(data((0.3, 0.3, 0.3)), base, **asked)
    assert equal.differing_by_mode == ()
    assert equal.equation().terms[0].coefficient == pytest.approx(0.3, rel=0.02)


def test_a_library_term_by_mode_that_does_not_differ_is_the_term():
    name = "tr(sigma.sigma)*sigma"
    run = data((0.3, 0.3, 0.3)).runs[2]
    batch, predicted = make_batch([run]), []
    for by_mode in ((), (name,)):
        declared = DeclaredModel.maxwell(MODULI, TIMES, by_mode=by_mode)
        model = AugmentedModel(declared, [make_effect(name)])
        theta = model.zero()
        theta[model.positions(name)] = 0.02
        predicted.append(model.predict(theta, batch))
        theta[model.varying(name)[:1]] = 1e-3
        varied = model.predict(theta, batch)
    np.testing.assert_allclose(*predicted, rtol=1e-12)
    assert np.max(np.abs(varied / predicted[1] - 1.0)) > 1e-3


def declared_by(name):
    if name == "alpha":
        known, how = {"alpha": 0.3}, {"free": ["alpha"], "by_mode": ("alpha",)}
        return DeclaredModel.named("giesekus", known, MODULI, TIMES, **how)
    effects = known_effects({name: "fit"})
    return DeclaredModel.maxwell(MODULI, TIMES, effects=effects, by_mode=(name,))


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        ("shear", "giesekus_mobility"), ("uniaxial", "alpha"),
        pytest.param("shear", "alpha", marks=pytest.mark.slow),
        pytest.param("uniaxial", "giesekus_mobility", marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_the_forward_model_gives_each_mode_its_constant(kind, name):
    mobilities = np.array([0.1, 0.3, 0.6])
    model = AugmentedModel(declared_by(name), [])
    theta = model.zero()
    theta[model.constant(name)[1]] = 0.3
    deviations = np.log(mobilities / (1.0 - mobilities)) - np.log(0.3 / 0.7)
    theta[model.varying(name)[DEGREE:]] = deviations
    times = np.linspace(0.05, 2.0, 30)
    truth = sum(
        GiesekusFluid((g,), (t,), a).recorded(kind, lambda _: 2.0, times)
        for g, t, a in zip(MODULI, TIMES, mobilities, strict=True)
    )
    run = Run("x", times, in_flow(start_up(2.0), kind), np.full(30, 2.0), truth)
    predicted = model.predict(theta, make_batch([run], strain_step=0.05))[0]
    # the integrator's error on such steps
    np.testing.assert_allclose(predicted, truth, atol=1e-3 * np.max(np.abs(truth)))


@pytest.mark.slow
def test_a_flow_curve_tells_each_constant(tmp_path):
    # steady shear in closed form   [Bird, Armstrong & Hassager 1987, table 7.3-2]
    mobilities, rates = (0.1, 0.3, 0.6), np.geomspace(0.03, 300.0, 60)
    modes = [Giesekus(*of) for of in zip(mobilities, MODULI, TIMES, strict=True)]
    stress = np.array([sum(mode.steady_shear(rate)[0] for mode in modes) for rate in rates])
    noise = NOISE * np.random.default_rng(0).standard_normal(len(rates))
    columns = {"shear_rate_1_s": rates, "stress_Pa": stress * (1.0 + noise)}
    write_table(tmp_path / "flow_curve.csv", columns)
    curve = dc.load_dataset(tmp_path).with_material_functions()
    base = dc.Fluid(dc.make_law("giesekus", {"alpha": 0.2}), MODULI, TIMES)
    found = dc.close_loop(
        curve, base, free=["alpha"], by_mode=["alpha"], effects=["stress_gain"], max_effects=0
    ).declared_parameters["alpha"]
    assert found.degree > 0
    assert_near(found.modes, mobilities)


def test_a_law_by_mode_is_written_out_with_the_constants_of_each():
    result = loop((0.1, 0.3, 0.6))
    assert result.fluid is None
    named = result.equation().named
    assert named.law == "giesekus"
    found = [mode.value for mode in result.declared_parameters["alpha"].modes]
    assert [one["alpha"] for one in named.constants] == pytest.approx(found)
    declared = result.to_json()["declared"]
    assert (declared["effects"], declared["by_mode"]) == ([], ["alpha"])
    # what the loop started from, for others to start from
    assert [one["alpha"] for one in declared["law"]["named"]["constants"]] == pytest.approx(found)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"free": [], "by_mode": ("alpha",)}, "no parameter of the law that is fitted"),
        ({"by_mode": ("xi",)}, "by_mode names 'xi'"),
        ({"by_mode": ("modulus_Pa",), "free": ["modulus_Pa"]}, "by_mode names 'modulus_Pa'"),
        ({"by_mode": ("alpha", "alpha")}, "twice"),
        ({"by_mode": "alpha"}, r"Write \['alpha'\]"),
        ({"by_mode": ("alpha",), "modes": 1}, "has one mode"),
        ({"by_mode": ("thixotropy",)}, "adds no term to the law of each mode"),
        ({"by_mode": ("ptt_linear",), "effects": ["stress_gain"]}, "nor a candidate"),
        (
            {"by_mode": ("ptt_linear",), "known_effects": {"ptt_linear": {"epsilon": 0.1}}},
            "whose epsilon has a value",
        ),
    ],
)
def test_what_cannot_differ_by_mode_is_refused(options, text):
    modes = options.pop("modes", 3)
    base = dc.Fluid(dc.make_law("giesekus", {"alpha": 0.2}), MODULI[:modes], TIMES[:modes])
    with pytest.raises(InputError, match=text):
        dc.close_loop(data((0.3, 0.3, 0.3)), base, **({"free": ["alpha"]} | options))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mobilities", "differing"), [((0.1, 0.3, 0.6), ("giesekus_mobility",)), ((0.3, 0.3, 0.3), ())]
)
def test_constants_by_mode_are_found_unasked_where_one_does_not_explain(mobilities, differing):
    base = dc.Fluid(dc.make_law("ucm"), MODULI, TIMES)
    # other explanations change neither stages nor constants by mode
    asked = {"effects": ["giesekus_mobility", "stress_gain"], "max_effects": 2, "explanations": 1}
    result = dc.close_loop(data(mobilities), base, held_out=[f"{RATES[2]}"], **asked)
    assert result.verdict == "effects_added"
    assert [stage.effect for stage in result.stages] == ["giesekus_mobility"]
    assert result.differing_by_mode == differing
    if differing:
        # 50 samples of noise
        assert result.error_after.held_out == pytest.approx(NOISE, rel=0.3)
    else:
        low, high = result.stages[0].parameters["alpha"].ci95
        assert low < 0.3 < high


def test_a_search_with_constants_by_mode_fits_nothing_again_that_has_none(monkeypatch):
    gain, mobility = "stress_gain", "giesekus_mobility"
    fitters = [
        Fitter(problem, problem.fitted)
        for by_mode in ((), (mobility,))
        for declared in [DeclaredModel.maxwell(MODULI, TIMES, by_mode=by_mode)]
        for effects in [[make_effect(mobility), make_effect(gain)]]
        for problem in [Problem(declared, effects, data((0.1, 0.3, 0.6)).runs)]
    ]
    first, fitter = Search(fitters[0], most=2).run(), fitters[1]
    known = without_by_mode(first, fitter)
    assert set(known) == {frozenset(), frozenset({gain})}
    predicted = fitter.predict([fit.theta for fit in known.values()])
    # the same fluid by other code, to rounding
    np.testing.assert_allclose(predicted, [fit.predicted for fit in known.values()], rtol=1e-9)
    fitted, fit = [], fitter.fit
    monkeypatch.setattr(
        fitter, "fit", lambda starts, **how: fit(fitted.extend(starts) or starts, **how)
    )
    second = Search(fitter, most=2, known=known).run()
    assert {mobility in start.names for start in fitted} == {True}
    assert {*second.found} == {*first.found}
    # each mode has a constant of its own here
    assert second.ranked()[0].log_evidence > first.ranked()[0].log_evidence + 100.0


def test_a_law_that_needs_constants_by_mode_is_weighed_with_them_by_all_runs():
    # slow runs, and a threefold rate that judges: with one mobility for all modes non-affine motion
    # is likelier, by a factor of some 400
    moduli, times = (200.0, 100.0, 50.0), (0.1, 1.0, 10.0)
    fluid, rates = multimode_giesekus((0.081, 0.417, 0.081), moduli, times), (0.02, 0.05, 0.1, 0.06)
    data = start_ups(fluid, (*rates, 0.3), np.geomspace(0.02, 20.0, 60), NOISE, seed=1)
    base = dc.Fluid(dc.make_law("ucm"), moduli, times)
    result = dc.close_loop(data, base, held_out=["0.06", "0.3"], effects="named", max_effects=1)
    assert result.verdict == "effects_added"
    assert ("giesekus_mobility",) in result.explanations.likeliest_first[0].members
