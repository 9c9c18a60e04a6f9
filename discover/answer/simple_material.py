"""A yield stress, a viscous fluid, a solid: words, equations and exports of a simple material."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from jaxtyping import Float

from discover.answer.answer import Answer
from discover.answer.constant import Constant
from discover.answer.parts import ExpectedError, Range
from discover.dataset import Run
from discover.equations.files import read_result
from discover.equations.formats.rheotool import DENSITY, viscous_fluid
from discover.errors import InputError
from discover.inference.closed_forms import recorded, viscosity
from discover.inference.simple_materials import SimpleFit, describes
from discover.plain_numbers import json_text
from discover.words import unknown_name

Kind = Literal["yield_stress", "viscous", "solid"]


@dataclass(frozen=True)
class SimpleMaterial:
    """Material without relaxation, as recognised.

    `kind`, `title`, `law`: what it is, the name for readers, and that in results.
    `formula`, `latex`: law typeset, without and with its numbers. `onset`: m in s, with which a
    yield stress sets in as 1 − exp(−m |γ̇|); None where it is there at once.
    """

    kind: Kind
    title: str
    law: str
    constants: tuple[Constant, ...]  # with 95 % intervals
    error: float  # relative misfit of the fitted runs
    formula: str
    latex: str
    onset: float | None = None

    def written(self, comments: Sequence[str], slowest: float, density: float) -> dict[str, str]:
        """Return the law as text by format, with lines of comment in front.

        `slowest`: rate in 1/s below which nothing was measured. `density` in kg/m³.
        """
        numbers = [f"{one.value:.6g}" for one in self.constants]
        found = {
            "python": "".join(f"# {line}\n" for line in comments)
            + f"\n{_PYTHON[self.law].format(*numbers)}",
            "latex": "".join(f"% {line}\n" for line in comments) + f"\\[{self.latex}\\]\n",
        }
        if self.law in _RHEOTOOL:
            kind, names = _RHEOTOOL[self.law]
            entries = {
                name: (quantity, one.value)
                for (name, quantity), one in zip(names.items(), self.constants, strict=True)
            }
            if cap := _CAPS.get(self.law):
                # rheoTool wants a largest viscosity: that of a tenth of the slowest rate
                at = 0.1 * slowest
                largest = float(viscosity(self.law, self._values, np.array([at]))[0])
                entries[cap] = "viscosity", float(f"{largest:.3g}")
                comments = [*comments, f"{cap} caps the viscosity below {at:.3g} 1/s."]
            if self.law == "power_law":
                entries["etaMin"] = "viscosity", 0.0
            found["rheotool"] = viscous_fluid(kind, entries, comments, density)
        return found

    def predict(self, run: Run) -> Float[np.ndarray, " n"] | None:
        """Return what it records in a run; None in a flow that it does not describe."""
        # the strain since rest, which creep records
        known = self.kind != "solid" or run.from_rest or run.protocol.control == "stress"
        if not known or not describes(run.protocol.control, run):
            return None
        return recorded(self.law, self._values, run)

    @property
    def _values(self) -> Float[np.ndarray, " k"]:
        values = [one.value for one in self.constants]
        return np.array(values if self.onset is None else [*values, self.onset])


# What a material is, its name for readers, and its constants with their units
_NAMES: dict[str, tuple[Kind, str, dict[str, str]]] = {
    "newtonian": ("viscous", "viscous fluid (Newtonian)", {"viscosity_Pa_s": "Pa s"}),
    "herschel_bulkley": (
        "yield_stress", "yield-stress fluid (Herschel–Bulkley)",
        {"yield_stress_Pa": "Pa", "consistency_Pa_sn": "Pa sⁿ", "flow_index": "1"},
    ),
    "power_law": (
        "viscous", "viscous fluid (power law)", {"consistency_Pa_sn": "Pa sⁿ", "flow_index": "1"},
    ),
    "carreau_yasuda": (
        "viscous", "viscous fluid (Carreau–Yasuda)",
        {"zero_shear_viscosity_Pa_s": "Pa s", "infinite_shear_viscosity_Pa_s": "Pa s",
         "critical_time_s": "s", "flow_index": "1", "sharpness": "1"},
    ),
    "kelvin_voigt": (
        "solid", "solid (Kelvin–Voigt)", {"elastic_modulus_Pa": "Pa", "viscosity_Pa_s": "Pa s"},
    ),
}  # fmt: skip

# Law typeset, and as a function of Python, with places for the constants in their order
_LATEX = {
    "newtonian": r"\sigma_{{12}} = \eta\,\dot\gamma, \qquad \eta = {}",
    "herschel_bulkley": (
        r"|\sigma_{{12}}| = \tau_y + K|\dot\gamma|^n\ \mathrm{{where}}\ |\sigma_{{12}}| > \tau_y,"
        r"\quad \dot\gamma = 0\ \mathrm{{elsewhere}}, \qquad \tau_y = {},\; K = {},\; n = {}"
    ),
    "power_law": (r"\sigma_{{12}} = K|\dot\gamma|^{{n-1}}\dot\gamma, \qquad K = {},\; n = {}"),
    "carreau_yasuda": (
        r"\sigma_{{12}} = \left(\eta_\infty + (\eta_0 - \eta_\infty)"
        r"(1 + (k|\dot\gamma|)^a)^{{(n-1)/a}}\right)\dot\gamma, \qquad "
        r"\eta_0 = {},\; \eta_\infty = {},\; k = {},\; n = {},\; a = {}"
    ),
    "kelvin_voigt": r"\sigma_{{12}} = G\gamma + \eta\,\dot\gamma, \qquad G = {},\; \eta = {}",
}

_PYTHON = {
    "newtonian": "def stress(rate):\n    return {} * rate\n",
    "herschel_bulkley": (
        "def stress(rate):\n    # of a rate above zero; no flow up to a stress of {0} Pa\n"
        "    return {0} + {1} * rate ** {2}\n"
    ),
    "power_law": "def stress(rate):\n    return {} * abs(rate) ** ({} - 1) * rate\n",
    "carreau_yasuda": (
        "def stress(rate):\n"
        "    thinned = (1 + ({2} * abs(rate)) ** {4}) ** (({3} - 1) / {4})\n"
        "    return ({1} + ({0} - {1}) * thinned) * rate\n"
    ),
    "kelvin_voigt": "def stress(strain, rate):\n    return {} * strain + {} * rate\n",
}


# rheoTool's type and entries, in the order of the constants   [tree ``of90``, folder ``GNF``]
_RHEOTOOL: dict[str, tuple[str, dict[str, str]]] = {
    "newtonian": ("Newtonian", {"eta": "viscosity"}),
    # k has the dimensions of a viscosity there, its rate being counted in 1/s
    "herschel_bulkley": ("HerschelBulkley", {"tau0": "stress", "k": "viscosity", "n": "number"}),
    "power_law": ("PowerLaw", {"k": "viscosity", "n": "number"}),
    "carreau_yasuda": (
        "CarreauYasuda",
        {"eta0": "viscosity", "etaInf": "viscosity", "k": "time", "n": "number", "a": "number"},
    ),
}

_CAPS = {"herschel_bulkley": "eta0", "power_law": "etaMax"}  # Entry of a largest viscosity


def material_of(found: SimpleFit) -> SimpleMaterial:
    """Return a simple material as it is told, of the one that runs show."""
    kind, title, names = _NAMES[found.law]
    constants = tuple(
        Constant(name, value, ends, unit)
        for (name, unit), value, ends in zip(names.items(), found.values, found.ci95, strict=True)
    )
    latex = _LATEX[found.law].format(*(f"{value:.6g}" for value in found.values))
    formula = latex.partition(r", \qquad ")[0]
    return SimpleMaterial(
        kind, title, found.law, constants, found.error, formula, latex, found.onset
    )


def simple_material_text(folder: str | Path, form: str, density_kg_m3: float | None) -> str | None:
    """Return a yield-stress fluid, a viscous fluid or a solid as text; None for another law.

    `form`: ``python``, ``latex``, ``rheotool`` or ``json``. Raises InputError if there is no
    result, it is damaged, or the format has no such material.
    """
    content, name = read_result(folder)
    use = content.get("use") if isinstance(content, dict) else None
    if not isinstance(use, dict):
        return None
    try:
        answer, written = _written(use, density_kg_m3 or DENSITY)
    except KeyError as error:
        if error.args == (use.get("law"),):  # no simple material
            return None
        raise InputError(f"{name}: `use` lacks {error}. Run again with --overwrite.") from None
    except (TypeError, ValueError, AttributeError, ArithmeticError):
        raise InputError(f"{name}: `use` is damaged. Run again with --overwrite.") from None
    texts = written | {"json": json_text(use)}
    if form not in texts:
        raise InputError(unknown_name("format", form, texts, f"A {answer.title}"))
    return texts[form]


def _written(use: dict[str, Any], density: float) -> tuple[Answer, dict[str, str]]:
    constants: list[Any] = list(dict(use["constants"]).values())
    values = tuple(float(one["value"]) for one in constants)
    both = ((one["ci95"] or (one["value"],) * 2) for one in constants)
    ends = tuple((float(low), float(high)) for low, high in both)
    material = material_of(SimpleFit(use["law"], values, ends, 0.0, 0.0))
    rates = use["range"]["rate_1_s"]
    found = Range(rate_1_s=None if rates is None else (float(rates[0]), float(rates[1])))
    error = use["expected_error"]["sigma12"]
    expected = {} if error is None else {"sigma12": ExpectedError(float(error))}
    answer = Answer(
        material.title, material.law, material.constants, range=found, expected_error=expected
    )
    slowest = 0.0 if found.rate_1_s is None else found.rate_1_s[0]
    return answer, material.written(answer.lines, slowest, density)
