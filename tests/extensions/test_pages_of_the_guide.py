"""A law, an effect, a term, a learner and an importer, each one file, as their pages describe them.

Files of a user's own lie outside the package and are installed as `pip` does it.
"""

import json
import shlex

import numpy as np
import pytest
from command_line import invoke
from user_packages import LEARNER_CODE, Workplace, blocks, install, project

from discover.dataset import load_dataset
from discover.laws.registry import _named_laws

LAW, EFFECT, TERM = "adding-a-law.md", "adding-an-effect.md", "adding-a-term.md"
LEARNER, LOADER = "adding-a-learner.md", "adding-a-loader.md"
# runs of synthetic data, changed by a line, in a folder of CSV files
SAMPLES = """
import jax.numpy as jnp, numpy as np, pathlib, discover as dc
from discover.equations import Equation
from discover.simulate import simulate
from tensor_library import LawTerm
folder = pathlib.Path("data"); folder.mkdir()
names, noise = [], np.random.default_rng(3)
for number, run in enumerate({runs}):
    table = run.to_dataframe()[["time_s", "shear_rate_1_s", "stress_Pa"]]
    {change}
    table.to_csv(folder / f"run{{number}}.csv", index=False)
    names.append(f"run{{number}}.csv")
(folder / "runs.csv").write_text("\\n".join(["file", *names]) + "\\n")
"""
SATURATED = {
    "runs": 'list(dc.synthetic_dataset("ucm", {}, noise=0.005, seed=1))[:4]',
    "change": 'table["stress_Pa"] /= 1.0 + 0.2 * table["stress_Pa"].abs()',
}
OF_TANH = {
    "runs": 'list(dc.synthetic_dataset("ucm", {}, n_samples=51))[::4]',
    "change": """
    law = LawTerm("(tanh(mu*tr(sigma)))*sigma", 0.8, {"mu": 0.7})
    stress = simulate(Equation((law,)).fluid(), run.protocol, run.time).shear_stress
    size = 0.002 * np.sqrt(np.mean(stress**2))
    table["stress_Pa"] = stress + size * noise.standard_normal(stress.size)
""",
}


@pytest.fixture
def workplace(tmp_path):
    return Workplace(tmp_path)


@pytest.mark.slow
def test_the_law_of_the_page_is_listed_fitted_reported_and_exported(workplace):
    workplace.follow(LAW)
    listed = json.loads(workplace.run("laws", "--json").stdout)
    (mine,) = [law for law in listed if law["name"] == "quadratic_ptt"]
    assert (mine["title"], mine["parameter"], mine["high"]) == ("quadratic PTT", "k", 10.0)
    study = workplace.study(LAW, more='[loop]\neffects = ["giesekus_mobility"]\n')
    workplace.run("close-loop", study, "--out", "out", "--quiet")
    loop = workplace.json("out/loop.json")
    assert loop["verdict"] == "no_effect_needed"
    low, high = loop["declared_parameters"]["k"]["ci95"]
    assert low < 0.3 < high
    assert high - low < 0.1
    assert "quadratic PTT" in workplace.text("out/report.html")
    latex = workplace.run("export", "out", "--format", "latex").stdout
    assert r"\left(\operatorname{tr}\left(\boldsymbol{\sigma}\right)\right)^{2}" in latex
    code = workplace.run("export", "out", "--format", "python").stdout
    assert "s.trace() ** 2 * s" in code


def test_the_law_of_the_page_is_right_in_steady_shear_and_its_effect_is_in_the_table(workplace):
    workplace.follow(LAW)
    workplace.follow(EFFECT)
    script = """
import discover as dc, numpy as np, quadratic_ptt
law, rate = dc.make_law("quadratic_ptt", {"k": 0.3}), 2.0
factor = 1.0
for _ in range(200):
    shear = rate / factor
    factor = 0.5 * (factor + 1.0 + 0.3 * (2 * rate * shear / factor) ** 2)
stress = np.array([2 * rate * shear / factor, 0.0, 0.0, shear])
print(np.abs(law.stress_rate(stress, np.asarray(rate))).max())
print([*dc.effects().index])
"""
    off, effects = workplace.run(script=script).stdout.splitlines()
    assert float(off) < 1e-9
    assert "'transducer_saturation'" in effects


@pytest.mark.slow
def test_the_effect_of_the_page_is_listed_considered_found_and_reported(workplace):
    workplace.follow(EFFECT)
    listed = json.loads(workplace.run("effects", "--json").stdout)
    (mine,) = [effect for effect in listed if effect["name"] == "transducer_saturation"]
    assert mine["kind"] == "signal"
    # the study as it stands
    study = workplace.study(EFFECT)
    workplace.run("close-loop", study, "--out", "plain", "--quiet")
    loop = workplace.json("plain/loop.json")
    assert loop["stages"][0]["effect"] == "giesekus_mobility"
    considered = {c["effect"] for stage in loop["ranking"] for c in stage}
    assert "transducer_saturation" in considered
    # and of data that have it
    workplace.run(script=SAMPLES.format(**SATURATED))
    workplace.with_data(study, "[model]")
    workplace.run("close-loop", study, "--out", "out", "--quiet")
    loop = workplace.json("out/loop.json")
    assert [stage["effect"] for stage in loop["stages"]] == ["transducer_saturation"]
    np.testing.assert_allclose(loop["stages"][0]["parameters"]["s"]["value"], 0.2, rtol=0.1)
    report = workplace.text("out/report.html")
    assert "transducer_saturation" in report
    assert "Hang several known weights" in report


@pytest.mark.slow
def test_the_form_of_the_page_is_found_in_data_reported_and_exported(workplace):
    workplace.follow(TERM)
    workplace.run(script=SAMPLES.format(**OF_TANH))
    study = workplace.study(TERM, more="max_terms = 1\n")
    workplace.with_data(study, "[compare]", '"exp", "tanh"', '"tanh"')
    workplace.run("compare", study, "--out", "out", "--quiet")
    (term,) = workplace.json("out/comparison.json")["learners"]["tensor_sindy"]["terms"]
    assert term["term"] == "(tanh(mu*tr(sigma)))*sigma"
    np.testing.assert_allclose(term["coefficient"], 0.8, rtol=0.2)
    np.testing.assert_allclose(term["inner"]["mu"], 0.7, rtol=0.3)
    report = workplace.text("out/report.html")
    assert "tanh" in report
    assert "<mi>traceofstress</mi>" not in report
    assert r"\tanh" in workplace.text("out/equations.tex")
    sparse = "export", "out", "--law", "tensor_sindy", "--format"  # the answer is another law
    assert "np.tanh(" in workplace.run(*sparse, "python").stdout
    done = workplace.run(*sparse, "rheotool", code=2)
    assert "rheoTool cannot take this law" in done.stderr


@pytest.mark.slow
def test_the_learner_of_the_page_is_trained_judged_reported_and_exported(workplace):
    workplace.follow(LEARNER)
    study = workplace.study(LEARNER, more="high_deborah = [1.5]\n")
    workplace.run("compare", study, "--out", "out", "--quiet")
    found = workplace.json("out/comparison.json")
    assert set(found["learners"]) == {"tensor_sindy", "one_term"}
    mine = found["learners"]["one_term"]
    (term,) = mine["terms"]
    assert term["term"] == "sigma.sigma"
    np.testing.assert_allclose(term["coefficient"], 0.2, atol=0.02)
    assert mine["train_seconds"] > 0
    assert found["lack_of_fit"]["one_term"]["misfit"] < 0.05
    errors = [e["sigma12"] for e in mine["errors"].values() if e["sigma12"] is not None]
    assert max(errors) < 0.05
    report = workplace.text("out/report.html")
    assert "one term" in report
    assert "the best of 8 terms" in report.lower()
    assert "one_term" in workplace.text("out/predictions.csv")
    latex = workplace.run("export", "out", "--law", "one_term", "--format", "latex").stdout
    assert "Law found by one term" in latex


@pytest.mark.slow
def test_a_learner_may_be_asked_alone_and_one_without_a_result_is_named(workplace):
    study = workplace.study(LEARNER, more="high_deborah = [1.5]\n")
    path = workplace.folder / study
    path.write_text(path.read_text("utf-8").replace('["tensor_sindy", "one_term"]', '["mine"]'))
    install(workplace.packages, "mine", LEARNER_CODE, project("learners", mine="mine"))
    workplace.run("compare", study, "--out", "out", "--quiet")
    assert list(workplace.json("out/comparison.json")["learners"]) == ["mine"]
    assert "mine" in workplace.text("out/report.html")
    nothing = "import discover as dc\ndc.register_learner('mine', lambda task: None)\n"
    (workplace.packages / "mine.py").write_text(nothing)
    done = workplace.run("compare", study, "--out", "none", "--quiet", code=2)
    assert "The learner 'mine' must return a LearnerResult; got a NoneType" in done.stderr


def archives(folder):
    time = np.linspace(0.0, 2.0, 30)
    for number in (1, 2):
        torque, rate = number * (1.0 - np.exp(-time)), np.full(30, float(number))
        np.savez(folder / f"run{number}.npz", milliseconds=1e3 * time, rate=rate, torque=torque)
    return time


def commands():
    return [shlex.split(line)[1:] for line in blocks(LOADER, "sh")[0].splitlines()]


@pytest.mark.slow
def test_the_importer_of_the_page_makes_a_folder_that_loads_and_can_be_made_again(workplace):
    workplace.follow(LOADER)
    time = archives(workplace.folder)
    for command in commands():
        workplace.run(*command)
    data = load_dataset(str(workplace.folder / "melt"))
    assert [run.name for run in data] == ["run1.csv", "run2.csv"]
    np.testing.assert_allclose(data[1].time, time)
    np.testing.assert_allclose(data[1].rate, 2.0)
    # cone and plate: stress = 3 M / (2 pi R^3)
    stress = 3 * 2e-6 * (1.0 - np.exp(-time)) / (2 * np.pi * 0.0125**3)
    np.testing.assert_allclose(data[1].stress, stress)
    # the format is kept with the import
    (workplace.folder / "run1.npz").rename(workplace.folder / "run1.raw")
    first = ["data", "import", "run1.raw", "--format", "house_rheometer"]
    first += ["--geometry", "cone_plate:radius_mm=12.5,angle_deg=1", "--out", "raw"]
    workplace.run(*first)
    workplace.run("data", "import", "--mapping", "raw/import.toml", "--out", "again")
    assert workplace.text("raw/run1.csv") == workplace.text("again/run1.csv")


@pytest.mark.slow
def test_a_file_that_the_importer_cannot_read_is_refused(workplace):
    workplace.follow(LOADER)
    (workplace.folder / "run1.npz").write_bytes(b"nothing of the kind")
    np.savez(workplace.folder / "run2.npz", milliseconds=np.zeros(3))
    for name, why in (("run1", "ValueError"), ("run2", "KeyError")):
        done = workplace.run("data", "import", f"{name}.npz", "--out", "melt", code=2)
        assert f"The importer 'house_rheometer' cannot read {name}.npz ({why}" in done.stderr
    assert not (workplace.folder / "melt").exists()


@pytest.mark.parametrize(
    ("page", "said"),
    [
        (LAW, "unknown law 'quadratic_ptt'"),
        (EFFECT, "Unknown effect 'transducer_saturation'"),
        (TERM, "unknown closed form 'tanh'. Write one of: exp, saturating"),
        (LEARNER, "unknown learner 'one_term'. Write one of: tensor_sindy, tbnn_ude"),
    ],
)
def test_without_the_package_the_study_of_the_page_is_refused(workplace, page, said):
    # negative control of the tests above, in this process, where nothing is installed
    study, out = workplace.folder / workplace.study(page), workplace.folder / "out"
    command = "close-loop" if page in (LAW, EFFECT) else "compare"
    assert said in invoke(command, study, "--out", out, code=2).stderr


@pytest.mark.slow
def test_without_the_package_the_commands_of_the_page_are_refused(workplace):
    archives(workplace.folder)
    workplace.run(*commands()[0], code=2)
    done = workplace.run(*commands()[0], "--format", "house_rheometer", code=2)
    said = "Unknown format 'house_rheometer'. Write one of: text, spreadsheet, reptate."
    assert said in done.stderr


BUILT_IN = len(_named_laws())
LOUD = 'import sys\nprint("imported", file=sys.stderr)\n'
OWN_LAW = """
import discover as dc
from discover.laws import Giesekus
dc.register_law({name!r}, Giesekus, {{"alpha": (0.0, 1.0)}})
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("code", "entry", "why"),
    [
        ("import nowhere_to_be_found", {"mine": "mine"}, "ModuleNotFoundError: No module named"),
        ("1 / 0", {"mine": "mine"}, "ZeroDivisionError: division by zero"),
        ("def f(:", {"mine": "mine"}, "SyntaxError"),
        ("", {"mine": "elsewhere"}, "ModuleNotFoundError: No module named 'elsewhere'"),
        ("", {"mine": "mine:law"}, "AttributeError"),
        ("", {"mine": "mine"}, "mine registers no law of that name"),
        (OWN_LAW.format(name="giesekus"), {"giesekus": "mine"}, "the name is taken"),
        (OWN_LAW.format(name="giesekus"), {"mine": "mine"}, "'giesekus' is known already"),
        (OWN_LAW.format(name="Mine"), {"mine": "mine"}, "must be lower-case"),
        ("import sys; sys.exit(3)", {"mine": "mine"}, "SystemExit: 3"),
    ],
)
def test_a_broken_package_is_one_warning_and_all_else_works(workplace, code, entry, why):
    install(workplace.packages, "mine", code, project("laws", **entry))
    done = workplace.run("laws")
    assert "giesekus " in done.stdout
    assert len(done.stdout.splitlines()) == BUILT_IN
    (said,) = done.stderr.splitlines()
    assert said.startswith(f"discover: warning: The law {next(iter(entry))!r} of mine 2.5 is left")
    assert why in said


def test_a_sound_package_is_loaded_once_where_laws_are_asked_for_without_a_warning(workplace):
    # negative control of the tests above; two laws of one module are one import
    code = LOUD + OWN_LAW.format(name="one") + OWN_LAW.format(name="two")
    install(workplace.packages, "mine", code, project("laws", one="mine", two="mine"))
    done = workplace.run("laws")
    assert done.stderr == "imported\n"
    assert len(done.stdout.splitlines()) == BUILT_IN + 2
    # nor is it loaded where no law is asked for
    assert workplace.run("--help").stderr == ""
    assert workplace.run("effects").stderr == ""


def test_of_two_packages_with_one_name_one_is_left_out_and_none_known_twice(workplace):
    for name in ("one", "two"):
        code = OWN_LAW.format(name="ours")
        install(workplace.packages, name, code, project("laws", name, ours=name))
    install(workplace.packages, "mine", OWN_LAW.format(name="mine"), project("laws", mine="mine"))
    script = "import mine, discover as dc; print(*dc.laws().loc[['mine', 'ours'], 'parameter'])"
    done = workplace.run(script=script)
    assert done.stdout == "alpha alpha\n"
    assert done.stderr.count("Warning: ") == 1
    assert "'ours' is known already" in done.stderr
