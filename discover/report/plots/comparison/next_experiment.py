"""What to measure next: predictions of the laws that remain, in the experiment proposed."""

import numpy as np

from discover.comparison.comparison import Comparison
from discover.identify.design.experiments import OBSERVED
from discover.report.plots.comparison.flows import units
from discover.report.plots.style import (
    CHOSEN_STYLE,
    RIVAL_STYLES,
    Picture,
    figure,
    legend_above,
    picture,
)
from discover.report.wording import FIGURE_SYMBOLS, readable

_OVER_DECADES = ("step_strain", "flow_curve", "creep")


def next_picture(comparison: Comparison) -> Picture | None:
    """Return what the chosen law and its rivals predict in the best experiment."""
    following = comparison.next_measurement
    if not following.proposals:
        return None
    best = following.proposals[0]
    stress_unit, time_label, rate_label = units(comparison)
    protocol, along = best.experiment.protocol, best.experiment.times
    if protocol.control == "steady":
        along, time_label = np.asarray(protocol.table_rates), rate_label
    with figure(1, len(best.observed), height=3.0) as (drawing, axes):
        for panel, quantity in zip(axes[0], best.observed, strict=True):
            # the first column is what is recorded
            column = OBSERVED.index(quantity) if quantity in OBSERVED else 0
            panel.plot(
                along,
                best.curves[0, :, column],
                **CHOSEN_STYLE,
                linewidth=2.2,
                label=f"chosen: {_typeset(following.laws[0])}",
            )
            rivals = zip(following.laws[1:], best.curves[1:], strict=True)
            for i, (name, curve) in enumerate(rivals):
                panel.plot(
                    along,
                    curve[:, column],
                    **RIVAL_STYLES[i % len(RIVAL_STYLES)],
                    label=_typeset(name),
                )
            # a rival that runs away must not flatten the others
            low, high = best.curves[0, :, column].min(), best.curves[0, :, column].max()
            margin = 0.6 * (high - low) or 0.5
            panel.set_ylim(low - margin, high + margin)
            if best.experiment.kind in _OVER_DECADES:
                panel.set_xscale("log")
            panel.set_ylabel(
                FIGURE_SYMBOLS[quantity] + ("" if quantity == "strain" else stress_unit)
            )
            panel.set_xlabel(time_label)
        legend_above(drawing, axes, columns=2)
        return picture(
            drawing,
            "next_experiment",
            f"The experiment proposed: {best.experiment.title}. The chosen law and its rivals, all "
            "of which the data at hand allow.",
        )


def _typeset(law: str) -> str:
    return readable(law).replace("-", "−")
