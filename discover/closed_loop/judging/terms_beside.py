"""What a model leaves of the shape of records, asked of the terms of the library that it lacks.

Where each run is a loading of its own, its level tells nothing of the law, and what another law
leaves of its shape is less than the noise: a test for any pattern sees it once in three times. But
what a term of the library would change is known, sample by sample.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from discover.closed_loop.judging.judgement import Judgement
from discover.closed_loop.judging.tolerated_misfit import ToleratedMisfit
from discover.dataset import Run
from discover.effects import AbstractEffect, simplest_terms
from discover.forward import AugmentedModel, Batch
from discover.statistics.projection import rms, without
from discover.statistics.reading.any_correlation import probability_over_correlations
from discover.statistics.reading.loadings import ADVICE
from discover.statistics.reading.reading_faults import Reading, Session
from discover.statistics.residual import STRUCTURE

_SEEN = 1e-2
"""Of what a term changes, what constants and factors leave of it at least."""

_UNLIKELY = 1e-3
"""Probability that noise follows the terms as well, up to which the model lacks one."""


def judged_beside_terms(
    judgement: Judgement,
    model: AugmentedModel,
    batch: Batch,
    theta: np.ndarray,
    active: Sequence[str],
    runs: Sequence[Run],
    readings: Sequence[Reading],
    tolerated: ToleratedMisfit,
) -> Judgement:
    """Return a judgement that terms of the library which follow the shape of runs refute.

    Parameters
    ----------
    judgement
        Of the final model, whose runs are loadings of their own.
    model, batch, theta, active
        It on the fitted runs, its parameters, and the effects in it.
    runs, readings
        These runs, and as it predicts them.
    tolerated
        What a complete model may leave; a noise that is given may hold anything.
    """
    if not judgement.explains or tolerated.expectation.noise:
        return judgement
    session = Session(readings)
    if not session.is_told or len(session.runs) != len(runs):
        return judgement
    beside = session.columns
    if session.shared is not None:
        beside = np.concatenate([beside, session.shared])
    changes = _of_terms(model, batch, theta, active, runs, session)
    if not np.all(np.isfinite(changes)):
        return judgement
    left, sizes, _ = np.linalg.svd(without(beside.T, changes.T), full_matrices=False)
    own = left[:, sizes > _SEEN]
    taken = rms(own @ (own.T @ without(beside.T, session.residual)))
    if not own.shape[1] or taken <= STRUCTURE * tolerated.resolution.limit(theta, active, taken):
        return judgement
    chance = probability_over_correlations(own, beside.T, session.residual, session.rows)
    if chance > _UNLIKELY:
        return judgement
    reason = (
        "what is left beside the factors of loadings follows terms of the library that the model "
        f"lacks, as noise does once in {1.0 / max(chance, 1e-9):.0f} data sets at most"
    )
    text = f"{judgement.description} But {reason}. So nothing is explained."
    return judgement.refuted(text, reason, ADVICE)


def _of_terms(
    model: AugmentedModel,
    batch: Batch,
    theta: np.ndarray,
    active: Sequence[str],
    runs: Sequence[Run],
    session: Session,
) -> Float[np.ndarray, "terms m"]:
    """Return what each term changes in the samples of a session, each of length one."""
    used = {*active, *(known.name for known in model.declared.effects)}
    effects: list[AbstractEffect] = [one for one in model.effects if one.name in used]
    terms = simplest_terms(beside=used)
    # without the candidates that were not chosen there is little to compile
    asked = AugmentedModel(model.declared, [*effects, *terms])
    values, shared = asked.zero(), model.declared.size
    values[:shared] = theta[:shared]
    values[asked.instants] = theta[model.instants]
    for effect in effects:
        values[asked.positions(effect.name)] = theta[model.positions(effect.name)]
    plain, weight = batch.without_factors(), np.asarray(batch.weight)
    positions = [asked.positions(term.name)[0] for term in terms]
    changes = asked.linearise(values, plain, positions).jacobian
    rows = []
    for i, (run, size) in enumerate(zip(session.runs, session.weights, strict=True)):
        seen = weight[i] > 0
        kept = np.isin(np.asarray(runs[i].time, float)[: np.count_nonzero(seen)], run.times)
        rows.append(size * (changes[:, i, seen] / weight[i, seen])[:, kept])
    found = np.concatenate(rows, axis=1)
    norms = np.linalg.norm(found, axis=1)
    return found[norms > 0.0] / norms[norms > 0.0, None]
