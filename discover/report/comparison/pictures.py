"""The pictures of a comparison's page, each drawn by itself."""

from collections.abc import Callable, Sequence
from functools import partial

from discover.comparison.comparison import Comparison
from discover.report.overlay import Overlay
from discover.report.parts import Missing, attempt
from discover.report.plots.comparison.flows import flow_picture, start_up_picture, training_picture
from discover.report.plots.comparison.pipkin import error_map_picture
from discover.report.plots.comparison.selection import selection_picture
from discover.report.plots.comparison.studies import (
    high_deborah_picture,
    loss_picture,
    sweep_picture,
)
from discover.report.plots.residual_map import comparison_residual_map
from discover.report.plots.style import Picture

Drawn = Picture | Missing


def comparison_pictures(
    comparison: Comparison, overlays: Sequence[Overlay]
) -> tuple[list[Drawn], list[Drawn]]:
    """Return the pictures of what was found, and those of training."""
    sparse = comparison.outcomes.get("tensor_sindy")
    details = {} if sparse is None else sparse.details
    found: list[tuple[str, Callable[[], Picture | None]]] = []
    for flow in comparison.judged:
        draw = flow_picture if flow.oscillatory else start_up_picture
        found.append((f"The picture of {flow.title}", partial(draw, comparison, flow, overlays)))
    runs = ("The picture of the training runs", partial(training_picture, comparison))
    if not comparison.judged:  # what was fitted is then all that shows a law at work
        found.append(runs)
    found += [
        ("The map of errors", partial(error_map_picture, comparison)),
        ("The map of residuals", partial(comparison_residual_map, comparison)),
        ("The picture of the selection", partial(selection_picture, details)),
        ("The picture of high Deborah numbers", partial(high_deborah_picture, comparison)),
        ("The picture of the sweep", partial(sweep_picture, comparison)),
    ]
    loss = ("The picture of the loss", partial(loss_picture, comparison))
    return _drawn(found), _drawn([runs, loss] if comparison.judged else [loss])


def _drawn(pictures: Sequence[tuple[str, Callable[[], Picture | None]]]) -> list[Drawn]:
    drawn = [attempt(title, draw) for title, draw in pictures]
    return [one for one in drawn if one is not None]
