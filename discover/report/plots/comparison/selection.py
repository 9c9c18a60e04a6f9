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
from discover.words import readable

_MOST_BARS = 8
_RULE_STYLES = {"evidence": (SPARSE, "o", "evidence"), "held_out": (NETWORK, "s", "held-out runs")}


def selection_picture(details: Mapping[str, Any]) -> Picture | None:
    """Return the selection path: misfits, evidence, and how probable each term is.

    `details`: of the sparse learner's result: ``path``, ``selectors``, ``inclusion``.
    """
    path = details.get("path") or []
    if len(path) < 2:
        return None
    sizes = [row["size"] for row in path]
    probable = list((details.get("inclusion") or {}).items())[:_MOST_BARS]
    with figure(1, 3 if probable else 2, width=10.0, height=3.0) as (drawing, axes):
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
        evidence = np.array([row["log_evidence"] for row in path])
        middle.plot(sizes, np.max(evidence) - evidence, color=BEFORE, marker=".")
        middle.set_yscale("symlog", linthresh=5.0)
        middle.set_ylabel("log odds behind the likeliest")
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
        if probable:
            bars, rows = axes[0, 2], probable[::-1]
            bars.barh([readable(name) for name, _ in rows], [100.0 * p for _, p in rows],
                      height=0.5, color=GREEN)  # fmt: skip
            bars.set_xlim(0.0, 100.0)
            bars.set_xlabel("probability of the term (%)")
        legend_above(drawing, axes, columns=4)
        return picture(
            drawing,
            "selection",
            "The best law of each size: its misfit, and its log odds behind the likeliest (linear "
            "below 5). A gap: a law that diverges in a run left out. Right: the probability that "
            "the law has each term, were it among those that were fitted.",
        )


def _percentage(share: float | None) -> float:
    """Return a share in per cent for a logarithmic axis; NaN, a gap, where there is none."""
    return np.nan if share is None else 100.0 * max(share, 1e-9)
