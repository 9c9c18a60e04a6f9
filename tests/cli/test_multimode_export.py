"""``discover export`` of a law with slip in three modes and a solvent, integrated by scipy.

The reference is written here from the Gordon–Schowalter derivative in Pa and s; every format is
read from the file that the command wrote, by what would run it.
"""

import json
import re

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp
from typer.testing import CliRunner

from discover.cli import app
from discover.equations import Equation, equation_to_json
from tensor_library import LawTerm

MODULI, RELAXATION = (120.0, 35.0, 4.0), (0.2, 1.3, 9.0)
SOLVENT, XI, EPSILON = 2.5, 0.24, 0.15
TIMES = np.linspace(0.0, 4.0, 17)
UNIT = np.eye(3)
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


def integrated(rate_of_mode, modes=3):
    """Return the stress of the modes added up, shape (times, 3, 3)."""

    def rate(time, state):
        del time
        stress = state.reshape(modes, 3, 3)
        return np.array([rate_of_mode(k, stress[k]) for k in range(modes)]).ravel()

    solution = solve_ivp(
        rate, (0.0, TIMES[-1]), np.zeros(9 * modes), t_eval=TIMES, rtol=1e-7, atol=1e-7
    )
    return solution.y.T.reshape(-1, modes, 3, 3).sum(axis=1)


def reference(destruction, xi=XI):
    strain, vorticity = 0.5 * RATE, 0.5 * (GRADIENT - GRADIENT.T)

    def rate(k, stress):
        modulus, time = MODULI[k], RELAXATION[k]
        rotated = vorticity @ stress - stress @ vorticity
        stretched = (1.0 - xi) * (strain @ stress + stress @ strain)
        lost = destruction(np.trace(stress) / modulus) * stress / time
        return rotated + stretched + modulus * RATE - lost

    return integrated(rate) + SOLVENT * RATE


def by_python(text):
    module = {}
    exec(text, module)

    def rate(k, stress):
        state = np.zeros((3, 3, 3))
        state[k] = stress
        return module["stress_rate"](state, GRADIENT)[k]

    total = integrated(rate)
    return np.array([module["total_stress"](s[None], GRADIENT) for s in total])


def by_sympy(text):
    module = {}
    exec(text, module)
    symbols = [*module["stress_symbols"], *module["gradient_symbols"]]
    function = sympy.lambdify(symbols, module["stress_rate"], "numpy", cse=True)

    def rate(k, stress):
        modulus, time = module["modes"][k]
        s = stress / modulus
        components = (s[0, 0], s[0, 1], s[0, 2], s[1, 1], s[1, 2], s[2, 2])
        return modulus / time * function(*components, *(time * GRADIENT).ravel())

    return integrated(rate) + module["solvent_viscosity_Pa_s"] * RATE


def by_json(text):
    content = json.loads(text)
    functions = {"tr": np.trace, "exp": np.exp, "I": UNIT}
    parts = [
        (t["coefficient"], compile(t["term"].replace(".", " @ "), "term", "eval"), t["inner"])
        for t in content["terms"]
    ]

    def rate(k, stress):
        modulus, time = content["modes"][k].values()
        s, gradient = stress / modulus, time * GRADIENT
        d = gradient + gradient.T
        names = functions | {"sigma": s, "gammadot": d}
        extra = sum(c * eval(code, names | inner) for c, code, inner in parts)
        return modulus / time * (d + gradient @ s + s @ gradient.T - s - extra)

    return integrated(rate) + content["solvent_viscosity_Pa_s"] * RATE


def by_rheotool(text):
    """PTT.C of rheoTool, mode by mode."""
    modes = re.findall(r"M\d+\s*\{(.*?)\}", text, re.S)
    entries = [dict(re.findall(r"^\s*(\w+)\s.*?(\S+);$", mode, re.M)) for mode in modes]
    assert {e["type"] for e in entries} == {"PTT"}
    solvent = sum(float(e["etaS"]) for e in entries)

    def rate(k, stress):
        e = entries[k]
        eta, time = float(e["etaP"]), float(e["lambda"])
        z = float(e["epsilon"]) * time / eta * np.trace(stress)
        loss = 1.0 + z if e["destructionFunctionType"] == "linear" else np.exp(z)
        slip = 0.5 * float(e["zeta"]) * (stress @ RATE + RATE @ stress)
        convected = GRADIENT @ stress + stress @ GRADIENT.T
        return convected + eta / time * RATE - slip - loss * stress / time

    return integrated(rate) + solvent * RATE


READERS = {"python": by_python, "sympy": by_sympy, "json": by_json, "rheotool": by_rheotool}


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
    for form in (*READERS, "latex"):
        file = folder / f"law.{form}"
        arguments = ["export", str(folder), "--format", form, "--out", str(file)]
        done = CliRunner().invoke(app, arguments)
        assert done.exit_code == 0, done.output
        texts[form] = file.read_text("utf-8")
    return reference(destruction), reference(destruction, 1.1 * XI), texts


@pytest.mark.parametrize("form", READERS)
def test_the_exported_file_flows_as_the_law_in_several_modes(exported, form):
    wanted, other, texts = exported
    found = READERS[form](texts[form])
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
