"""Comparisons that try few effects, where what they find is not what is asked."""

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


def verdict_alone(patch: pytest.MonkeyPatch) -> None:
    """Leave out what follows from a verdict: a next test, errors elsewhere, twins and physics."""
    from discover.inference.engine.design import NextTests

    patch.setattr("discover.loop.from_posterior.design", lambda *_: NextTests())
    patch.setattr("discover.loop.from_posterior.spread_of_laws", lambda *_: {})
    patch.setattr("discover.comparison.run_comparison.exact_twins", lambda *_: [])
    patch.setattr("discover.comparison.learning.physics_of", lambda *_: {"checks": []})
