"""Comparisons that try few effects, where what they find is not what is asked."""

from collections.abc import Sequence

import pytest

from discover.effects import named_effects

FEW = (
    "giesekus_mobility", "ptt_linear", "ptt_exponential", "non_affine_motion", "stress_gain",
    "rate_gain", "stress_offset", "transducer_lag",
)  # fmt: skip


def few_candidates(patch: pytest.MonkeyPatch, names: Sequence[str] = FEW) -> None:
    """Let a search try some effects beside the terms of the library: each is a fit of its own."""
    effects = {name: effect for name, effect in named_effects().items() if name in names}
    patch.setattr("discover.comparison.hypotheses.named_effects", lambda: effects)
