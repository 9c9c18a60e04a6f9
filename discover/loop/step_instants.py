"""When rates step that were read in samples: fitted along, for their samples do not tell it."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Float

from discover.dataset import Run
from discover.forward.augmented_model import AugmentedModel
from discover.forward.declared import DeclaredModel
from discover.protocols.between_samples import steps_between_samples

_MOST = 40
"""Steps whose instants are fitted, at most: each costs a constant."""


def with_rate_steps(run: Run) -> Run:
    """Return a run that names the steps of its rate whose instants its samples do not tell."""
    return replace(run, rate_steps=steps_between_samples(run.protocol, run.time, run.rate))


def with_places(
    declared: DeclaredModel, fitted: Sequence[Run], held_out: Sequence[Run]
) -> tuple[DeclaredModel, list[Run], list[Run]]:
    """Return the declared model and the runs with a place for the instant of each fitted step.

    Of more than `_MOST` those with the largest change of strain are fitted, and a straight line
    stands for each of the others. What else a fitted run recorded shares its instants.
    """
    largest: dict[tuple[str, float], float] = {}
    for run in fitted:
        for step in run.rate_steps:
            if step.start < run.time[-1]:
                size = abs(step.change) * (step.end - step.start)
                largest[run.source, step.start] = size
    kept = sorted(largest, key=lambda key: -largest[key])[:_MOST]
    places = {key: place for place, key in enumerate(key for key in largest if key in kept)}

    def placed(run: Run, is_fitted: bool) -> Run:
        steps = (
            replace(step, place=places.get((run.source, step.start)))
            for step in run.rate_steps
            if not is_fitted or (run.source, step.start) in places
        )
        return replace(run, rate_steps=tuple(steps))

    return (
        replace(declared, step_instants=len(places)),
        [placed(run, True) for run in fitted],
        [placed(run, False) for run in held_out],
    )


def instants_found(
    model: AugmentedModel,
    theta: Float[np.ndarray, " p"],
    bounds: Mapping[int, tuple[float, float]],
    runs: Sequence[Run],
    held_out: Sequence[Run],
) -> dict[str, list[dict[str, Any]]]:
    """Return the instants as JSON-able values, by name of the run."""
    found: dict[str, list[dict[str, Any]]] = {}
    for run in (*runs, *held_out):
        for step in run.rate_steps:
            share, ci95 = step.share, None
            if step.place is not None:
                at = model.instants.start + step.place
                share = float(theta[at])
                ci95 = [step.at(end) for end in bounds[at]] if at in bounds else None
            line = {"between_s": [step.start, step.end], "instant_s": step.at(share), "ci95": ci95}
            found.setdefault(run.source, []).append(line)
    return found
