"""Constants that may differ from mode to mode, against the relaxation time."""

from collections.abc import Mapping

import numpy as np

from discover.loop.constants import ConstantByMode
from discover.report.plots.style import (
    BEFORE,
    NETWORK,
    SHADE,
    Picture,
    figure,
    legend_above,
    literal,
    make_logarithmic,
    picture,
)
from discover.words import effect_title, readable, significant


def by_mode_picture(
    constants: Mapping[str, ConstantByMode], is_unexplained: bool
) -> Picture | None:
    """Return each constant by mode with its band; None where there is none.

    `constants`: by name of the parameter, the effect or the term. `is_unexplained`: whether a law
    with these constants leaves more than noise.
    """
    if not constants:
        return None
    with figure(1, len(constants), width=9.0, height=2.8) as (drawing, axes):
        for panel, (name, constant) in zip(axes[0], constants.items(), strict=True):
            told = [(mode.relaxation_time_s, *mode.ci95) for mode in constant.modes if mode.ci95]
            if told:
                times, low, high = np.array(sorted(told)).T
                panel.fill_between(times, low, high, color=SHADE, label="95 % interval")
            for left_open, colour, fill in ((False, NETWORK, NETWORK), (True, BEFORE, "none")):
                shown = [mode for mode in constant.modes if mode.left_open is left_open]
                panel.plot(
                    [mode.relaxation_time_s for mode in shown],
                    [mode.value for mode in shown],
                    "o", ms=5.0, color=colour, mfc=fill, ls="none",
                    label="not determined by these data" if left_open else "fitted",
                )  # fmt: skip
            make_logarithmic(panel.xaxis)
            panel.set_xlabel("relaxation time (s)")
            panel.set_ylabel(literal(readable(effect_title(name))))
        legend_above(drawing, axes)
        said = " ".join(by_mode_sentence(name, one) for name, one in constants.items())
        doubt = ""
        if is_unexplained:
            doubt = (
                " The data are not explained, so these are the values that come nearest, and no "
                "constants of the fluid."
            )
        return picture(
            drawing,
            "by_mode",
            f"{said}{doubt} Intervals take it that the law is the fluid's.",
        )


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
