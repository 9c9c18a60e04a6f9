"""Values of a study are of the kind that they are written as; nothing is turned into another."""

import time
import tomllib

import numpy as np
import pytest

from discover.dataset.tables.table import read_toml
from discover.errors import InputError
from discover.simulate import synthetic_dataset
from discover.study import parse_study, read_study


def study(section, **values):
    content = {"data": {"folder": "melt"}}
    content[section] = {**content.get(section, {}), **values}
    return parse_study(content)


@pytest.mark.parametrize(
    ("section", "values"),
    [
        ("model", {"modulus_Pa": True}),
        ("model", {"modulus_Pa": "3"}),
        ("model", {"parameters": {"alpha": True}}),
        ("loop", {"max_effects": True}),
        ("loop", {"max_effects": 2.0}),
        ("loop", {"noise": True}),
        ("loop", {"strain": [False, 1]}),
        ("compare", {"quick": 1}),
        ("compare", {"quick": "yes"}),
        ("compare", {"seed": "7"}),
    ],
)
def test_a_value_of_another_kind_is_refused_with_its_name(section, values):
    (name,) = values
    with pytest.raises(InputError, match=rf"{section}\.{name}.*should be.*; got"):
        study(section, **values)


def test_noise_of_synthetic_data_is_no_truth_value():
    with pytest.raises(InputError, match="noise: should be a number; got true"):
        parse_study({"data": {"synthetic": {"law": "giesekus", "noise": True}}})


@pytest.mark.usefixtures("as_users_run_it")
def test_python_refuses_truth_values_and_text_for_numbers_as_studies_do():
    for case, got in (
        ({"noise": True}, "True"),
        ({"noise": "0.1"}, "'0.1'"),
        ({"duration": True}, "True"),
        ({"seed": True}, "True"),
        ({"n_samples": None}, "None"),
        ({"parameters": {"alpha": True}}, "True"),
    ):
        with pytest.raises(InputError, match=rf"^[^;]* must be [^;]*; got {got}\."):
            synthetic_dataset("giesekus", **{"parameters": {"alpha": 0.3}, **case})
    made = synthetic_dataset(
        "giesekus", {"alpha": 1}, noise=np.float64(0.01), n_samples=np.int64(20), duration=2
    )
    assert (made.noise, len(made.runs[0])) == (0.01, 20)


def test_whole_numbers_are_numbers_and_truth_values_are_truth_values():
    model = study("model", law="giesekus", modulus_Pa=3, parameters={"alpha": 0}).model
    assert (model.modulus_Pa, model.parameters["alpha"]) == (3.0, 0.0)
    assert study("compare", quick=True).compare.quick is True
    assert study("loop", strain=[0, 25]).loop.strain == (0.0, 25.0)


@pytest.mark.parametrize(
    ("section", "key", "remedy"),
    [("data", "fit", "leave it out to fit all"), ("loop", "effects", "max_effects = 0")],
)
def test_an_empty_list_is_not_all_of_them(section, key, remedy):
    with pytest.raises(InputError, match=remedy):
        study(section, **{key: []})


def test_no_run_held_out_may_be_written():
    assert study("data", held_out=[]).data.held_out == ()


@pytest.mark.parametrize("line", ["{} = 1", "[{}]", "x = {{ {} = 1 }}", '[data]\n"a".{} = 1'])
def test_a_key_of_thousands_of_parts_is_refused_before_it_is_parsed(tmp_path, line):
    path = tmp_path / "deep.toml"
    path.write_text(line.format(".".join(["a"] * 20_000)))
    with pytest.raises(InputError, match="more than 16 parts"):
        read_study(path)


def seconds_to_refuse(text, reason, folder):
    path = folder / "study.toml"
    path.write_text(text)
    begun = time.process_time()
    with pytest.raises(InputError, match=reason):
        read_study(path)
    return time.process_time() - begun


@pytest.mark.parametrize(
    "text",
    [".".join(["a"] * 300_000) + " \n", ".".join(['"a\\""'] * 120_000) + " = 1\n",
     "[" + ".".join(["a"] * 300_000) + "]", "[[" + " . ".join(["a"] * 150_000),
     "x = {" + ".".join(["'#'"] * 200_000) + " = 1}", "x.\"'\"." + ".".join(["a"] * 300_000)],
    ids=["no value", "escapes", "header", "open header", "literals", "quotes"],
)  # fmt: skip
def test_whatever_follows_a_deep_key_it_is_refused_within_a_second(tmp_path, text):
    assert seconds_to_refuse(text, "more than 16 parts on line 1", tmp_path) < 1.0


@pytest.mark.parametrize("text", ['"' + '\\"' * 400_000, '"""' + '\\"' * 400_000, "." * 900_000])
def test_strings_that_never_end_are_read_once(tmp_path, text):
    assert seconds_to_refuse(text, "not valid TOML", tmp_path) < 2.0


def test_dots_in_values_are_no_parts_of_a_key(tmp_path):
    path = tmp_path / "good.toml"
    name = ".".join(["run"] * 50) + ".csv"
    path.write_text(f'[data]\nfolder = "."\nfit = ["{name}"]\n')
    assert read_study(path).data.fit == (name,)


DOTS = "a." * 40


@pytest.mark.parametrize(
    "text",
    [f'x = "{DOTS}\\"{DOTS}"', f"x = '{DOTS}\\'", f'x = """{DOTS}\n"" {DOTS}\\""" {DOTS}"""""',
     f"x = '''{DOTS}\n'' {DOTS}'''", f"# {DOTS}\nx = 1 # \"{DOTS}", f"x = {[1.5] * 2000}",
     ".".join(["a"] * 16) + " = 1", f'"{DOTS}" = 1'],
    ids=["basic", "literal", "lines", "literal lines", "comment", "floats", "16 parts", "one part"],
)  # fmt: skip
def test_dots_that_divide_no_key_are_let_through(tmp_path, text):
    path = tmp_path / "good.toml"
    path.write_text(text)
    assert read_toml(path, "study file", "")[0] == tomllib.loads(text)
