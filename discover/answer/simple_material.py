"""A yield stress, a viscous fluid, a solid: words, equations and exports of a simple material."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from discover.answer.constant import Constant
from discover.dataset import Run
from discover.equations.formats.rheotool import viscous_fluid
from discover.inference.engine.closed_forms import recorded, viscosity
from discover.inference.engine.simple_materials import SimpleFit, describes

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
            + f"\n{_PYTHON[self.law](numbers)}",
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
        known = self.kind != "solid" or run.from_rest  # the strain since rest
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

_LATEX: dict[str, Callable[[Sequence[str]], str]] = {
    "newtonian": lambda v: rf"\sigma_{{12}} = \eta\,\dot\gamma, \qquad \eta = {v[0]}",
    "herschel_bulkley": lambda v: (
        r"|\sigma_{12}| = \tau_y + K|\dot\gamma|^n\ \mathrm{where}\ |\sigma_{12}| > \tau_y,\quad "
        r"\dot\gamma = 0\ \mathrm{elsewhere}, \qquad "
        rf"\tau_y = {v[0]},\; K = {v[1]},\; n = {v[2]}"
    ),
    "power_law": lambda v: (
        r"\sigma_{12} = K|\dot\gamma|^{n-1}\dot\gamma, \qquad "
        rf"K = {v[0]},\; n = {v[1]}"
    ),
    "carreau_yasuda": lambda v: (
        r"\sigma_{12} = \left(\eta_\infty + (\eta_0 - \eta_\infty)"
        r"(1 + (k|\dot\gamma|)^a)^{(n-1)/a}\right)\dot\gamma, \qquad "
        rf"\eta_0 = {v[0]},\; \eta_\infty = {v[1]},\; k = {v[2]},\; n = {v[3]},\; a = {v[4]}"
    ),
    "kelvin_voigt": lambda v: (
        rf"\sigma_{{12}} = G\gamma + \eta\,\dot\gamma, \qquad G = {v[0]},\; \eta = {v[1]}"
    ),
}

_PYTHON: dict[str, Callable[[Sequence[str]], str]] = {
    "newtonian": lambda v: f"def stress(rate):\n    return {v[0]} * rate\n",
    "herschel_bulkley": lambda v: (
        f"def stress(rate):\n    # of a rate above zero; no flow up to a stress of {v[0]} Pa\n"
        f"    return {v[0]} + {v[1]} * rate ** {v[2]}\n"
    ),
    "power_law": lambda v: (
        f"def stress(rate):\n    return {v[0]} * abs(rate) ** ({v[1]} - 1) * rate\n"
    ),
    "carreau_yasuda": lambda v: (
        "def stress(rate):\n"
        f"    thinned = (1 + ({v[2]} * abs(rate)) ** {v[4]}) ** (({v[3]} - 1) / {v[4]})\n"
        f"    return ({v[1]} + ({v[0]} - {v[1]}) * thinned) * rate\n"
    ),
    "kelvin_voigt": lambda v: (
        f"def stress(strain, rate):\n    return {v[0]} * strain + {v[1]} * rate\n"
    ),
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
    latex = _LATEX[found.law]([f"{value:.6g}" for value in found.values])
    formula = latex.partition(r", \qquad ")[0]
    return SimpleMaterial(
        kind, title, found.law, constants, found.error, formula, latex, found.onset
    )
