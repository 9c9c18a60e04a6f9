"""What to measure next: what each explanation of a closed loop predicts in the test proposed."""

from discover.loop import LoopResult
from discover.protocols.kinematics import MODULI
from discover.report.plots.style import (
    CHOSEN_STYLE,
    RIVAL_STYLES,
    Picture,
    figure,
    legend_above,
    picture,
)
from discover.report.wording import percent
from discover.words import FIGURE_SYMBOLS, effects_title


def next_test_picture(result: LoopResult) -> Picture | None:
    """Return the predictions of all explanations in the best test; None where none decides."""
    following = result.next_tests
    best = following.best
    if best is None:
        return None
    with figure(1, 1, width=7.0, height=3.2) as (drawing, axes):
        panel = axes[0, 0]
        lines = zip(following.explanations, following.probabilities, best.curves, strict=True)
        for i, (effects, probability, curve) in enumerate(lines):
            panel.plot(
                best.samples,
                curve,
                **(RIVAL_STYLES[(i - 1) % len(RIVAL_STYLES)] if i else CHOSEN_STYLE),
                lw=2.0 if i == 0 else 1.4,
                label=f"{effects_title(effects)} ({percent(probability)})",
            )
        unit = "" if best.quantity == "strain" else " (Pa)"
        panel.set_ylabel(FIGURE_SYMBOLS[best.quantity] + unit)
        panel.set_xlabel("shear rate (1/s)" if best.is_flow_curve else "time (s)")
        if best.is_flow_curve or best.quantity in MODULI:
            panel.set_xscale("log")
            panel.set_yscale("log")
        legend_above(drawing, axes, columns=1)
        return picture(
            drawing,
            "next_test",
            f"What to measure next: {best.title}. Each explanation as it predicts it, all of which "
            f"fit these data; noise is {percent(following.noise)}.",
        )
