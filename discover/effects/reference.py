"""The dictionary as a page to read: docs/effects.md is what this writes."""

import math

from discover.effects.base import AbstractEffect, EffectParameter
from discover.effects.registry import named_effects

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
        "Written by `python -m discover.effects.reference > docs/effects.md`; a test holds the",
        "two together. What follows is what the closed loop may add to a declared law. The first",
        "parameter of an effect is its amplitude: at zero it changes nothing. Any term of the",
        "tensor library, such as `tr(sigma)*sigma`, is a candidate too. An effect of your own is",
        "one file: see [adding an effect](adding-an-effect.md).",
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
        "| parameter | symbol | unit | admissible |",
        "|---|---|---|---|",
        *(
            f"| `{parameter.name}` | ${parameter.symbol}$ | {parameter.unit or '–'} "
            f"| {_admissible(parameter)} |"
            for parameter in effect.parameters
        ),
        "",
        f"- Shows from: {effect.visible}",
        f"- To confirm: {effect.check}",
        f"- Source: {effect.source.rstrip('.')}.",
    ]


def _admissible(parameter: EffectParameter) -> str:
    low, high = parameter.low, parameter.high
    if math.isinf(low) and math.isinf(high):
        return "any"
    if math.isinf(high):
        return f"≥ {low:g}"
    if math.isinf(low):
        return f"≤ {high:g}"
    return f"{low:g} to {high:g}"


if __name__ == "__main__":
    print(reference_page(), end="")
