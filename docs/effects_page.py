"""The dictionary of effects as a page.

``python docs/effects_page.py`` writes it; a test holds it equal to the dictionary.
"""

from collections.abc import Iterator
from pathlib import Path

from discover.effects.base import AbstractEffect, EffectParameter
from discover.effects.registry import named_effects

PAGE = Path(__file__).parent / "effects.md"

_WHERE = {
    "constitutive": "Constitutive: the fluid",
    "kinematic": "Kinematic: the deformation that the fluid felt",
    "signal": "Signal: what was recorded of the stress",
}


def reference_page() -> str:
    """Return the dictionary in Markdown: equation, parameters, size, confirmation and source."""
    effects = list(named_effects().values())
    lines = [
        "# The dictionary of effects",
        "",
        "These are the effects that the closed loop may add to a declared law. The first",
        "parameter of an effect is its amplitude: at zero the effect changes nothing. The range",
        "of a parameter is the range that it can have in a laboratory. A constant at the end of",
        "its range is given as a bound, one that is open over decades as *not determined*:",
        "neither is a finding. Any term of the tensor library, such as `tr(sigma)*sigma`, is a",
        "candidate too. An effect of your own is one file: see [adding an",
        "effect](adding-an-effect.md).",
        "",
        "This page is written by `python docs/effects_page.py`; a test checks it against the code.",
    ]
    for kind, title in _WHERE.items():
        lines += ["", f"## {title}"]
        for effect in effects:
            if effect.kind == kind:
                lines += ["", *_entry(effect)]
    return "\n".join(lines) + "\n"


def _entry(effect: AbstractEffect) -> list[str]:
    return [
        f"### `{effect.name}`",
        "",
        f"$${effect.equation}$$",
        "",
        "| parameter | symbol | unit | physical range | reason for the range |",
        "|---|---|---|---|---|",
        *(
            f"| `{parameter.name}` | ${parameter.symbol}$ | {parameter.unit or '–'} "
            f"| {_range(parameter)} | {parameter.range_source} |"
            for parameter in effect.parameters
        ),
        "",
        *(["- A candidate only if a study asks for it by name."] if effect.on_request else []),
        f"- Visible from: {effect.visible}",
        f"- To confirm: {effect.check}",
        f"- Source: {effect.source.rstrip('.')}.",
        *(line for parameter in effect.parameters for line in _other_names(parameter)),
    ]


def _other_names(parameter: EffectParameter) -> Iterator[str]:
    """Yield which alias the effect has in a limit of a constant."""
    if parameter.endless:
        yield f"- Also `{parameter.endless}` where no run lasts as long as ${parameter.symbol}$."
    if parameter.absent:
        yield f"- Also `{parameter.absent}` where ${parameter.symbol}$ may be {parameter.low:g}."


_PROPERTIES = {
    "run_time": "length of a run",
    "inverse_rate": "1/(largest rate)",
    "strain": "strain of a run",
    "stress": "rms stress",
    "inverse_stress": "1/(rms stress)",
    "fluidity": "largest rate/(rms stress)",
    "viscosity": "(rms stress)/(largest rate)",
    "stress_rate": "(rms stress)/(length of a run)",
    "softening_by_heat": "(−d ln a_T/dT)/(1 MJ/(m³ K))",
    "shift_factor": "shift factor of times",
}
"""Properties of the data in which ranges are measured; medians over the fitted runs."""


def _range(parameter: EffectParameter) -> str:
    text = f"{parameter.low:g} to {parameter.high:g}"
    if parameter.range_scale != "one":
        text += f" × {_PROPERTIES[parameter.range_scale]}"
    return text


if __name__ == "__main__":
    PAGE.write_text(reference_page(), encoding="utf-8")
