"""When rates step that were read in samples: fitted along, for their samples do not tell it."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from discover.dataset import Run
from discover.forward.augmented_model import AugmentedModel
from discover.forward.batches import TransientFlows, make_batch
from discover.forward.declared import DeclaredModel
from discover.inference.least_squares import gauss_newton_step
from discover.protocols.between_samples import steps_between_samples

_MOST = 40
"""Steps whose instants are fitted, at most: each costs a constant."""

_ROUNDS = 6
_WIDTH = 1e-4
_DAMPING = 1e-6


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


def with_own_instants(
    model: AugmentedModel, theta: Float[np.ndarray, " p"], runs: Sequence[Run]
) -> list[Run]:
    """Return runs that no fit saw with the rate stepping when their own stress says.

    The constants stay as they are. A model that cannot be integrated through them leaves the runs
    as they were.
    """
    rows = [i for i, run in enumerate(runs) if any(s.place is None for s in run.rate_steps)]
    if not rows:
        return list(runs)
    # a factor on the whole record dates no step
    batch = make_batch([replace(runs[i], loading=None) for i in rows])
    (flows,) = batch.parts
    assert isinstance(flows, TransientFlows)  # only a given rate steps
    assert flows.steps is not None
    sources = np.unique([runs[i].source for i in rows], return_inverse=True)[1]
    free = np.asarray(flows.steps.place) < 0
    share = np.array(flows.steps.share)

    def residual(share: np.ndarray) -> np.ndarray:
        moved = eqx.tree_at(lambda b: b.parts[0].steps.share, batch, jnp.asarray(share))
        return model.residuals([theta], moved)[0]

    left = residual(share)
    if not np.all(np.isfinite(left)):
        return list(runs)
    for _ in range(_ROUNDS):
        columns = np.zeros((share.shape[1], *left.shape))
        for k in range(share.shape[1]):
            moved, width = share.copy(), np.where(share[:, k] > 0.5, -_WIDTH, _WIDTH)
            moved[:, k] += width
            columns[k] = (residual(moved) - left) / width[:, None]
        trial = share.copy()
        for source in np.unique(sources):
            own = sources == source
            at = np.flatnonzero(free[own][0])
            begun = share[np.ix_(own, at)]
            room = (-begun[0], 1.0 - begun[0])
            step = gauss_newton_step(columns[np.ix_(at, own)], left[own], _DAMPING, room=room)
            trial[np.ix_(own, at)] = np.clip(begun + step, 0.0, 1.0)
        after = residual(trial)
        # a run's own record speaks of its own instants alone
        better = np.array(
            [np.sum(after[sources == s] ** 2) < np.sum(left[sources == s] ** 2) for s in sources]
        )
        if not np.any(better):
            break
        share, left = (
            np.where(better[:, None], trial, share),
            np.where(better[:, None], after, left),
        )
    found = list(runs)
    for i, own in zip(rows, share, strict=True):
        steps = zip(runs[i].rate_steps, own, strict=False)  # rows are padded
        found[i] = replace(
            runs[i], rate_steps=tuple(replace(step, share=float(at)) for step, at in steps)
        )
    return found


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
