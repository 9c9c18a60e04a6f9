"""What the loop says of creep, curves, sweeps, extension and N1, by scipy and closed forms."""

import json
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from command_line import invoke
from independent import Giesekus
from independent import start_up as flow_at
from independent.folders import maxwell_sweep, write_table
from independent.homogeneous import GiesekusFluid
from independent.noise import white
from independent.sweeps import giesekus_modulus, strain_at

import discover as dc
from discover.dataset import Dataset, Run
from discover.loop import DeclaredModel, run_loop
from discover.loop.runs import unfitted_runs
from discover.protocols import in_flow, start_up
from discover.report.predictions import loop_predictions
from discover.study import parse_study
from discover.study.data import load_study_data

pytestmark = pytest.mark.usefixtures("without_curves", "verdict_alone")
MODULUS, TIME, SOLVENT, NOISE = 100.0, 1.0, 1.0, 0.01
EFFECTS = ["giesekus_mobility", "ptt_linear", "stress_offset"]
CREEP_TIMES = np.geomspace(0.02, 10.0, 60)
BASE = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME)
IN_SOLVENT = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME, SOLVENT)
OF_SWEEPS = ["giesekus_mobility", "ptt_linear", "non_affine_motion", "stress_gain", "stress_offset"]
FREQUENCY, STRAINS = 2.0, np.geomspace(0.05, 10.0, 24)
MODES = (100.0, 20.0), (0.2, 3.0)
TWO_MODES = dc.Fluid(dc.make_law("ucm"), *MODES, 5.0)


@cache
def creep(stress, mobility):
    """Return the strain of a Giesekus fluid with solvent at `CREEP_TIMES`, by scipy."""
    law = Giesekus(mobility, MODULUS, TIME)
    return strain_at(law, [(0.0, stress)], SOLVENT, CREEP_TIMES)


def creep_folder(folder, mobility, draw=0):
    generator = np.random.default_rng(draw)
    folder.mkdir(exist_ok=True)
    lines = ["file,control"]
    for stress in (20.0, 40.0, 60.0):
        strain = white(creep(stress, mobility), NOISE, generator)
        columns = {"time_s": CREEP_TIMES, "stress_Pa": np.full(60, stress), "strain": strain}
        write_table(folder / f"creep_{stress:g}.csv", columns)
        lines.append(f"creep_{stress:g}.csv,stress")
    (folder / "runs.csv").write_text("\n".join(lines) + "\n")
    return dc.load_dataset(folder)


def curve_folder(folder, mobility):
    generator, rates = np.random.default_rng(0), np.geomspace(0.05, 20.0, 40)
    if mobility:
        steady = [Giesekus(mobility, MODULUS, TIME).steady_shear(rate)[:2] for rate in rates]
    else:
        steady = np.stack([MODULUS * TIME * rates, 2.0 * MODULUS * (TIME * rates) ** 2], axis=1)
    values = np.array(steady) * (1.0 + NOISE * generator.standard_normal((40, 2)))
    columns = {"shear_rate_1_s": rates, "stress_Pa": values[:, 0], "N1_Pa": values[:, 1]}
    write_table(folder / "flow_curve.csv", columns)
    return dc.load_dataset(folder).with_material_functions()


def sweep_of(folder, mobility):
    if mobility:
        exact = [giesekus_modulus(mobility, MODULUS, TIME, s, FREQUENCY) for s in STRAINS]
    else:
        x = FREQUENCY * TIME
        exact = [MODULUS * (x**2 + 1j * x) / (1.0 + x**2)] * len(STRAINS)
    noise = NOISE * np.random.default_rng(0).standard_normal((2, len(STRAINS)))
    columns = {"strain": STRAINS, "omega_rad_s": np.full(len(STRAINS), FREQUENCY)}
    columns |= {"Gp_Pa": np.real(exact) * (1.0 + noise[0])}
    columns |= {"Gpp_Pa": np.imag(exact) * (1.0 + noise[1])}
    write_table(folder / "amplitude_sweep.csv", columns)
    return dc.load_dataset(folder).with_material_functions()


def recorded(kind, rate, mobility, generator, noise=0.01, times=None):
    """Return a start-up of a two-mode Giesekus fluid with solvent, with white noise."""
    times = np.linspace(0.05, min(6.0, 3.5 / rate), 60) if times is None else times
    stress = GiesekusFluid(*MODES, mobility, 5.0).recorded(kind, lambda _: rate, times)
    protocol = start_up(rate) if kind == "shear" else in_flow(start_up(rate), kind)
    stress = white(stress, noise, generator)
    return dc.Run(f"{kind}_{rate}", times, protocol, np.full(60, rate), stress)


def extension(kind, mobility, noise=0.01):
    lot = np.random.default_rng(0)
    runs = (recorded(kind, rate, mobility, lot, noise) for rate in (0.15, 0.3, 0.6, 1.2))
    return dc.Dataset(f"{kind} extension", tuple(runs))


def curve_and_n1(folder, mobility):
    return curve_folder(folder, mobility).quantity_by_quantity()


def pulled(kind):
    return lambda folder, mobility: extension(kind, mobility)


def closed(data, base, effects=EFFECTS, **options):
    return dc.close_loop(data, base, effects=effects, explanations=1, **options)


def mobility_of(loop):
    assert [stage.effect for stage in loop.stages] == ["giesekus_mobility"]
    low, high = loop.stages[0].parameters["alpha"].ci95
    assert low <= 0.3 <= high
    return low


def test_a_mobility_is_found_in_creep_alone(tmp_path):
    named = []
    for draw in range(4):
        loop = closed(creep_folder(tmp_path / str(draw), 0.3, draw), IN_SOLVENT)
        mobility_of(loop)
        assert {record.quantity for record in loop.records} == {"strain"}
        # the noise alone is left
        assert loop.error_after.fit == pytest.approx(NOISE, rel=0.2)
        named.append(loop.verdict == "effects_added")
    # a third of the prior is with what has no name: one draw in ten is withheld
    assert sum(named) >= 3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("made", "base", "effects"),
    [
        (curve_and_n1, BASE, EFFECTS), (pulled("uniaxial"), TWO_MODES, None),
        (pulled("planar"), TWO_MODES, None),
    ],
    ids=["flow curve and N1", "uniaxial", "planar"],
)  # fmt: skip
def test_a_mobility_is_found_in_steady_states_and_in_extension(tmp_path, made, base, effects):
    loop = closed(made(tmp_path, 0.3), base, effects)
    assert loop.verdict == "effects_added"
    mobility_of(loop)
    # the noise alone is left
    assert loop.error_after.fit == pytest.approx(NOISE, rel=0.2)


@pytest.mark.parametrize(
    ("made", "base", "effects"),
    [
        (creep_folder, IN_SOLVENT, EFFECTS),
        pytest.param(curve_folder, BASE, EFFECTS, marks=pytest.mark.slow),
        pytest.param(sweep_of, BASE, OF_SWEEPS, marks=pytest.mark.slow),
        pytest.param(pulled("uniaxial"), TWO_MODES, None, marks=pytest.mark.slow),
    ],
    ids=["creep", "flow curve", "amplitude sweep", "extension"],
)
def test_nothing_is_found_where_the_declared_fluid_made_them(tmp_path, made, base, effects):
    loop = closed(made(tmp_path, 0.0), base, effects)
    assert (loop.verdict, loop.stages) == ("no_effect_needed", ())


@pytest.mark.slow
def test_n1_that_was_not_fitted_judges_a_law_found_in_the_stress_alone_over_the_rate(tmp_path):
    data = curve_folder(tmp_path, 0.3).quantity_by_quantity()
    loop = closed(data, BASE, held_out=["flow_curve.csv (N1)"])
    assert loop.verdict == "effects_added"
    mobility_of(loop)
    # N1 lies over three decades: its root mean square is that of the fastest rates, where one per
    # cent of noise and the mobility's own uncertainty are what is missed
    assert loop.error_after.held_out < 0.03
    assert loop.error_before.held_out > 1.0
    page = loop.to_html(tmp_path / "page.html").read_text(encoding="utf-8")
    assert "shear rate (1/s)" in page
    assert "time (s)" not in page


# the points are separate experiments: what is smooth in what is left of them is no noise
def test_a_flow_curve_that_no_law_has_is_not_explained_by_the_nearest(tmp_path):
    generator, rates = np.random.default_rng(1), np.geomspace(0.05, 10.0, 25)
    # thins as none of the candidates does   [Carreau 1972]
    stress = MODULUS * TIME * rates * (1.0 + (TIME * rates) ** 2) ** -0.3
    noisy = stress * (1.0 + NOISE * generator.standard_normal(25))
    write_table(tmp_path / "flow_curve.csv", {"shear_rate_1_s": rates, "stress_Pa": noisy})
    data = dc.load_dataset(tmp_path).with_material_functions()
    loop = closed(data, BASE, max_effects=1)
    assert loop.verdict == "unexplained"


@pytest.mark.slow
def test_a_mobility_is_found_in_an_amplitude_sweep_alone_and_holds_in_the_linear_limit(tmp_path):
    omega = np.geomspace(0.1, 10.0, 24)
    sweep_of(tmp_path, 0.3)
    write_table(tmp_path / "lve.csv", maxwell_sweep([MODULUS], [TIME], omega))
    keys = {"amplitude_sweep": "fit", "lve": "judge"}
    data = load_study_data(parse_study({"data": {"folder": str(tmp_path), **keys}}))
    loop = dc.close_loop(data.fit, BASE, held_out=data.held_out, effects=OF_SWEEPS)
    # a mobility of 0 is far outside, and the noise alone is left
    assert mobility_of(loop) > 0.2
    assert loop.error_after.fit == pytest.approx(NOISE, rel=0.3)
    assert {record.name: record.held_out for record in loop.records} == {
        "amplitude_sweep.csv (storage_modulus)": False,
        "amplitude_sweep.csv (loss_modulus)": False,
        "lve.csv (storage_modulus)": True,
        "lve.csv (loss_modulus)": True,
    }
    # the linear sweep is exact, and is predicted at a strain of 0.01; the gain of the transducer,
    # fitted along, is told to the noise over the root of 48 values, of which two deviations
    assert loop.error_after.held_out < 2.0 * NOISE / np.sqrt(48)
    table = loop_predictions(loop)
    assert set(table["quantity"]) == {"storage_modulus", "loss_modulus"}
    sweep = table[table["run"] == "lve.csv (loss_modulus)"]
    # amplitudes: their quotient is the frequency
    np.testing.assert_allclose(sweep["rate_1_s"][:24] / sweep["strain"][:24], omega, rtol=1e-6)
    page = loop.to_html(tmp_path / "page.html").read_text(encoding="utf-8")
    assert "strain amplitude" in page
    assert "frequency (rad/s)" in page
    assert "time (s)" not in page


@pytest.mark.slow
def test_the_sparse_learner_finds_the_law_in_extension_alone():
    data = extension("uniaxial", 0.3)
    law = dc.TensorSINDy(dc.build_library(), base=TWO_MODES).fit(data)
    (term,) = law.result_.terms
    assert term.term == "sigma.sigma"
    assert term.coefficient == pytest.approx(0.3, rel=0.02)
    # and predicts a flow that it did not see, in another geometry
    planar = extension("planar", 0.3, noise=0.0)
    assert law.score(planar) > 0.99


def test_effects_of_a_rotational_rheometer_leave_an_extension_as_it_is():
    effects = ["stress_gain", "wall_slip", "transducer_lag"]
    flawed = dc.close_loop(extension("uniaxial", 0.0), TWO_MODES, effects=effects)
    assert flawed.verdict == "no_effect_needed"
    lost = [candidate for ranking in flawed.rankings for candidate in ranking]
    assert all(candidate.score < 1e-3 for candidate in lost)


@pytest.mark.parametrize(
    ("effect", "verdict"), [("giesekus_mobility", "effects_added"), ("stress_gain", "unexplained")]
)
def test_a_band_in_a_flow_of_another_kind_holds_what_is_measured_there(effect, verdict):
    generator, runs = np.random.default_rng(0), []
    for kind, rate in [("shear", 0.3), ("shear", 0.6), ("shear", 1.2), ("uniaxial", 0.3)]:
        runs.append(recorded(kind, rate, 0.3, generator, times=np.linspace(0.05, 6.0, 60)))
    loop = dc.close_loop(
        dc.Dataset("both", tuple(runs)), TWO_MODES, held_out=["uniaxial_0.3"], effects=[effect]
    )
    assert loop.verdict == verdict
    assert all(record.band is not None for record in loop.records)
    # shear alone, unexplained: a gain that follows it says little of extension
    assert loop.held_in_band > 0.9


WHEN = np.linspace(0.05, 6.0, 120)
# an upper-convected Maxwell fluid in start-up   [Bird, Armstrong & Hassager 1987, vol. 1, ch. 7]
GROWN = 1.0 - np.exp(-WHEN)
NORMAL = 1.0 - np.exp(-WHEN) * (1.0 + WHEN)


def with_normal(name, rate, factor=1.0):
    lot = np.random.default_rng(int(100 * rate))
    both = MODULUS * rate * GROWN, factor * 2.0 * MODULUS * rate**2 * NORMAL
    noisy = [one + NOISE * np.std(one) * lot.standard_normal(len(one)) for one in both]
    return Run(name, WHEN, start_up(rate), np.full(len(WHEN), rate), *noisy)


def looped(*runs):
    declared = DeclaredModel.maxwell(MODULUS, TIME)
    return run_loop(
        Dataset("made", runs), declared, effects=["ptt_linear", "stress_gain"], max_effects=1
    )


def test_recorded_n1_that_no_fit_saw_has_an_error_of_its_own():
    result = looped(with_normal("slow", 0.3), with_normal("middle", 0.6), with_normal("fast", 1.2))
    assert [one.name for one in result.unfitted] == ["slow (N1)", "middle (N1)", "fast (N1)"]
    told = result.answer.expected("N1")
    # the law is right: of 1 % of noise at most half is left, and of a gain as much
    assert told.inside < 0.01
    # half as large, the record is missed by as much as it is
    wrong = looped(*(with_normal(name, rate, 0.5) for name, rate in (("slow", 0.3), ("fast", 1.2))))
    assert wrong.answer.expected("N1").inside == pytest.approx(1.0, rel=0.05)
    assert wrong.verdict == result.verdict  # no judgement of σ12 knows of it
    assert wrong.answer.next_test.startswith("Fit N1, corrected for axial compliance")


def test_a_law_is_used_and_exported_at_the_temperature_of_the_runs(tmp_path):
    # ten times as fast at 40 °C as at 0 °C, where the sweep is: by scipy, reduced to that
    shift, reduced, rates = 10.0, TIME * 10.0, {"a": 0.05, "b": 0.1, "c": 0.2, "d": 0.3}
    law, times = Giesekus(0.3, MODULUS, reduced), np.linspace(0.5, 80.0, 80)
    lot = np.random.default_rng(1)
    for name, rate in rates.items():
        stress = white(law.respond(flow_at(rate), times).sigma12, NOISE, lot)
        columns = {"time_s": times, "shear_rate_1_s": 0.0 * times + rate, "stress_Pa": stress}
        write_table(tmp_path / f"{name}.csv", columns)
    lines = [f"{name}.csv,40,{shift:g}" for name in rates]
    (tmp_path / "runs.csv").write_text("\n".join(["file,temperature_C,factor", *lines, ""]))
    sweep = maxwell_sweep([MODULUS], [reduced], np.geomspace(1e-3, 10.0, 30))
    write_table(tmp_path / "lve.csv", sweep)
    study = tmp_path / "study.toml"
    study.write_text(
        f'[data]\nfolder = "{tmp_path}"\nheld_out = ["d.csv"]\nclock_factor = "factor"\n'
        'temperature_C = 0\n[model]\nmodes = "lve"\n[loop]\neffects = ["giesekus_mobility"]\n'
    )
    invoke("close-loop", study, "--out", tmp_path / "out", "--quiet", code=0)
    use = json.loads((tmp_path / "out" / "loop.json").read_text())["use"]
    assert (use["law"], use["temperature_C"]) == ("giesekus", 40.0)
    assert use["modes"][0]["relaxation_time_s"] == pytest.approx(TIME, rel=0.01)  # of the sweep
    assert use["shift_factors"] == pytest.approx({"0": 10.0})
    assert use["range"]["rate_1_s"] == pytest.approx([0.5, 2.0])  # 1/s of the instrument
    copied = invoke("export", tmp_path / "out", "--format", "rheotool", code=0).output
    time = float(re.search(r"lambda \[0 0 1 0 0 0 0\] ([\d.]+);", copied)[1])
    assert time == pytest.approx(TIME, rel=0.01)


def test_samples_of_n1_that_no_fluid_can_have_are_not_compared():
    right = with_normal("right", 0.6)
    negative = replace(
        with_normal("wrong", 1.2),
        first_normal_stress_difference=-with_normal("", 1.2).first_normal_stress_difference,
    )
    assert [one.name for one in looped(right, negative).unfitted] == ["right (N1)"]


def test_a_part_of_a_run_without_a_sound_sample_of_n1_is_not_compared():
    whole = with_normal("late", 1.2)
    early = np.where(WHEN < 3.0, -1.0, 1.0) * whole.first_normal_stress_difference
    whole = replace(whole, first_normal_stress_difference=early)
    data = Dataset("made", (with_normal("right", 0.6), whole))
    assert unfitted_runs(data, [whole.window(WHEN < 1.0)]) == []
    (kept,) = unfitted_runs(data, [whole])  # control: of the whole with_normal the later part is
    assert 2.0 < kept.time[0] < 4.0
