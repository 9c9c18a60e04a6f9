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
from discover.effects.mode_dependence import BY_MODE, ModeDependence
from discover.effects.registry import make_effect, named_effects

__all__ = [
    "BY_MODE",
    "AbstractEffect",
    "ConstitutiveEffect",
    "EffectParameter",
    "KinematicEffect",
    "LibraryTerm",
    "ModeDependence",
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
