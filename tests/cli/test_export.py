"""``discover export``: from a folder of results to a law that other programs take."""

import importlib.util
import json
import re
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from command_line import invoke

from discover.effects import make_effect
from discover.equations import AugmentedLaw, Box, Equation, StatePart, equation_to_json
from discover.equations import Tested as Where
from discover.equations.files import read_result_laws
from discover.laws import Fluid, make_law
from discover.loop import ErrorPair, LoopResult, RunRecord, Stage, StageParameter
from discover.loop.parts import ConstantByMode, DeclaredEffect, ModeConstant, NearestLaw
from tensor_library import LawTerm


def module_at(path):
    spec = importlib.util.spec_from_file_location("law", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def results(tmp_path):
    """The part of comparison.json that an export reads; a whole one is read in test_commands.py."""
    tested = Where(Box((1.0, 2.0), (0.25, 1.0)), Box((2.0, 3.0), (0.1, 1.5)), {"sigma12": 0.01})
    laws = {
        name: Equation((LawTerm("sigma.sigma", value),), tested=tested)
        for name, value in (("tensor_sindy", 0.2), ("tbnn_ude", 0.25))
    }
    content = {name: {"law": equation_to_json(law)} for name, law in laws.items()}
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "comparison.json").write_text(json.dumps({"learners": content}))
    return tmp_path / "out"


def test_a_comparison_becomes_a_function_with_its_tests_and_replaces_no_result(results, tmp_path):
    invoke("export", results, "--out", tmp_path / "law.py", code=0)
    module = module_at(tmp_path / "law.py")
    assert module.TESTED["judged_in"] == {"Wi": [2.0, 3.0], "De": [0.1, 1.5]}
    stress, _, _ = module.simulate_shear(lambda t: 0.01, np.array([0.0, 20.0]))
    assert stress[-1] == pytest.approx(0.01, rel=1e-3)  # slow flow: the viscosity Gλ = 1
    again = invoke("export", results, "--out", tmp_path / "law.py", code=2)
    assert "--overwrite" in again.stderr
    before = (results / "comparison.json").read_bytes()
    itself = results / "comparison.json"
    done = invoke("export", results, "--out", itself, "--overwrite", code=2)
    assert "not written over" in done.stderr
    assert itself.read_bytes() == before
    invoke("export", results, "--out", results / "law.py", "--overwrite", code=0)


def test_every_form_and_either_learner_can_be_asked_for(results):
    for form in ("python", "sympy", "latex", "json", "rheotool", "ufl"):
        assert "0.2" in invoke("export", results, "--format", form, code=0).stdout
    network = invoke("export", results, "--format", "json", "--law", "tbnn_ude")
    content = json.loads(network.stdout)
    assert content["terms"][0]["coefficient"] == 0.25
    held = json.loads((results / "comparison.json").read_text())
    assert held["learners"]["tbnn_ude"]["law"] == content


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["--format", "fortran"], "python, sympy, latex, json, rheotool"),
        (["--law", "nobody"], "tensor_sindy or tbnn_ude"),
        (["--density", "900"], "rheotool"),
        (["--out", "."], "no plain file"),
    ],
)
def test_a_wrong_request_is_one_line_and_exit_code_2(results, arguments, word):
    done = invoke("export", results, *arguments, code=2)
    assert done.stderr.strip().count("\n") == 0
    assert word in done.stderr


@pytest.mark.parametrize(
    ("name", "text", "word"),
    [
        ("comparison.json", "{", "not valid JSON"),
        ("comparison.json", "[" * 100_000, "comparison.json"),
        ("comparison.json", "{}", "--overwrite"),
        ("comparison.json", '{"learners": {"tensor_sindy": {"law": {}}}}', "format"),
        ("loop.json", '{"law": null, "law_missing": "thixotropy has a state"}', "thixotropy"),
        ("fit.json", '{"law": "a law of mine", "answer_law": null}', "a law of mine has no"),
        ("batch.json", "{}", "one study"),
        ("nothing.txt", "", "none of comparison.json, loop.json and fit.json"),
    ],
)
def test_results_that_hold_no_law_say_so(tmp_path, name, text, word):
    (tmp_path / name).write_text(text)
    done = invoke("export", tmp_path, code=2)
    assert word in done.stderr
    assert "Traceback" not in done.output


def loop_result(*added, base=("giesekus", {"alpha": 0.1}), **more):
    effects = tuple(make_effect(name) for name, *_ in added)
    stages = tuple(
        Stage(
            effect.name, effect.kind,
            {effect.parameters[0].name: StageParameter(values[0], (0.0, 1.0), "")}, (),
            ErrorPair(0.1, 0.1), 10.0, effect.equation, effect.source, effect.check,
        )
        for effect, (_, *values) in zip(effects, added, strict=True)
    )  # fmt: skip
    inside = [
        (e, jnp.asarray(v)) for e, (_, *v) in zip(effects, added, strict=True)
        if e.kind == "constitutive"
    ]  # fmt: skip
    law = AugmentedLaw(make_law(*base), tuple(v for _, v in inside), tuple(e for e, _ in inside))
    t = np.linspace(0.0, 10.0, 5)
    records = tuple(
        RunRecord(f"{held}", held, t, t, t, np.full(5, rate), t, np.stack([t]), np.zeros(1))
        for held, rate in ((False, 1.0), (False, 0.5), (True, 4.0))
    )
    return LoopResult(
        "effects_added", ErrorPair(0.4, 0.4), ErrorPair(0.01, 0.02), 0.005, stages, {},
        records=records, fluid=Fluid(law, [10.0, 20.0], [0.5, 2.0], 1.0), **more,
    )  # fmt: skip


def write_loop(result, folder):
    (folder / "loop.json").write_text(json.dumps(result.to_json()), encoding="utf-8")


def test_a_loop_leaves_as_its_fluid_without_the_instrument(tmp_path):
    result = loop_result(("ptt_linear", 0.3), ("giesekus_mobility", 0.05), ("rate_gain", 0.1))
    write_loop(result, tmp_path)
    assert str(result.sympy()) == "0.3*Trace(sigma)*sigma + 0.15*sigma**2"
    assert result.latex() == result.equation().latex()
    content = json.loads(invoke("export", tmp_path, "--format", "json", code=0).stdout)
    found = {t["term"]: t["coefficient"] for t in content["terms"]}
    assert found == pytest.approx({"sigma.sigma": 0.15, "tr(sigma)*sigma": 0.3})
    assert [m["modulus_Pa"] for m in content["modes"]] == [10.0, 20.0]
    assert "rate_gain" in " ".join(content["notes"])
    time = (10 * 0.5**2 + 20 * 2.0**2) / (10 * 0.5 + 20 * 2.0)
    judged = {"Wi": [4 * time] * 2, "De": [time / 10] * 2}
    assert content["tested"]["judged_in"] == {k: pytest.approx(v) for k, v in judged.items()}


XPP = {"q": 4.0, "stretch_time_ratio": 0.25, "alpha": 0.1}


def by_mode(values):
    times = (0.5, 2.0)
    modes = tuple(ModeConstant(*one, None, True) for one in zip(times, values, strict=True))
    return ConstantByMode(values[0], (0.0, 1.0), "", 1.0, 1, (0.0, 5.0), modes)


def test_a_constant_that_differs_by_mode_is_written_for_each(tmp_path):
    """Of a law that is no sum of terms, and of one that is."""
    for base in (("xpp", XPP), ("giesekus", {"alpha": 0.1})):
        differing = {"alpha": by_mode((0.1, 0.3))}
        write_loop(loop_result(base=base, declared_parameters=differing), tmp_path)
        done = invoke("export", tmp_path, "--format", "rheotool", code=0)
        values = re.findall(r"alpha \[0 0 0 0 0 0 0\] (\S+);", done.stdout)
        assert [float(v) for v in values] == [0.1, 0.3]
        content = json.loads(invoke("export", tmp_path, "--format", "json").stdout)
        assert [one["alpha"] for one in content["named"]["constants"]] == [0.1, 0.3]


@pytest.mark.parametrize(
    ("effect", "entry", "law"),
    [
        ("giesekus_mobility", "alpha", "giesekus"),
        pytest.param("ptt_exponential", "epsilon", "ptt_exponential", marks=pytest.mark.slow),
        pytest.param("non_affine_motion", "zeta", "johnson_segalman", marks=pytest.mark.slow),
    ],
)
def test_an_effect_by_mode_is_the_law_that_it_makes_in_rheotool(tmp_path, effect, entry, law):
    found = DeclaredEffect(effect, "constitutive", {"amplitude": by_mode((0.1, 0.3))})
    result = loop_result((effect, 0.1), base=("ucm", {}), declared_effects=(found,))
    write_loop(result, tmp_path)
    text = invoke("export", tmp_path, "--format", "rheotool").stdout
    values = re.findall(rf"{entry} \[0 0 0 0 0 0 0\] (\S+);", text)
    assert [float(v) for v in values] == pytest.approx([0.1, 0.3])
    ufl = invoke("export", tmp_path, "--format", "ufl").stdout
    assert "0.1" in ufl
    assert "0.3" in ufl
    assert read_result_laws(tmp_path)["augmented"].named.law == law


def test_a_constant_by_mode_ends_at_its_range_and_is_refused_beside_terms(tmp_path):
    differing = {"alpha": by_mode((0.1, np.nextafter(1.0, 2.0)))}
    named = loop_result(declared_parameters=differing).equation().named
    assert [one["alpha"] for one in named.constants] == [0.1, 1.0]
    effect = DeclaredEffect("giesekus_mobility", "constitutive", {"alpha": by_mode((0.1, 0.3))})
    write_loop(loop_result(declared_effects=(effect,)), tmp_path)
    assert "giesekus_mobility differs" in invoke("export", tmp_path).stderr


@pytest.mark.parametrize(
    ("effect", "said"), [("yield_stress", "cannot be written out"), ("thixotropy", "written form")]
)
def test_a_loop_whose_law_is_no_sum_of_terms_says_why(tmp_path, effect, said):
    result = loop_result((effect, 0.1, *([2.0] if effect == "thixotropy" else [])))
    result = replace(result, fluid=None) if effect == "thixotropy" else result
    assert said in result._repr_html_().replace("&#x27;", "'")
    write_loop(result, tmp_path)
    assert effect in invoke("export", tmp_path, code=2).stderr


def test_a_loop_whose_fluid_has_a_state_leaves_with_its_equation(tmp_path):
    found = loop_result(("thixotropy", 0.1, 2.0))
    part = StatePart("thixotropy", {"breakdown": 0.1, "build_up_time": 2.0})
    result = replace(found, fluid=None, fluid_at_mean=found.fluid, states=(part,))
    write_loop(result, tmp_path)
    text = invoke("export", tmp_path).stdout
    module = {}
    exec(text, module)
    (rate,) = module["structure_rate"](np.zeros((1, 3, 3)), np.diag([3.0, 0.0], k=1), [0.5])
    # ds/dt = (1 - s)/t_b - k |rate| s
    assert rate == pytest.approx(0.5 / 2.0 - 0.1 * 3.0 * 0.5)
    assert read_result_laws(tmp_path)["augmented"].states == (part,)
    refused = invoke("export", tmp_path, "--format", "rheotool", code=2)
    assert "cannot be exported to rheoTool: it has a structure" in refused.stderr


def test_the_nearest_classical_law_is_exported_in_place_of_the_answer(tmp_path):
    equation = loop_result(base=("giesekus", {"alpha": 0.137})).equation()
    near = NearestLaw("giesekus", {"alpha": StageParameter(0.1, (0.05, 0.2), "1")}, 0.12, equation)
    write_loop(replace(loop_result(("yield_stress", 0.1)), nearest_law=near), tmp_path)
    said = json.loads((tmp_path / "loop.json").read_text())["nearest_law"]
    assert (said["law"], said["size"]) == ("giesekus", 0.12)
    assert said["constants"]["alpha"] == {"value": 0.1, "ci95": [0.05, 0.2], "unit": "1"}
    assert "0.137" in invoke("export", tmp_path, "--format", "python", code=0).stdout
    # negative control: without one the law that cannot be written out is refused
    write_loop(loop_result(("yield_stress", 0.1)), tmp_path)
    invoke("export", tmp_path, "--format", "python", code=2)


HERSCHEL_BULKLEY = {"yield_stress_Pa": 12.0, "consistency_Pa_sn": 4.0, "flow_index": 0.5}
CARREAU_YASUDA = {
    "zero_shear_viscosity_Pa_s": 50.0, "infinite_shear_viscosity_Pa_s": 0.1,
    "critical_time_s": 2.0, "flow_index": 0.4, "sharpness": 2.0,
}  # fmt: skip


def result(folder, law, constants, **changed):
    numbers = {name: {"value": v, "ci95": [0.9 * v, 1.1 * v]} for name, v in constants.items()}
    use = {"law": law, "constants": numbers, "range": {"rate_1_s": [0.01, 100.0]},
           "expected_error": {"sigma12": 0.02}} | changed  # fmt: skip
    folder.mkdir(exist_ok=True)
    (folder / "loop.json").write_text(json.dumps({"law": None, "law_missing": "no", "use": use}))
    return folder


def entries(text):
    """Return the entries of OpenFOAM's dictionary by name, read by hand."""
    rows = [line.strip().rstrip(";").split() for line in text.splitlines() if line.endswith(";")]
    return {row[0]: row[-1] for row in rows}


@pytest.mark.parametrize(
    ("law", "constants", "kind", "stress"),
    [
        # γ̇ = 4: 12 + 4·4^0.5, (0.1 + 49.9 (1 + 8²)^(−0.3))·4, and 5·4^0.5
        ("herschel_bulkley", HERSCHEL_BULKLEY, "HerschelBulkley", 20.0),
        ("carreau_yasuda", CARREAU_YASUDA, "CarreauYasuda", 4 * (0.1 + 49.9 * 65**-0.3)),
        ("newtonian", {"viscosity_Pa_s": 3.0}, "Newtonian", 12.0),
        ("power_law", {"consistency_Pa_sn": 5.0, "flow_index": 0.5}, "PowerLaw", 10.0),
    ],
)
def test_an_inelastic_fluid_leaves_with_constants_and_range(tmp_path, law, constants, kind, stress):
    folder = result(tmp_path / "out", law, constants)
    text = invoke("export", folder, "--format", "rheotool", "--density", "1050").stdout
    found = entries(text)
    assert found["type"] == kind
    # rho, and of Herschel–Bulkley the cap of the viscosity, stand beside the constants
    assert float(found["rho"]) == 1050.0
    assert {f"{float(v):g}" for v in constants.values()} <= {
        f"{float(v):g}" for v in found.values() if v.replace(".", "").isdigit()
    }
    file = tmp_path / "law.py"
    invoke("export", folder, "--out", file, code=0)
    assert module_at(file).stress(4.0) == pytest.approx(stress, rel=1e-5)  # six digits are written
    for said in (text, file.read_text("utf-8")):
        assert "0.01–100 1/s" in said
        assert "σ12 2 %" in said


def test_a_format_or_a_result_that_is_none_is_refused_in_words(tmp_path):
    solid = {"elastic_modulus_Pa": 9.0, "viscosity_Pa_s": 1.0}
    folder = result(tmp_path / "out", "kelvin_voigt", solid)
    refused = invoke("export", folder, "--format", "rheotool", code=2)
    assert "has no format 'rheotool'. Write one of: python, latex, json" in refused.stderr
    invoke("export", result(tmp_path / "bad", "newtonian", {}), code=2)
    other = result(tmp_path / "giesekus", "giesekus", {"alpha": 0.2})
    assert "no" in invoke("export", other).stderr  # the reason that the result gives
