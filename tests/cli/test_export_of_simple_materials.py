"""A yield-stress or viscous fluid leaves a folder of results as text for other programs."""

import importlib.util
import json

import pytest
from typer.testing import CliRunner

from discover.cli import app

HERSCHEL_BULKLEY = {"yield_stress_Pa": 12.0, "consistency_Pa_sn": 4.0, "flow_index": 0.5}
CARREAU_YASUDA = {
    "zero_shear_viscosity_Pa_s": 50.0, "infinite_shear_viscosity_Pa_s": 0.1,
    "critical_time_s": 2.0, "flow_index": 0.4, "sharpness": 2.0,
}  # fmt: skip


def result(folder, law, constants, **changed):
    """Write what an export reads of a result."""
    numbers = {name: {"value": v, "ci95": [0.9 * v, 1.1 * v]} for name, v in constants.items()}
    use = {"law": law, "constants": numbers, "range": {"rate_1_s": [0.01, 100.0]},
           "expected_error": {"sigma12": 0.02}} | changed  # fmt: skip
    folder.mkdir(exist_ok=True)
    (folder / "loop.json").write_text(json.dumps({"law": None, "law_missing": "no", "use": use}))
    return folder


def export(folder, *options):
    return CliRunner().invoke(app, ["export", str(folder), *options])


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
def test_a_fluid_without_elasticity_leaves_with_its_constants_size_and_range(
    tmp_path, law, constants, kind, stress
):
    folder = result(tmp_path / "out", law, constants)
    text = export(folder, "--format", "rheotool", "--density", "1050").stdout
    found = entries(text)
    assert found["type"] == kind
    # rho, and of Herschel–Bulkley the cap of the viscosity, stand beside the constants
    assert float(found["rho"]) == 1050.0
    assert {f"{float(v):g}" for v in constants.values()} <= {
        f"{float(v):g}" for v in found.values() if v.replace(".", "").isdigit()
    }
    file = tmp_path / "law.py"
    assert export(folder, "--out", str(file)).exit_code == 0
    spec = importlib.util.spec_from_file_location("law", file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert module.stress(4.0) == pytest.approx(stress, rel=1e-5)  # six digits are written
    for said in (text, file.read_text("utf-8")):
        assert "0.01–100 1/s" in said
        assert "σ12 2 %" in said


def test_a_format_or_a_result_that_is_none_is_refused_in_words(tmp_path):
    folder = result(tmp_path / "out", "kelvin_voigt", {"elastic_modulus_Pa": 9.0,
                                                       "viscosity_Pa_s": 1.0})  # fmt: skip
    refused = export(folder, "--format", "rheotool")
    assert refused.exit_code == 2
    assert "has no format 'rheotool'. Write one of: python, latex, json" in refused.stderr
    damaged = result(tmp_path / "bad", "newtonian", {})
    assert export(damaged).exit_code == 2
    other = result(tmp_path / "giesekus", "giesekus", {"alpha": 0.2})
    assert "no" in export(other).stderr  # the reason that the result gives
