"""Study files: what is accepted, what the one error says, and the modes that they declare."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest
from made_exports import csv, write_runs
from noisy_runs import THREE_DECADES, sweep

from discover.dataset import Dataset
from discover.errors import InputError, problems_in
from discover.laws import make_law
from discover.study import RunFolder, fingerprint, parse_study, read_study
from discover.study.data import load_study_data
from discover.study.declared_model import declared_model

SYNTHETIC = {"synthetic": {"law": "giesekus", "parameters": {"alpha": 0.2}, "samples": 20}}
TIMES = np.linspace(0.0, 2.0, 15)


def of_study(data):
    return load_study_data(parse_study({"data": data}))


def make_folder(path, **more):
    table = {"time_s": TIMES, "stress_Pa": 1 - np.exp(-TIMES)}
    return write_runs(
        path, *(table | {"shear_rate_1_s": rate + 0 * TIMES} for rate in (1, 2)), **more
    )


def test_the_contract_example_is_accepted(tmp_path):
    file = tmp_path / "s.toml"
    file.write_text(
        """
[data]
folder = "path"
fit = ["a.csv", "b.csv"]
held_out = ["c.csv"]
clock_factor = "time_factor"
[model]
law = "ucm"
modulus_Pa = 100.0
relaxation_time_s = 1.0
parameters = { }
known_relaxation = true
[loop]
max_effects = 3
strain = [0.02, 25]
[compare]
learners = ["tensor_sindy", "tbnn_ude"]
library = { degree = 1, closed_forms = ["exp"] }
test = "paper"
"""
    )
    study = read_study(file)
    assert study.loop.strain == (0.02, 25.0)
    assert study.name == "s"


MODES_THAT_CANNOT_BE = (
    ({"modulus_Pa": [1, 2], "relaxation_time_s": [1.0]}, "as many values"),
    ({"modulus_Pa": [1, 2]}, "as many values"),
    ({"modes": "lve", "modulus_Pa": [1], "relaxation_time_s": [1]}, "leave one of them out"),
    *(({"modes": wrong}, "modes") for wrong in (0, True, 1.5, 40, "lvee")),
    ({"elastic_modulus_Pa": "fit"}, "modes"),
    ({"solvent_viscosity_Pa_s": -1}, "solvent_viscosity_Pa_s"),
    ({"modulus_Pa": [], "relaxation_time_s": []}, "modulus_Pa"),
)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({}, ["'data' is missing"]),
        ({"data": {}}, ["folder", "synthetic"]),
        ({"data": SYNTHETIC, "dta": 1}, ["unknown key 'dta'", "data, model"]),
        ({"data": {**SYNTHETIC, "fitt": []}}, ["data.fitt", "held_out"]),
        ({"data": SYNTHETIC, "compare": {"library": {"degre": 1}}}, ["degre", "degree"]),
        ({"data": SYNTHETIC, "model": {"law": "gieskus"}}, ["model.law", "giesekus"]),
        ({"data": SYNTHETIC, "model": {"modulus_Pa": -1}}, ["modulus_Pa", "greater than 0", "-1"]),
        ({"data": SYNTHETIC, "model": {"modulus_Pa": "ft"}}, ["modulus_Pa", "'fit'", "'ft'"]),
        ({"data": {"folder": "a", "fit": "b"}}, ["data.fit", "list"]),
        ({"data": SYNTHETIC, "loop": {"strain": [3, 1]}}, ["strain", "low < high"]),
        ({"data": SYNTHETIC, "compare": {"learners": []}}, ["learner"]),
        ({"data": {"folder": "a", "fit": ["x"], "held_out": ["x"]}}, ["'x'", "both"]),
        ({"data": {"folder": "a", "held_out": "all"}}, ["data.held_out", "'each'", "'all'"]),
        ({"data": SYNTHETIC, "model": {"sweep_rad_s": [1, 2]}}, ["sweep_rad_s", "lve"]),
        ({"data": SYNTHETIC, "model": {"modes": "lve", "sweep_rad_s": [2, 1]}}, ["[low, high]"]),
        ({"data": {"synthetic": {"law": "ucm", "noise": float("nan")}}}, ["noise"]),
        ({"data": {"synthetic": {"law": "ucm", "noise": True}}}, ["should be a number; got true"]),
        ({"data": {"folder": "a", "fit": []}}, ["leave it out to fit all"]),
        ({"data": SYNTHETIC, "loop": {"effects": []}}, ["max_effects = 0"]),
        *(({"data": SYNTHETIC, "model": model}, [word]) for model, word in MODES_THAT_CANNOT_BE),
    ],
)
def test_a_wrong_study_is_one_error_that_names_the_key(content, words):
    with pytest.raises(InputError) as error:
        parse_study(content, "my.toml")
    message = str(error.value)
    assert message.startswith("my.toml: ")
    assert "\n" not in message.replace("\n- ", "")  # a line for each problem, and no other
    for word in words:
        assert word in message
    # a value of several kinds is refused once, and not once a kind
    assert "constrained" not in message
    assert message.count("model.modes") <= 1


def test_files_that_are_no_study_are_refused(tmp_path):
    for name, content in (("bad.toml", b"a = [1,"), ("bytes.toml", b"\xff\xfe\x00")):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError, match=name):
            read_study(tmp_path / name)
    for path in (tmp_path, tmp_path / "none.toml"):
        with pytest.raises(InputError, match=path.name):
            read_study(path)


def test_held_out_runs_are_not_to_fit_and_all_are_where_each_is_held_out_in_turn():
    data = of_study({**SYNTHETIC, "held_out": ["laos_1_1"]})
    assert data.held_out.names == ("laos_1_1",)
    assert "laos_1_1" not in data.fit.names
    assert len(data.fit) == 7
    with pytest.raises(InputError, match="nothing"):  # that is no run
        of_study({**SYNTHETIC, "held_out": ["nothing"]})
    data = of_study({**SYNTHETIC, "held_out": "each"})
    assert data.each
    assert (len(data.fit), len(data.held_out)) == (8, 0)
    with pytest.raises(InputError, match="at least 2 runs"):
        of_study({**SYNTHETIC, "held_out": "each", "fit": ["laos_1_1"]})


def test_a_folder_is_found_beside_the_study_and_in_the_fingerprint(tmp_path, monkeypatch):
    monkeypatch.delenv("DISCOVER_DATA", raising=False)
    make_folder(tmp_path / "runs")
    file = tmp_path / "s.toml"
    file.write_text('[data]\nfolder = "runs"\n')
    assert load_study_data(read_study(file)).fit.names == ("r0.csv", "r1.csv")
    first = fingerprint(read_study(file), 1)
    assert first == fingerprint(read_study(file), 1)
    assert first != fingerprint(read_study(file), 2)
    with (tmp_path / "runs" / "r0.csv").open("a") as stream:
        stream.write("\n3.0,0.99,1.0")
    assert first != fingerprint(read_study(file), 1)


def test_known_relaxation_false_leaves_an_elastic_law_and_modes_without_a_sweep_are_an_error():
    study = parse_study({"data": SYNTHETIC, "model": {"known_relaxation": False}})
    assert not declared_model(study, load_study_data(study).dataset).law.linear_relaxation
    study = parse_study({"data": SYNTHETIC, "model": {"modes": "lve"}})
    with pytest.raises(InputError, match=r"lve\.csv"):
        # computed data bring an exact sweep of their own
        declared_model(study, replace(load_study_data(study).dataset, linear_sweep=None))


def test_the_fingerprint_is_of_the_files_that_are_read_whatever_their_names_end_in(tmp_path):
    folder = tmp_path / "bench 3"
    folder.mkdir()
    (folder / "runs.csv").write_text("file\nmonday.dat\nTUESDAY.CSV\n")
    for name in ("monday.dat", "TUESDAY.CSV", "lve.csv"):
        (folder / name).write_text("a,b\n1,2\n")
    study = parse_study({"data": {"folder": str(folder)}})
    first = fingerprint(study)
    # results may be written beside the data, and a run of tomorrow may lie there already
    (folder / "predictions.csv").write_text("a\n1\n")
    (folder / "wednesday.csv").write_text("a\n1\n")
    assert fingerprint(study) == first
    for name in ("monday.dat", "TUESDAY.CSV", "lve.csv", "runs.csv"):
        kept = (folder / name).read_text()
        (folder / name).write_text(kept.rstrip("\n") + " \n")
        assert fingerprint(study) != first, name
        (folder / name).write_text(kept)
    assert fingerprint(study) == first


def test_a_run_folder_resumes_and_refuses_another_study_once_it_computed(tmp_path):
    folder = RunFolder(tmp_path / "out", "one")
    folder.save("part", {"x": [0.1, 1e-300]})
    again = RunFolder(tmp_path / "out", "one")
    assert again.load("part") == {"x": [0.1, 1e-300]}
    assert not again.complete
    again.finish()
    assert RunFolder(tmp_path / "out", "one").complete
    with pytest.raises(InputError, match="--overwrite"):
        RunFolder(tmp_path / "out", "two")
    fresh = RunFolder(tmp_path / "out", "two", overwrite=True)
    assert fresh.load("part") is None
    assert not fresh.complete
    RunFolder(tmp_path / "new", "with a mistake")
    RunFolder(tmp_path / "new", "mended").save("part", {})
    with pytest.raises(InputError, match="--overwrite"):
        RunFolder(tmp_path / "new", "yet another")


def test_overwrite_leaves_files_alone_that_are_not_ours_and_a_file_is_no_folder(tmp_path):
    (tmp_path / "thesis.txt").write_text("mine")
    RunFolder(tmp_path, "one").save("part", {})
    RunFolder(tmp_path, "one", overwrite=True)
    assert (tmp_path / "thesis.txt").read_text() == "mine"
    with pytest.raises(InputError, match="is a file"):
        RunFolder(tmp_path / "thesis.txt", "one")


def test_a_stress_that_is_not_observed_judges_and_a_run_without_another_cannot_be_fitted(tmp_path):
    table = {"time_s": TIMES + 0.1, "hencky_rate_1_s": 0.5 + 0 * TIMES, "tensile_stress_Pa": TIMES}
    index = "file,flow\nr0.csv,\nr1.csv,\npull.csv,uniaxial\n"
    folder = {"folder": str(make_folder(tmp_path, runs__csv=index, pull__csv=csv(table)))}
    assert of_study(folder).fit.names == ("r0.csv", "r1.csv", "pull.csv")
    shear = of_study({**folder, "observe": ["sigma12"]})
    assert shear.fit.names == ("r0.csv", "r1.csv")
    assert shear.held_out.names == ("pull.csv",)
    pulled = of_study({**folder, "observe": ["tensile_stress"], "held_out": ["r0.csv"]})
    assert pulled.held_out.names == ("r0.csv", "r1.csv")
    with pytest.raises(InputError, match=r"pull\.csv.*recorded nothing that is in observe"):
        of_study({**folder, "observe": ["sigma12"], "fit": ["pull.csv"]})


def test_all_problems_of_a_study_file_are_told_at_once_each_with_what_was_probably_meant():
    content = {
        "data": {"foldr": "a", "flow_curve": "judg"},
        "model": {"law": "giesekus", "parameters": {"alfa": 0.3}, "effects": {"wall_slp": "fit"}},
        "lop": {},
        "loop": {"strain": [3, 1], "max_efects": 2},
    }
    with pytest.raises(InputError) as error:
        parse_study(content, "my.toml")
    problems = problems_in(str(error.value))
    meant = ("folder", "judge", "alpha", "wall_slip", "loop", "max_effects")
    for name in meant:
        assert sum(f"Did you mean {name!r}?" in one for one in problems) == 1, name
    assert sum("strain must be" in one for one in problems) == 1
    assert len(problems) == 7
    assert str(error.value).startswith("my.toml: 7 problems.")
    # one problem is one sentence, and a name like no other gets no guess
    with pytest.raises(InputError) as error:
        parse_study({"data": SYNTHETIC, "zzz": 1}, "my.toml")
    assert str(error.value).startswith("my.toml: unknown key 'zzz'. Known keys there are: data")


@pytest.mark.parametrize(
    ("given", "meant"),
    [("Giesekus", "giesekus"), ("linear-PTT", "ptt_linear"), ("rolie poly", "rolie_poly")],
)
def test_laws_are_recognised_by_other_spellings(given, meant):
    with pytest.raises(InputError, match=f"Did you mean '{meant}'"):
        make_law(given)


MODULUS, TIME, SOLVENT = np.array([6000.0, 1200.0]), np.array([0.08, 1.5]), 25.0


def declared(*lines, elastic=0.0):
    content = tomllib.loads("\n".join(["[data]", 'folder = "x"', "[model]", *lines]))
    made = sweep(MODULUS, TIME, SOLVENT, elastic, noise=0.01, seed=5)
    return declared_model(parse_study(content), Dataset("x", (), made))


def test_undeclared_modes_are_the_sweeps_or_fitted_and_one_of_computed_data(tmp_path):
    of_sweep = declared("")
    np.testing.assert_allclose(of_sweep.modulus, MODULUS, rtol=0.05)
    assert of_sweep.free == ()
    folder = parse_study({"data": {"folder": str(make_folder(tmp_path))}})
    alone = declared_model(folder, load_study_data(folder).dataset)
    assert alone.free == ("modulus_Pa", "relaxation_time_s")
    half = parse_study({"data": {"folder": folder.data.folder}, "model": {"modulus_Pa": 3.0}})
    one = declared_model(half, load_study_data(half).dataset)
    assert (one.modulus.tolist(), one.free) == ([3.0], ("relaxation_time_s",))
    computed = parse_study({"data": SYNTHETIC})
    exact = declared_model(computed, load_study_data(computed).dataset)
    assert (exact.modulus.tolist(), exact.relaxation_time.tolist(), exact.free) == ([1], [1], ())


def test_modes_may_be_listed_or_counted_and_a_solvent_is_the_sweeps_or_counts_once():
    model = declared("modulus_Pa = [1200, 6000]", "relaxation_time_s = [1.5, 0.08]")
    np.testing.assert_allclose(model.modulus, [1200.0, 6000.0])
    assert model.solvent_viscosity == 0.0
    assert len(declared("modes = 3").modulus) == 3
    free = declared("modulus_Pa = 3.0", 'solvent_viscosity_Pa_s = "fit"')
    assert [one.name for one in free.effects if one.free] == ["solvent_viscosity"]
    model = declared('modes = "lve"')
    assert model.solvent_viscosity == pytest.approx(SOLVENT, rel=0.05)
    np.testing.assert_allclose(model.modulus, MODULUS, rtol=0.05)
    np.testing.assert_allclose(model.relaxation_time, TIME, rtol=0.05)
    errors = np.sqrt(np.diag(model.modulus_covariance))
    assert len(errors) == 3
    assert 0.001 < errors[-1] / SOLVENT < 0.02
    model = declared('modes = "lve"', "solvent_viscosity_Pa_s = 25.0")
    assert model.solvent_viscosity == 25.0
    assert len(model.modulus) == 2
    assert declared('modes = "lve"', "solvent_viscosity_Pa_s = 0.0").solvent_viscosity == 0.0


def test_a_solid_is_a_mode_that_does_not_relax_and_is_named():
    with pytest.warns(UserWarning, match="is a solid"):
        of_sweep = declared('modes = "lve"', elastic=5000.0)
    assert of_sweep.modulus[-1] == pytest.approx(5000.0, rel=0.05)
    assert of_sweep.relaxation_time[-1] > 100.0 / THREE_DECADES[0]
    with pytest.warns(UserWarning, match="is a solid"):
        by_hand = declared("elastic_modulus_Pa = 40.0")
    assert by_hand.relaxation_time[-1] >= 1000.0
    assert "solid" in by_hand.modes_in_words
