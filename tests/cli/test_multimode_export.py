"""``discover export`` of a law with slip in three modes and a solvent, integrated by scipy.

The reference is written here from the Gordon–Schowalter derivative in Pa and s; every format is
read from the file that the command wrote, by what would run it.
"""

import json
import re

import numpy as np
import pytest
from readers import by_json, by_python, by_rheotool, by_sympy, integrated, module_of, rheotool_modes
from typer.testing import CliRunner

from discover.cli import app
from discover.equations import Equation, equation_to_json
from tensor_library import LawTerm

MODULI, RELAXATION = (120.0, 35.0, 4.0), (0.2, 1.3, 9.0)
SOLVENT, XI, EPSILON = 2.5, 0.24, 0.15
TIMES = np.linspace(0.0, 4.0, 17)
# shear and extension at once, so that no component stays zero
GRADIENT = np.array([[0.3, 1.8, 0.0], [0.0, -0.2, 0.1], [0.2, 0.0, -0.1]])
RATE = GRADIENT + GRADIENT.T
SLIP = LawTerm("sigma.gammadot+gammadot.sigma", 0.5 * XI)
LAWS = {
    "johnson_segalman": ((SLIP,), lambda trace: 1.0),
    "ptt_linear with slip": (
        (SLIP, LawTerm("tr(sigma)*sigma", EPSILON)),
        lambda trace: 1.0 + EPSILON * trace,
    ),
    "ptt_exponential with slip": (
        (SLIP, LawTerm("(exp(epsilon*tr(sigma))-1)*sigma", 1.0, {"epsilon": EPSILON})),
        lambda trace: np.exp(EPSILON * trace),
    ),
}


def reference(destruction, xi=XI):
    strain, vorticity = 0.5 * RATE, 0.5 * (GRADIENT - GRADIENT.T)

    def rates(k, stress, y, _):
        modulus, time = MODULI[k], RELAXATION[k]
        rotated = vorticity @ stress - stress @ vorticity
        stretched = (1.0 - xi) * (strain @ stress + stress @ strain)
        lost = destruction(np.trace(stress) / modulus) * stress / time
        return rotated + stretched + modulus * RATE - lost, y

    return integrated(rates, GRADIENT, TIMES, 3) + SOLVENT * RATE


# the modes, and the solvent's stress
READERS = {
    "python": (by_python, lambda t: module_of(t)["total_stress"](np.zeros((1, 3, 3)), GRADIENT)),
    "sympy": (by_sympy, lambda t: module_of(t)["solvent_viscosity_Pa_s"] * RATE),
    "json": (by_json, lambda t: json.loads(t)["solvent_viscosity_Pa_s"] * RATE),
}


def flowing(form, text):
    if form == "rheotool":
        assert {mode.type for mode in rheotool_modes(text)} == {"PTT"}
        return by_rheotool(text, GRADIENT, TIMES)
    modes, solvent = READERS[form]
    return integrated(modes(text), GRADIENT, TIMES, 3) + solvent(text)


@pytest.fixture(scope="module", params=LAWS)
def exported(request, tmp_path_factory):
    """The reference, and the files that the command wrote."""
    terms, destruction = LAWS[request.param]
    folder = tmp_path_factory.mktemp("results")
    law = equation_to_json(Equation(terms, MODULI, RELAXATION, True, SOLVENT))
    (folder / "comparison.json").write_text(
        json.dumps({"learners": {"tensor_sindy": {"law": law}}})
    )
    texts = {}
    for form in (*READERS, "rheotool", "latex"):
        file = folder / f"law.{form}"
        arguments = ["export", str(folder), "--format", form, "--out", str(file)]
        done = CliRunner().invoke(app, arguments)
        assert done.exit_code == 0, done.output
        texts[form] = file.read_text("utf-8")
    return reference(destruction), reference(destruction, 1.1 * XI), texts


@pytest.mark.parametrize("form", [*READERS, "rheotool"])
def test_the_exported_file_flows_as_the_law_in_several_modes(exported, form):
    wanted, other, texts = exported
    found = flowing(form, texts[form])
    scale = np.max(np.abs(wanted))
    assert np.max(np.abs(found - wanted)) < 1e-5 * scale
    # negative control: a slip parameter that is a tenth off shows
    assert np.max(np.abs(found - other)) > 1e-2 * scale


def test_the_exported_latex_has_every_mode_and_brackets_the_slip(exported):
    _, _, texts = exported
    text = texts["latex"]
    pairs = re.findall(
        r"G_\{\d\} &= ([\d.]+)\\,\\mathrm\{Pa\}, & \\lambda_\{\d\} &= ([\d.]+)", text
    )
    assert [tuple(map(float, p)) for p in pairs] == list(zip(MODULI, RELAXATION, strict=True))
    stress, rate = r"\boldsymbol{\sigma}", r"\dot{\boldsymbol{\gamma}}"
    sum_of_both = rf"{stress} \cdot {rate} + {rate} \cdot {stress}"
    assert rf" + 0.12 \, \left({sum_of_both}\right)" in text
