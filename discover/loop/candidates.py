"""Which effects are candidates of a closed loop."""

from collections.abc import Callable, Sequence

import numpy as np

from discover.dataset import Run
from discover.effects import (
    AbstractEffect,
    ConstitutiveEffect,
    KinematicEffect,
    library_effects,
    make_effect,
    named_effects,
)
from discover.errors import InputError
from discover.forward import DeclaredModel

EXTRAPOLATION = 10.0
"""Ratio of held-out to fitted shear rates beyond which a law must stay well-posed."""


def candidates_of(effects: Sequence[str | AbstractEffect] | str | None) -> list[AbstractEffect]:
    """Return the effects that are asked for.

    Parameters
    ----------
    effects
        Names, spellings of library terms or objects; ``"named"`` for every effect with a name that
        is no candidate on request alone; None for these and every library term up to one invariant.

    Raises
    ------
    InputError
        If there is none, one is given twice, or a name is unknown.
    """
    named = [effect for effect in named_effects().values() if not effect.on_request]
    if effects is None:
        return [*named, *library_effects()]
    if effects == "named":
        return named
    if isinstance(effects, str):
        raise InputError(
            f'effects must be a list of names, or "named" for every effect with a name; got '
            f"{effects!r}. Write [{effects!r}] for this one alone."
        )
    if not effects:
        raise InputError("The loop needs at least one candidate effect; got none.")
    made = [make_effect(effect) if isinstance(effect, str) else effect for effect in effects]
    names = [effect.name for effect in made]
    repeated = [name for name in names if names.count(name) > 1]
    if repeated:
        raise InputError(f"The effect {repeated[0]!r} is given twice.")
    return made


def admission(fitted: Sequence[Run], held: Sequence[Run]) -> Callable[[AbstractEffect], bool]:
    """Return which effects are candidates, given the rates.

    Terms that name the rate are none where the loop must extrapolate far in it; what shapes a
    command is none where the rate was measured. Rates are set, or measured, apart from the stress,
    so this looks at no held-out stress.
    """
    measured = any(run.rate_is_measured for run in fitted)
    fastest = max(float(np.max(np.abs(run.rate))) for run in fitted)
    asked = max((float(np.max(np.abs(run.rate))) for run in held), default=0.0)
    far = asked > EXTRAPOLATION * fastest

    def admitted(effect: AbstractEffect) -> bool:
        if isinstance(effect, KinematicEffect):
            return not (measured and effect.shapes_command)
        return not (far and isinstance(effect, ConstitutiveEffect) and effect.explicit_rate)

    return admitted


def _require_possible(declared: DeclaredModel, runs: Sequence[Run]) -> None:
    """Refuse a known effect that the rates of these runs contain already."""
    measured = [run.name for run in runs if run.rate_is_measured]
    for known in declared.effects:
        if measured and isinstance(known.effect, KinematicEffect) and known.effect.shapes_command:
            raise InputError(
                f"The known effect {known.name} lies between the command and the tool, and the "
                f"rate of {measured[0]} was measured at the tool, so it contains it already. Leave "
                "the effect out."
            )


def _require_present(declared: DeclaredModel, present: set[str]) -> None:
    """Refuse an effect by mode that is neither declared nor a candidate."""
    free = {parameter.name for parameter in declared.free_parameters}
    absent = [name for name in declared.by_mode if name not in free and name not in present]
    if absent:
        raise InputError(
            f"by_mode names the effect {absent[0]}, which is neither declared nor a candidate. Add "
            "it to [model] effects or to [loop] effects, or take it out of by_mode."
        )


def candidates_beside(
    declared: DeclaredModel,
    effects: Sequence[str | AbstractEffect] | str | None,
    runs: Sequence[Run],
) -> list[AbstractEffect]:
    """Return the effects that are asked for and that the declared model does not know.

    Parameters
    ----------
    effects
        As `candidates_of` takes them.
    runs
        Those that are fitted and those that judge.

    Raises
    ------
    InputError
        If they are not as `candidates_of` takes them, an effect by mode is neither declared nor
        among them, or the rates of the runs contain a known effect already.
    """
    candidates = candidates_of(effects)
    known = {effect.name for effect in declared.effects}
    _require_present(declared, {*known, *(effect.name for effect in candidates)})
    _require_possible(declared, runs)
    return [effect for effect in candidates if effect.name not in known]
