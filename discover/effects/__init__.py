"""The dictionary of effects that a model may lack."""

from discover.effects.base import (
    AbstractEffect,
    ConstitutiveEffect,
    EffectParameter,
    KinematicEffect,
    ModeEffect,
    RadialAverage,
    Record,
    SeriesElement,
    SignalEffect,
    StateEffect,
    WrittenState,
)
from discover.effects.library_term import LibraryTerm, library_effects, library_term, simplest_terms
from discover.effects.registry import (
    KnownEffect,
    built_in_effects,
    effects_table,
    known_effects,
    make_effect,
    named_effects,
)
from discover.first_use import answer_calls  # first: it sets double precision

__all__ = [
    "AbstractEffect", "ConstitutiveEffect", "EffectParameter", "KinematicEffect", "KnownEffect",
    "LibraryTerm", "ModeEffect", "RadialAverage", "Record", "SeriesElement", "SignalEffect",
    "StateEffect", "WrittenState", "built_in_effects", "effects_table", "known_effects",
    "library_effects", "library_term", "make_effect", "named_effects", "simplest_terms",
]  # fmt: skip

answer_calls(__name__, effects_table)
