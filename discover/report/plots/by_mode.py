"""Constants that may differ from mode to mode, against the relaxation time."""

from collections.abc import Mapping

import numpy as np

from discover.loop.constants import ConstantByMode
from discover.report.plots.style import (
    BEFORE,
    NETWORK,
    SHADE,
    Panel,
    Picture,
    literal,
    row_of_panels,
)
from discover.words import effect_title, readable, significant

# whether a constant is left open, colour and filling of its mark, and what that is called
_KINDS = (
    (False, NETWORK, NETWORK, "fitted"),
    (True, BEFORE, "none", "not determined by these data"),
)


def by_mode_picture(
    constants: Mapping[str, ConstantByMode], is_unexplained: bool
) -> Picture | None:
    """Return each constant by mode with its band; None where there is none.

    `constants`: by name of the parameter, the effect or the term. `is_unexplained`: whether a law
    with these constants leaves more than noise.
    """
    if not constants:
        return None
    panels = []
    for name, constant in constants.items():
        told = [(mode.relaxation_time_s, *mode.ci95) for mode in constant.modes if mode.ci95]
        bands = [(*np.array(sorted(told)).T, {"color": SHADE, "label": "95 % interval"})]
        points = {"marker": "o", "ms": 5.0, "ls": "none"}
        curves = []
        for left_open, colour, fill, label in _KINDS:
            shown = [mode for mode in constant.modes if mode.left_open is left_open]
            times = [mode.relaxation_time_s for mode in shown]
            style = {**points, "color": colour, "mfc": fill, "label": label}
            curves.append((times, [mode.value for mode in shown], style))
        label = literal(readable(effect_title(name)))
        settings = {"xscale": "log", "xlabel": "relaxation time (s)", "ylabel": label}
        panels.append(Panel(curves, settings, bands if told else ()))
    said = " ".join(by_mode_sentence(name, one) for name, one in constants.items())
    doubt = ""
    if is_unexplained:
        doubt = (
            " The data are not explained, so these are the values that come nearest, and no "
            "constants of the fluid."
        )
    caption = f"{said}{doubt} Intervals take it that the law is the fluid's."
    return row_of_panels("by_mode", caption, panels, 9.0, 2.8)


def by_mode_sentence(name: str, constant: ConstantByMode) -> str:
    """Return what the data say of a constant by mode."""
    symbol = readable(effect_title(name))
    gain = significant(constant.evidence[-1], 2)
    text = f"{symbol} is free in each mode that the runs tell (evidence over one constant: {gain})"
    known = [mode for mode in constant.modes if not mode.left_open]
    if not known:
        return f"{text}, and not determined by these data in any mode."
    parts = [f"{significant(m.value, 2)} at {significant(m.relaxation_time_s, 2)} s" for m in known]
    open_ones = [significant(m.relaxation_time_s, 2) for m in constant.modes if m.left_open]
    text = f"{text}: {', '.join(parts)}."
    if open_ones:
        text += f" Not determined by these data in the modes of {', '.join(open_ones)} s."
    return text
