"""Few effects to try, code of these alone, and pages with quick pictures or none."""

from collections.abc import Sequence

import pytest

FEW = (
    "giesekus_mobility", "ptt_linear", "ptt_exponential", "non_affine_motion", "stress_gain",
    "rate_gain", "stress_offset", "transducer_lag",
)  # fmt: skip


def few_candidates(patch: pytest.MonkeyPatch, names: Sequence[str] = FEW) -> None:
    """Let a search try some effects beside the terms of the library: each is a fit of its own."""
    from discover.effects import named_effects  # the package is imported under a hook

    effects = {name: effect for name, effect in named_effects().items() if name in names}
    patch.setattr("discover.comparison.hypotheses.named_effects", lambda: effects)


def verdict_alone(patch: pytest.MonkeyPatch, *, structure: bool = False) -> None:
    """Leave out what follows from a verdict: a next test, errors elsewhere, twins and physics.

    And what the flows determine, unless its structure is asked for: a program for each layout.
    """
    from discover.inference.design import NextTests

    patch.setattr("discover.loop.loop.design", lambda *_: NextTests())
    patch.setattr("discover.loop.loop.spread_of_laws", lambda *_: {})
    patch.setattr("discover.comparison.run_comparison.exact_twins", lambda *_: [])
    if not structure:
        patch.setattr("discover.comparison.run_comparison.analyse_structure", lambda *_: None)
    patch.setattr("discover.comparison.learning.physics_of", lambda *_: {"checks": []})


def without_pictures(patch: pytest.MonkeyPatch) -> None:
    """Write pages of words alone, but for the picture of constants by mode: drawing takes longer.

    All pictures stand on the pages of `tests/report/test_reports.py` and `test_loop_report.py`.
    """
    from discover.report import loop

    for name in vars(loop):
        if name.endswith(("_picture", "_map")) and name != "by_mode_picture":
            patch.setattr(loop, name, lambda *_: None)
    patch.setattr("discover.report.comparison.report.comparison_pictures", lambda *_: ([], []))


def panels_in_a_grid(patch: pytest.MonkeyPatch) -> None:
    """Let panels stand in a plain grid, though labels meet there: to place them is half of drawing.

    `tests/report/test_plots.py` draws as users see it, and so does a release.
    """
    from matplotlib.figure import Figure

    patch.setattr(
        "discover.report.plots.style.Figure", lambda **how: Figure(**{**how, "layout": None})
    )


ALSO: set[str] = set()
"""Names of effects that code holds beside those that a model asks for."""


def code_of_what_is_asked() -> None:
    """Let code hold the effects that a model asks for, in the same order, and not all there are."""
    from discover.forward.declared import Structure

    whole = Structure.with_every_effect

    def with_these(structure: Structure) -> Structure:
        every, names = whole(structure), {effect.name for effect in structure.effects} | ALSO
        return every._replace(effects=tuple(e for e in every.effects if e.name in names))

    Structure.with_every_effect = with_these
