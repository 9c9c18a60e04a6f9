"""Coefficient functions: raced tensor by tensor, taken along given ones, or varying least."""

from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from discover.laws.tensor_basis_network import N_COEFFICIENTS, TensorBasisNetwork
from discover.learners.tbnn_ude.initial_law import with_tensors
from discover.learners.tbnn_ude.prior import least_variation
from discover.learners.tbnn_ude.session import PRIOR_SHARE, START_STEPS, Session

_POLISHED = 2
_CLOSE = 1.5  # what lies further behind the best of a race is not polished
_MORE_ROUNDS = 4  # with the least penalty, while they pay: near laws that run away steps are short
_STILL_GAINS = 0.95  # white or not, a residual that still falls so much holds more than noise


def race_of_functions(
    session: Session, start: TensorBasisNetwork
) -> tuple[TensorBasisNetwork, TensorBasisNetwork]:
    """Return the best law of few tensors with varying coefficients, before and after polish."""
    chosen = np.zeros(N_COEFFICIENTS, bool)
    law, misfit = start, np.inf
    penalised = law
    for _ in range(session.recipe.max_tensors):
        # first the best constant on each tensor: from h = 0 a whole network's first step
        # overshoots; then a race of functions, in which those far behind are given up
        starts = []
        for tensor in np.flatnonzero(~chosen):
            tensors = chosen.copy()
            tensors[tensor] = True
            start = session.round(with_tensors(law, tensors), 0.0, tensors, False, START_STEPS)
            starts.append((session.misfit(start), int(tensor), start, tensors))
        trials, pace = [], None
        for _, tensor, start, tensors in sorted(starts, key=lambda s: s[:2]):
            before = len(session.misfits)
            trial = session.round(start, PRIOR_SHARE, tensors, True, session.recipe.steps, pace)
            trials.append((session.misfit(trial), tensor, trial))
            if min(trials, key=lambda trial: trial[:2])[1] == tensor:
                pace = session.misfits[before:]
        trials.sort(key=lambda trial: trial[:2])
        if not trials[0][0] < misfit:
            break
        tensor, penalised, law = _polished(session, trials, chosen)
        if not session.taken:
            session.passed_over = [t for _, t, _ in trials if t != tensor]
        session.taken.append(tensor)
        chosen[tensor] = True
        misfit = session.misfit(law)
        if misfit < session.recipe.resolved or session.settled(law):
            break
    return penalised, law


def _polished(
    session: Session, trials: Sequence[tuple[float, int, TensorBasisNetwork]], chosen: np.ndarray
) -> tuple[int, TensorBasisNetwork, TensorBasisNetwork]:
    """Return the tensor that does best in the end, and its law before and after polish.

    The race says little of what a few more steps make of the next ones: before a second tensor
    is asked for, the first has to be the right one.
    """
    ends = []
    for reached, tensor, trial in trials[:_POLISHED]:
        if reached > _CLOSE * trials[0][0]:
            break
        tensors = chosen.copy()
        tensors[tensor] = True
        law = trial if session.settled(trial) else session.polish(trial, reached, tensors)
        ends.append((session.misfit(law), tensor, trial, law))
        if ends[-1][0] < session.recipe.resolved or session.settled(law):
            return tensor, trial, law
    _, tensor, trial, law = min(ends, key=lambda end: end[:2])
    return tensor, trial, law


def nearly_constant_functions(
    session: Session, start: TensorBasisNetwork, constants: Float[Array, "8"]
) -> list[TensorBasisNetwork]:
    """Return laws whose coefficients vary as little as the residual allows, the last the best.

    Those before it are held to less variation still.
    """
    everything = np.ones(N_COEFFICIENTS, bool)
    law = with_tensors(start, everything)
    law = eqx.tree_at(lambda tree: tree.constants, law, constants)
    found = []
    before = np.inf
    variations = session.recipe.variations
    for number, strength in enumerate([*variations, *_MORE_ROUNDS * variations[-1:]]):
        prior = least_variation(jnp.asarray(strength))
        law = session.round(law, strength, everything, True, session.recipe.steps, prior=prior)
        misfit = session.misfit(law)
        if misfit < before:  # the same law twice is no second opinion
            found.append(law)
        settled, gains = session.settled(law), misfit <= _STILL_GAINS * before
        through = number + 1 >= len(variations)
        if (settled and not gains) or (through and (settled or not gains)):
            break
        before = misfit
    return found


def functions_along(
    session: Session, start: TensorBasisNetwork, groups: Sequence[Sequence[int]]
) -> tuple[TensorBasisNetwork, TensorBasisNetwork]:
    """Return a law that takes tensors group by group, without a race, as far as that pays."""
    chosen = np.zeros(N_COEFFICIENTS, bool)
    law, misfit = start, np.inf
    penalised = law
    for group in groups:
        tensors = chosen.copy()
        tensors[list(group)] = True
        trial = session.round(with_tensors(law, tensors), 0.0, tensors, False, START_STEPS)
        trial = session.round(trial, PRIOR_SHARE, tensors, True, session.recipe.steps)
        polished, reached = trial, session.misfit(trial)
        if not session.settled(trial):
            polished = session.polish(trial, reached, tensors)
        if session.misfit(polished) < misfit:
            chosen, law, penalised, misfit = tensors, polished, trial, session.misfit(polished)
            session.taken = [int(t) for t in np.flatnonzero(chosen)]
        if misfit < session.recipe.resolved or session.settled(law):
            break
    return penalised, law
