"""The dictionary of effects that a model may lack."""

from discover.effects.base import (
    AbstractEffect,
    ConstitutiveEffect,
    EffectParameter,
    KinematicEffect,
    ModeEffect,
    Record,
    SeriesElement,
    SignalEffect,
    StateEffect,
)
from discover.effects.library_term import LibraryTerm, library_effects, library_term
from discover.effects.registry import make_effect, named_effects

__all__ = [
    "AbstractEffect",
    "ConstitutiveEffect",
    "EffectParameter",
    "KinematicEffect",
    "LibraryTerm",
    "ModeEffect",
    "Record",
    "SeriesElement",
    "SignalEffect",
    "StateEffect",
    "library_effects",
    "library_term",
    "make_effect",
    "named_effects",
]
