"""The way from the empty to the dense law, and which member each rule would take."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from discover.report.plots.style import (
    BEFORE,
    GREEN,
    NETWORK,
    PURPLE,
    SPARSE,
    TRUTH,
    Picture,
    figure,
    legend_above,
    make_percentage,
    picture,
)
from discover.report.wording import readable

_MOST_BARS = 8
_RULE_STYLES = {
    "bic": (SPARSE, "o", "BIC"),
    "held_out": (NETWORK, "s", "held-out runs"),
    "stability": (GREEN, "^", "stability"),
}
STABLE_LINE = 0.6


def selection_picture(details: Mapping[str, Any]) -> Picture | None:
    """Return the selection path: misfits, the criterion, and how stable each term is.

    Parameters
    ----------
    details
        Of the sparse learner's result: ``path``, ``selectors``, ``selection_frequency``.
    """
    path = details.get("path") or []
    if len(path) < 2:
        return None
    sizes = [row["size"] for row in path]
    frequencies = (details.get("selection_frequency") or [])[:_MOST_BARS]
    with figure(1, 3 if frequencies else 2, width=10.0, height=3.0) as (drawing, axes):
        left, middle = axes[0, 0], axes[0, 1]
        left.semilogy(
            sizes,
            [_percentage(row["misfit"]) for row in path],
            color=TRUTH,
            marker=".",
            label="runs fitted",
        )
        if any(row["held_out"] is not None for row in path):
            left.semilogy(
                sizes,
                [_percentage(row["held_out"]) for row in path],
                color=PURPLE,
                marker=".",
                linestyle="--",
                label="runs left out",
            )
        left.set_ylabel("misfit (%)")
        make_percentage(left.yaxis)
        bic = np.array([row["bic"] for row in path], dtype=float)
        if np.any(np.isfinite(bic)):
            middle.plot(sizes, bic - np.nanmin(bic), color=BEFORE, marker=".")
        middle.set_yscale("symlog", linthresh=10.0)
        middle.set_ylabel("BIC above the lowest")
        supports = [row["support"] for row in path]
        chosen = (details.get("selectors") or {}).get("chosen", {})
        for offset, (rule, (colour, marker, label)) in enumerate(_RULE_STYLES.items()):
            if rule in chosen and chosen[rule] in supports:
                place = supports.index(chosen[rule])
                left.plot(
                    sizes[place],
                    _percentage(path[place]["misfit"]),
                    marker=marker,
                    markersize=13 - 3 * offset,
                    fillstyle="none",
                    linestyle="none",
                    color=colour,
                    label=f"chosen by {label}",
                )
        for panel in (left, middle):
            panel.set_xlabel("number of terms")
            panel.set_xticks(sizes)
        if frequencies:
            bars = axes[0, 2]
            rows = frequencies[::-1]
            bars.barh(
                [readable(row["term"]) for row in rows],
                [100.0 * row["with_twins"] for row in rows],
                color=GREEN,
                alpha=0.35,
                label="term or an equivalent one",
            )
            bars.barh(
                [readable(row["term"]) for row in rows],
                [100.0 * row["frequency"] for row in rows],
                height=0.4,
                color=GREEN,
                label="the term itself",
            )
            bars.axvline(100.0 * STABLE_LINE, color=BEFORE, linewidth=0.8)
            bars.set_xlim(0.0, 100.0)
            bars.set_xlabel("chosen in halves of the data (%)")
        legend_above(drawing, axes, columns=4)
        return picture(
            drawing,
            "selection",
            "The best law of each size: its misfit, and its BIC above the lowest (linear below "
            "10). A gap: a law that diverges in a run left out. Right: how often each term is "
            "chosen when half of the data are looked at; the line marks what counts as stable. A "
            "pale bar beyond the full one: terms of identical signature take each other's place.",
        )


def _percentage(share: float | None) -> float:
    """Return a share in per cent for a logarithmic axis; NaN, a gap, where there is none."""
    return np.nan if share is None else 100.0 * max(share, 1e-9)
