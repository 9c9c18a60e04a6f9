"""Expected errors and the next test of a closed loop, from results that are made up."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2

from discover.answer import Discrepancy
from discover.effects import make_effect
from discover.forward import AugmentedModel, DeclaredModel
from discover.loop.answering import _constants, shows_a_derivative
from discover.loop.by_quantity import beyond_noise, errors_by_quantity, with_unseen
from discover.loop.expected_errors import Spread, steady_shear
from discover.loop.findings import LoopFindings
from discover.loop.fitted_range import described, range_of
from discover.loop.from_posterior import FinishedSearch
from discover.loop.parts import ErrorPair, Stage, StageParameter
from discover.loop.runs import RunRecord
from discover.loop.sentences import what_to_measure_next

NOISE = 0.03


def made(name, time, strain, rate, error=0.1, held_out=False, quantity="sigma12"):
    ones = np.ones(len(time))
    return RunRecord(
        name, held_out, time, strain, time, rate, ones, ones[None], np.array([error]),
        quantity=quantity,
    )  # fmt: skip


def record(name, rate, error, held_out=False, quantity="sigma12"):
    time = np.linspace(0.0, 1.0, 5)
    return made(name, time, rate * time, np.full(5, rate), error, held_out, quantity)


def result(records, left=0.06, **more):
    by_run = {r.name: left for r in records if not r.held_out}
    found = {
        "records": records, "left_out": {} if left is None else by_run, "noise_floor": NOISE,
        "folds": (),
        "discrepancy": Discrepancy(left, (0.04, 0.1), by_run),
        "spread_of_laws": {"N1": Spread(0.6, 0.8), "uniaxial": Spread(1.2, 1.3)},
        "verdict": "unexplained", "material": None, "stages": (), "tolerance": 0.05,
        "next_tests": SimpleNamespace(best=None), "error_after": SimpleNamespace(fit=0.05),
        "remaining": {}, "declared_parameters": {}, "free_form": (), "unfitted": (),
    }  # fmt: skip
    made = object.__new__(LoopFindings)  # of parts that are made up as well
    vars(made).update(found | more)
    return made


FITTED = [record("slow", 0.1, 0.02), record("middle", 0.3, 0.03), record("fast", 1.0, 0.05)]


def test_first_line_and_table_have_one_error_of_all_unseen_runs_without_noise():
    held = record("seen not", 0.5, float(np.hypot(0.12, NOISE)), held_out=True)
    found = result([*FITTED, held])
    size = (3 * 0.06 + 0.12) / 4  # the mean over runs, as everywhere
    told = with_unseen(found)
    assert told.size == pytest.approx(size)
    assert errors_by_quantity(found)["sigma12"].inside == pytest.approx(size)
    # deviation of four normal draws
    assert told.ci95 == pytest.approx(size * np.sqrt(4 / chi2.ppf((0.975, 0.025), 4)))
    assert told.by_run["seen not"] == pytest.approx(0.12)
    assert told.unseen == "unseen runs"
    assert with_unseen(result(FITTED)).unseen == "unseen runs"
    # runs left out in turn and others held out have one name
    assert errors_by_quantity(found)["sigma12"].note == "4 unseen runs"
    assert errors_by_quantity(result(FITTED))["sigma12"].note == "3 unseen runs"


def ended(verdict, known=None):
    """A posterior of a run with 1 % noise on a slow residual of 6 %, all taken for noise."""
    time = np.linspace(0.0, 1.0, 800)
    left = 0.06 * np.sin(9.0 * time) + 0.01 * np.random.default_rng(0).standard_normal(800)
    run = SimpleNamespace(held_out=False, relative_residual=np.array([left]))
    raw = np.array([0.07, 0.08])
    fit = SimpleNamespace(noise=SimpleNamespace(sizes=np.array([0.06])), memory={"missed": raw})
    posterior = SimpleNamespace(
        problem=SimpleNamespace(noise=known), left=SimpleNamespace(fit=fit),
        missed=lambda fit: np.sqrt(raw**2 - 0.06**2),
    )  # fmt: skip
    found = SimpleNamespace(
        posterior=posterior, fit=fit, verdict=verdict, records=[run], without_fluid=False
    )
    found.noise = FinishedSearch.noise.fget(found)
    return found


def test_noise_is_what_changes_from_sample_to_sample_where_a_residual_is_left():
    # the deviation of a median of 800 differences is some 5 %
    assert ended("unexplained").noise == pytest.approx(0.01, rel=0.2)
    assert ended("effects_added").noise == pytest.approx(0.06)  # there the fit has its noise
    assert ended("unexplained", known=0.02).noise == 0.02


def test_a_run_beyond_the_rates_does_not_count_inside():
    held = record("faster", 3.0, 0.5, held_out=True)
    found = result([*FITTED, held])
    errors = errors_by_quantity(found)["sigma12"]
    assert errors.inside == pytest.approx(0.06)
    assert errors.beyond == pytest.approx(np.sqrt(0.5**2 - NOISE**2))
    assert errors.beyond_at == "measured at 3 1/s"
    # missed by less than those inside, it is no reason to expect less there
    held = record("faster", 3.0, 0.04, held_out=True)
    errors = errors_by_quantity(result([*FITTED, held]))["sigma12"]
    assert (errors.beyond, errors.beyond_at) == (errors.inside, "as in range")
    computed = errors_by_quantity(result(FITTED, spread_of_laws={"sigma12": Spread(0.1, 0.2)}))
    assert (computed["sigma12"].beyond, computed["sigma12"].spread) == (0.2, (None, 0.2))


def test_each_quantity_has_the_error_of_its_own_unseen_runs_and_fitted_ones_a_residual():
    found = result([FITTED[0]], left=None)
    vars(found)["discrepancy"] = Discrepancy(0.02, (0.01, 0.03))
    assert not with_unseen(found).unseen
    assert errors_by_quantity(found)["sigma12"].inside is None
    normal = record("slow (N1)", 0.1, 0.05, quantity="N1")
    told = errors_by_quantity(result([*FITTED, normal], left_out={}))["N1"]
    assert told.is_residual
    assert told.inside == pytest.approx(0.04)  # 0.05² = 0.04² + 0.03²
    pulled = [
        replace(record(name, 0.3, error, held, "tensile_stress"), flow="uniaxial")
        for name, error, held in (("pulled", 0.09, False), ("pulled fast", 0.5, True))
    ]
    left = {**dict.fromkeys(("slow", "middle", "fast"), 0.06), "pulled": 0.2}
    told = errors_by_quantity(result([*FITTED, *pulled], left_out=left))
    assert told["sigma12"].inside == pytest.approx(0.06)  # no extension in it
    held = float(np.sqrt(0.5**2 - NOISE**2))
    assert told["uniaxial"].inside == pytest.approx((0.2 + held) / 2)
    assert not told["uniaxial"].is_residual
    moduli = [record(name, 0.1, 0.1, quantity=name) for name in ("storage_modulus", "loss_modulus")]
    swept = result(moduli, left_out={"storage_modulus": 0.1, "loss_modulus": 0.3})
    assert errors_by_quantity(swept)["sigma12"].inside == pytest.approx(0.2)  # they are of σ12


def test_the_stress_of_runs_of_which_n1_alone_was_fitted_is_measured():
    normal = [replace(one, name=f"{one.name} (N1)", quantity="N1") for one in FITTED]
    judged = [replace(one, held_out=True) for one in FITTED]
    told = errors_by_quantity(result([*normal, *judged]))["sigma12"]
    assert told.inside == pytest.approx(
        np.mean([beyond_noise(e, NOISE) for e in (0.02, 0.03, 0.05)])
    )
    assert "not fitted" in told.note


def test_both_normal_stresses_rest_on_the_law_where_it_settles_them():
    close = {"N1": Spread(0.01, 0.02), "N2": Spread(0.001, 0.001, -0.09, over_n1_rate=0.1)}
    told = errors_by_quantity(result(FITTED, 0.005, spread_of_laws=close))
    assert (told["N1"].note, told["N1"].spread) == ("", (0.01, 0.02))
    recorded = [replace(FITTED[0], has_normal_stress=True), *FITTED[1:]]
    found = result(recorded, spread_of_laws=close)
    assert errors_by_quantity(found)["N1"].note == "measured but not used"
    vars(found)["spread_of_laws"] = {}
    assert errors_by_quantity(found)["N1"].missing == "measured but not used"
    vars(found)["spread_of_laws"] = {"N1": Spread(0.6, 0.8)}
    unsure = errors_by_quantity(found)["N1"].note
    assert unsure == "not determined, laws differ by over 20 %, measured but not used"
    assert told["N2"].note == "N2/N1 ≈ −0.09 at 0.1 1/s by this law"
    assert told["N2"].missing == "not measured"
    assert not told["N2"].is_known
    affine = {**close, "N2": Spread(0.0, 0.0, 1e-9)}  # but for the integrator
    assert errors_by_quantity(result(FITTED, spread_of_laws=affine))["N2"].note == "0 by this law"
    wide = {**close, "N2": Spread(0.3, 0.4, -0.09)}
    unsettled = errors_by_quantity(result(FITTED, spread_of_laws=wide))["N2"]
    assert unsettled.missing == "not determined"
    assert unsettled.note == "not determined, laws differ by over 5 % of N1"
    apart = errors_by_quantity(result(FITTED))
    assert (apart["N1"].note, apart["N1"].spread) == (
        "not determined, laws differ by over 20 %",
        (0.6, 0.8),
    )
    assert {apart[kind].missing for kind in ("N1", "uniaxial")} == {"not determined"}


def stage(effect, ends, evidence, check):
    return SimpleNamespace(
        effect=effect, kind="signal", evidence=evidence, check=check, aliases=(),
        parameters={"amplitude": SimpleNamespace(ci95=ends)},
    )  # fmt: skip


def test_next_comes_the_suspect_then_the_open_stress_then_the_worst_run_again():
    edge = stage("edge_fracture", (0.01, 0.03), 5.0, "Watch the edge; repeat with another cone.")
    slip = stage("wall_slip", (0.0, 0.03), 9.0, "Repeat with another gap.")
    told = what_to_measure_next(result(FITTED, stages=(slip, edge)))
    assert told.startswith("To confirm torque loss with strain, ")
    assert told.endswith("watch the edge; repeat with another cone.")
    told = what_to_measure_next(close())
    assert told == "Measure N1 at 1 1/s: equally good laws differ by 60 %."
    normal = record("slow", 0.1, 0.05, quantity="N1")
    assert "uniaxial extension" in what_to_measure_next(close([*FITTED, normal]))
    # a normal stress that no transducer resolves is not asked for, one of twice the least is
    for size, asked in ((0.05, "Measure uniaxial extension"), (2.0, "Measure N1")):
        weak = {"N1": Spread(0.6, 0.8, stress=size), "uniaxial": Spread(1.2, 1.3)}
        assert what_to_measure_next(close(spread_of_laws=weak)).startswith(asked)
    # nor is a liquid stretched that does not keep its shape, such as blood of 0.01 Pa s
    for viscosity, asked in (
        (0.03, "Repeat the start-up at 1 1/s (fast)"),
        (3e4, "Measure uniaxial extension"),
    ):
        thin = {"N1": Spread(0.6, 0.8, stress=0.05), "uniaxial": Spread(1.2, 1.3, stress=viscosity)}
        told = what_to_measure_next(close(spread_of_laws=thin, discrepancy=None))
        assert told.startswith(asked)  # at 1 1/s
    same = {"N1": Spread(0.01, 0.01), "uniaxial": Spread(5.0, 5.0)}  # alike, and diverging
    again = what_to_measure_next(close(spread_of_laws=same, discrepancy=None))
    assert again.startswith("Repeat the start-up at 1 1/s (fast) with another gap")


def test_a_sweep_of_other_moduli_than_the_runs_is_repeated_on_their_loading():
    factor = StageParameter(0.52, (0.04, 0.79), "1")
    again = "Measure sweep and runs on one loading: the runs' "
    for name, what in (
        ("modulus_factor", "moduli"),
        ("relaxation_time_factor", "relaxation times"),
    ):
        assert what_to_measure_next(close(declared_parameters={name: factor})) == (
            f"{again}{what} are 0.04–0.79 × the sweep's."
        )
    # one next to one, within the tolerance of 10 %, one that is no value; and without a sweep
    others = [{"modulus_factor": replace(factor, ci95=ends)}
              for ends in ((0.5, 0.92), (0.4, 1.1), (0.001, 60.0))]  # fmt: skip
    for other in (*others, {"modulus_Pa": replace(factor, value=0.5)}):
        assert not what_to_measure_next(close(declared_parameters=other)).startswith(again)


def close(records=FITTED, **more):
    """Return a result whose misses of 6 % are within the tolerance."""
    return result(records, tolerance=0.1, **more)


def test_what_was_measured_comes_before_another_stress_and_what_was_not_fitted_first():
    pulled = replace(record("pulled", 0.3, 0.4, quantity="tensile_stress"), flow="uniaxial")
    found = result([*FITTED, pulled])  # misses of 6 %, tolerance 5 %
    found.discrepancy.by_run.update({"slow": 0.05, "middle": 0.05, "fast": 0.08, "pulled": 0.4})
    told = what_to_measure_next(found)
    assert told == (
        "Repeat the start-up at 1 1/s (fast) with another gap to separate instrument from model "
        "error."
    )
    # a miss within the noise is none to look into
    assert what_to_measure_next(result(FITTED, noise_floor=0.1)).startswith("Measure N1")


def test_a_normal_stress_that_the_law_predicts_is_what_tests_it():
    pair = ErrorPair(0.05, None)
    law = Stage("ptt_linear", "constitutive", {}, (), pair, 99.0, "", "", "Extend it.")
    known = {"N1": Spread(0.014, 0.02, stress=100.0, steady=251.0), "uniaxial": Spread(0.01, 0.01)}
    found = result(
        FITTED, verdict="effects_added", stages=(law,), spread_of_laws=known,
        explanations=SimpleNamespace(holding=lambda names: None),
    )  # fmt: skip
    assert what_to_measure_next(found) == (
        "Measure N1 in steady shear at 1 1/s: the law predicts 250 Pa."
    )
    vars(found)["records"] = [replace(FITTED[0], has_normal_stress=True), *FITTED[1:]]
    assert what_to_measure_next(found).startswith("Fit N1 too, which runs recorded")
    # not where it cannot be measured, was, or other effects make the same records
    check = "To confirm linear PTT, extend it."
    known["N1"] = replace(known["N1"], stress=0.5)
    assert what_to_measure_next(found) == check
    known["N1"] = replace(known["N1"], stress=100.0)
    vars(found)["records"] = [*FITTED, record("slow", 0.1, 0.05, quantity="N1")]
    assert what_to_measure_next(found) == check
    vars(found).update(records=FITTED, stages=(replace(law, aliases=("wall_slip",)),))
    assert what_to_measure_next(found).startswith("To distinguish linear PTT from wall slip")


def test_shifted_runs_are_told_by_the_rates_and_temperatures_of_the_measurement():
    def shifted(one, temperature, factor):
        return replace(one, instrument_time=factor * one.time, temperature_C=temperature)

    fitted = [shifted(one, -10.0, 0.01) for one in FITTED]
    cold = [shifted(record(f"cold {rate:g}", rate, 0.2, True), -23.0, 0.1) for rate in (2.0, 5.0)]
    told = range_of([*fitted, *cold])
    assert told.rate_1_s == pytest.approx((0.1, 1.0))  # where the moduli and times hold
    assert list(told.by_temperature) == [-10.0]
    assert told.by_temperature[-10.0].rate_1_s == pytest.approx((10.0, 100.0))
    found = result([*fitted, *cold])
    assert errors_by_quantity(found)["sigma12"].beyond_at == (
        "measured at 20–50 1/s at −23 °C, equivalent to 200–500 1/s at −10 °C"
    )
    vars(found)["tolerance"] = 0.1
    assert what_to_measure_next(found).startswith("Measure N1 at 100 1/s and −10 °C: equally")
    # what was not shifted, or has no known temperature, is told as it is
    assert not range_of(FITTED).by_temperature
    assert not range_of([*fitted, FITTED[0]]).by_temperature
    at_reference = replace(FITTED[0], temperature_C=-35.0)
    assert list(range_of([*fitted, at_reference]).by_temperature) == [-10.0, -35.0]


def test_a_tolerance_is_met_up_to_the_rate_below_the_slowest_run_that_misses_it():
    names = [one.name for one in FITTED]
    for own, met in (((0.01, 0.02, 0.06), "0.3 1/s"), ((0.01, 0.06, 0.02), "0.1 1/s"),
                     ((0.06, 0.01, 0.01), ""), ((0.01, 0.02, 0.03), "")):  # fmt: skip
        told = with_unseen(result(FITTED, left_out=dict(zip(names, own, strict=True))))
        assert told.met_up_to == met
    # a stress and an extension have no rates in common
    pulled = replace(record("pulled", 3.0, 0.5, quantity="tensile_stress"), flow="uniaxial")
    left = {"slow": 0.01, "middle": 0.02, "fast": 0.03, "pulled": 0.5}
    assert not with_unseen(result([*FITTED, pulled], left_out=left)).met_up_to


def test_what_was_measured_and_missed_but_not_fitted_is_fitted_next():
    held = record("pulled", 0.3, 0.5, held_out=True, quantity="tensile_stress")
    found = close([*FITTED, replace(held, flow="uniaxial")])
    assert errors_by_quantity(found)["uniaxial"].note == "1 run at 0.3 1/s, not fitted"
    told = what_to_measure_next(found)
    assert told == "Fit the recorded uniaxial extension too."
    vars(found)["tolerance"] = 0.55
    assert what_to_measure_next(found).startswith("Measure N1")
    both = replace(held, flow="uniaxial", held_out=False)
    assert not what_to_measure_next(close([*FITTED, both])).startswith("Fit")


def test_a_normal_stress_that_runs_recorded_and_no_fit_saw_is_compared():
    normal = record("slow (N1)", 0.1, 0.4, held_out=True, quantity="N1")
    found = close(FITTED, unfitted=(normal,))
    told = errors_by_quantity(found)["N1"]
    assert told.inside == 0.4  # constant: no noise of its own, and none of σ12 is subtracted
    assert told.note == "1 run at 0.1 1/s, neither fitted nor corrected for axial compliance"
    assert what_to_measure_next(found) == "Fit N1, corrected for axial compliance."
    fast = replace(normal, rate=3.0 + normal.rate)
    assert errors_by_quantity(close(FITTED, unfitted=(normal, fast)))["N1"].beyond == 0.4
    # samples that scatter by 0.4 hold nothing else
    lot = np.random.default_rng(0)
    measured = 1.0 + 0.4 * lot.standard_normal(400)
    size = 0.4 / np.hypot(1.0, 0.4)  # over the root mean square
    noisy = replace(normal, measured=measured, errors=np.array([size]))
    # 400 samples tell their scatter to some 5 %: sqrt(2 × 0.05) of it is left at most
    assert errors_by_quantity(close(FITTED, unfitted=(noisy,)))["N1"].inside < 0.32 * 0.4


def test_constants_of_an_effect_that_may_be_absent_are_not_determined():
    two = {
        "inverse_critical_stress": StageParameter(5.2, (0.0, 13.9), "1/Pa"),
        "build_up_time": StageParameter(1.0, (0.6, 1.6), "s"),
    }
    name = "thixotropic_relaxation_by_stress"
    first, second = _constants(two, (), name)
    assert first.may_be_absent
    assert not second.determined
    two["inverse_critical_stress"] = StageParameter(5.2, (1.0, 13.9), "1/Pa")
    assert all(one.determined for one in _constants(two, (), name))


@pytest.mark.parametrize("alpha", [0.49, 0.7])
def test_a_flow_curve_that_falls_says_from_which_rate_and_its_n1_at_the_fastest(alpha):
    # a Giesekus mode in steady shear, in closed form [Giesekus 1982]: it rises where α ≤ 1/2
    rates = np.geomspace(0.3, 30.0, 2000)
    root = 16.0 * alpha * (1.0 - alpha) * rates**2
    chi = np.sqrt((np.sqrt(1.0 + root) - 1.0) / (0.5 * root))
    f = (1.0 - chi) / (1.0 + (1.0 - 2.0 * alpha) * chi)
    stress = rates * (1.0 - f) ** 2 / (1.0 + (1.0 - 2.0 * alpha) * f)
    n1 = 2.0 * f * (1.0 - alpha * f) / (alpha * (1.0 - f))
    peak = rates[np.argmax(stress)]
    law = DeclaredModel.named("giesekus", {"alpha": alpha}, np.ones(1), np.ones(1))
    model = AugmentedModel(law, [make_effect("edge_fracture")])
    theta = model.zero()
    theta[model.slices["edge_fracture"].start] = 0.02  # the instrument is none of the law
    found, fastest_n1 = steady_shear(model, theta, [0.3, 30.0])
    assert fastest_n1 == pytest.approx(n1[-1], rel=1e-4)  # of an integration to a strain of 100
    if alpha < 0.5:
        assert found is None
        return
    # 33 rates in two decades are 15 % apart
    assert found == pytest.approx(peak, rel=0.15)


def test_an_oscillation_has_an_amplitude_states_are_steady_and_linear_runs_no_derivative():
    time = np.linspace(0.0, 4.0 * np.pi, 801)
    wave = made("wave", time, 0.4 * np.sin(2.0 * time), 0.8 * np.cos(2.0 * time))
    told = range_of([wave])
    assert told.amplitude == pytest.approx((0.4, 0.4), rel=1e-3)  # its samples miss the peak
    assert range_of([wave, FITTED[0]]).amplitude is None
    assert range_of([replace(FITTED[0], control="steady")]).steady
    assert not range_of(FITTED).steady
    close, apart = Spread(0.01, 0.02), Spread(0.5, 0.6)
    assert not shows_a_derivative(result(FITTED, spread_of_laws={"N1": apart}))
    assert not shows_a_derivative(result(FITTED, spread_of_laws={}))
    assert shows_a_derivative(result(FITTED, spread_of_laws={"N1": close}))
    normal = record("slow", 0.1, 0.05, quantity="N1")
    assert shows_a_derivative(result([*FITTED, normal], spread_of_laws={"N1": apart}))


def test_runs_at_two_temperatures_that_nobody_shifted_are_to_be_fitted_apart():
    hot, cold = (
        replace(one, temperature_C=at) for one, at in zip(FITTED[:2], (160.0, 140.0), strict=True)
    )
    found = result([hot, cold])
    assert what_to_measure_next(found).startswith("Fit runs of one temperature")
    vars(found)["records"] = [hot, replace(cold, temperature_C=160.0)]
    assert not what_to_measure_next(found).startswith("Fit runs of one temperature")


def test_a_range_of_rates_is_where_runs_stay_and_says_their_tests():
    time = np.linspace(0.0, 60.0, 601)
    # measured while it falls from the rate before
    down = made("down", time, 0.1 * time, np.where(time < 0.3, 10.0, 0.1))
    assert range_of([down]).rate_1_s == pytest.approx((0.1, 10.0))
    assert range_of(FITTED).rate_1_s == pytest.approx((0.1, 1.0))
    wave = record("wave", 1.0, 0.1)
    assert range_of(FITTED).tests == ("start-up",)
    assert range_of([*FITTED, down, replace(FITTED[0], control="stress")]).tests == (
        "steps of rate", "start-up", "creep",
    )  # fmt: skip
    # relaxation after a step strain: at rest, so of no rate
    assert range_of([record("relaxation.csv", 0.0, 0.1)]).tests == ("stress relaxation",)
    assert described(record("relaxation.csv", 0.0, 0.1)) == "relaxation.csv"
    assert described(FITTED[0]) == "the start-up at 0.1 1/s (slow)"
    backwards = replace(wave, rate=-wave.rate)
    assert range_of([backwards]) == range_of([wave])  # a start-up in the other direction
    reversed_once = replace(wave, rate=np.array([1.0, 1.0, 1.0, -1.0, -1.0]))
    assert range_of([reversed_once]).tests == ("steps of rate",)
    assert not range_of([reversed_once]).oscillates
    angle = np.linspace(0.0, 4.9, 50)
    cycle = made("cycle", angle, np.sin(angle), 2.0 * np.cos(angle))  # turns once
    assert not range_of([cycle]).tests
    # after a steady flow nothing starts up, and the rate of that flow is in the range
    after = replace(FITTED[0], rate_before=4.0)
    assert range_of([after]).tests == ("steps of rate",)
    assert range_of([after]).rate_1_s == pytest.approx((0.1, 4.0))
    assert described(after) == "the step from 4 to 0.1 1/s (slow)"
    stopped = replace(after, rate=np.zeros(len(after.time)))
    assert range_of([stopped]).tests == ("cessation",)
    assert described(stopped) == "the step from 4 to 0 1/s (slow)"
    # creep to a constant strain: slopes of its noise turn, and nothing oscillates
    noise = np.where(np.arange(len(after.time)) % 2, -1e-3, 1e-3)
    assert range_of([replace(FITTED[0], control="stress", rate=noise)]).tests == ("creep",)
    assert range_of([cycle]).oscillates
    turns = replace(wave, rate=np.array([2.0, 0.1, -2.0, 0.1, 2.0]))
    assert not range_of([turns]).tests
    assert range_of([turns]).rate_1_s == pytest.approx((2.0, 2.0))  # its amplitude


@pytest.mark.parametrize("missed", [0.66, 0.1, 0.01])
def test_a_law_that_misses_the_stress_claims_no_better_normal_stress(missed):
    # one law alone, or laws that are alike, differ by 5 %; what it is worth shows in σ12
    found = result(FITTED, missed, spread_of_laws={"N1": Spread(0.05, 0.05)})
    told = errors_by_quantity(found)["N1"]
    assert told.inside is None  # a spread of laws is no error, of N1 as of extension
    assert told.spread[0] == pytest.approx(max(missed, 0.05))
