"""Fit a free function of one variable together with the constants of a law.

Where named effects leave structure, what is missing may be a function that nobody wrote down: of
the recorded stress (a transducer that saturates), of the time (a drift), of the rate (friction of
the tool), of the strain (a sample that is lost), of where the tool stands (a bearing, a cone that
wobbles) or in its cycle. It is a cubic spline of few degrees of freedom, held against what was
found by the criterion of the search.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from sklearn.preprocessing import SplineTransformer

from discover.closed_loop.beyond.free_variables import PLACES, Variables, columns, spline
from discover.closed_loop.results.error_pair import ErrorPair
from discover.closed_loop.results.free_curve import FreeForm, Slot, drawn_form, error_of
from discover.closed_loop.runs import all_at_a_rate_in_shear
from discover.closed_loop.search import Search
from discover.dataset import Run
from discover.forward import Batch
from discover.inference.evidence import INDISTINGUISHABLE, WINDOW, criterion
from discover.inference.fit_uncertainty import covariance_and_noise
from discover.inference.least_squares import gauss_newton_step, room_of
from discover.statistics.residual import judged_cost, summarise

KNOTS = (6, 14)
"""Of the spline, which then has two degrees of freedom more; evidence chooses."""

_STEPS, _HALVINGS, _SETTLED = 12, 4, 1e-4
_DAMPING = 1e-8
_DRAWN = 60
_REFITTED = 8
_VALUES = 2  # of the variable, for each degree of freedom


@dataclass
class _Trial:
    """A free function beside some effects, fitted."""

    slot: Slot
    effects: tuple[str, ...]
    theta: np.ndarray
    free: tuple[int, ...]
    splines: SplineTransformer
    coefficients: np.ndarray
    residual: np.ndarray
    design: np.ndarray

    def cost(self, weight: np.ndarray) -> float:
        return judged_cost(self.residual, weight)


def free_forms(
    search: Search,
    runs: Sequence[Run],
    held_batch: Batch | None,
    held_runs: Sequence[Run],
) -> tuple[FreeForm, ...]:
    """Return the free functions that explain what a search left, the most probable first.

    Each is fitted beside the declared model, beside every stage of what was found, and beside every
    effect that was tried alone, for what was found may stand for the function. All are fitted to
    the end with few knots, since an effect that stood for the function itself is far from where it
    ends beside it; the best again with more. Kept are those with strong evidence over what was
    found (`INDISTINGUISHABLE`) that are within reach of the best.

    Parameters
    ----------
    search
        A search that has ended and left structure.
    runs
        The fitted runs; none but starts from rest in shear at a given rate.
    held_batch, held_runs
        Runs that judge.
    """
    if not all_at_a_rate_in_shear([*runs, *held_runs]):
        return ()
    weight = np.asarray(search.batch.weight)
    starts = {
        tuple(search.active[:n]): theta
        for n, theta in enumerate(search.path[: len(search.active) + 1])
    }
    for one in search.seen:
        if len(one.effects) == 1 and not search.refused & set(one.effects):
            starts.setdefault(one.effects, one.theta(search.model))
    few, more = KNOTS
    variables = Variables(runs, weight.shape[1])
    trials = [
        trial
        for effects, theta in starts.items()
        for slot in variables.slots
        if (trial := _fitted(search, variables, slot, effects, theta, few)) is not None
    ]
    if not trials:
        return ()
    trials = sorted(trials, key=lambda trial: trial.cost(weight))[:_REFITTED]
    trials += [
        trial
        for one in trials
        if (trial := _fitted(search, variables, one.slot, one.effects, one.theta, more)) is not None
    ]
    best = min(trials, key=lambda trial: trial.cost(weight))
    effective = summarise(best.residual, weight).effective_samples
    choices = search.n_candidates + len(PLACES)
    own = judged_cost(search.fit.residual, weight)
    before = criterion(own, len(search.fit.free), len(search.active), effective, choices)
    gains = [
        before - criterion(t.cost(weight), len(t.design), len(t.effects) + 1, effective, choices)
        for t in trials
    ]
    least = max(INDISTINGUISHABLE, max(gains) - 2.0 * np.log(WINDOW))
    ranked = sorted(zip(gains, trials, strict=True), key=lambda pair: -pair[0])
    out: list[FreeForm] = []
    for gain, trial in ranked:
        if gain >= least and trial.slot not in [one.slot for one in out]:
            held = _held_out_error(search, trial, held_batch, held_runs)
            with_more_knots = max(
                (t for t in trials if (t.slot, t.effects) == (trial.slot, trial.effects)),
                key=lambda t: len(t.coefficients),
            )
            out.append(_free_form_of(search, variables, trial, with_more_knots, gain, held))
    return tuple(out)


def _fitted(
    search: Search, variables: Variables, slot: Slot, effects, start: np.ndarray, knots: int
) -> _Trial | None:
    """Return a free function beside some effects, fitted with them; None where that fails."""
    model, batch = search.model, search.batch
    weight, recorded = np.asarray(batch.weight), np.asarray(batch.recorded)
    seen = weight > 0
    scale = np.where(seen, weight, 1.0)
    free = tuple(search.positions(effects))
    theta, at = start.copy(), list(free)
    residual, slopes, _ = model.linearise(theta, batch, free)
    if not np.all(np.isfinite(residual)):
        return None
    # of a few rates any function is one, and says nothing between them
    values = variables.at(slot, recorded)[seen]
    if np.unique(values[np.isfinite(values)]).size < _VALUES * (knots + 2):
        return None

    def completed(residual):
        """Return the best spline at a law, what is then left, and what it changes."""
        predicted = np.where(seen, residual / scale + recorded, 0.0)
        values = variables.at(slot, predicted)
        splines = spline(slot, knots, values[seen])
        changed = columns(slot, splines, values, predicted) * weight[..., None]
        coefficients = gauss_newton_step(changed[seen].T, residual[seen], _DAMPING)
        return (splines, coefficients), residual + changed @ coefficients, changed

    best, left, changed = completed(residual)
    for _ in range(_STEPS):
        if not free:
            break
        if not np.all(np.isfinite(slopes)):
            return None
        rows = np.concatenate([slopes, np.moveaxis(changed, -1, 0)])
        room = np.full((2, len(rows)), [[-np.inf], [np.inf]])  # a function has no bounds
        room[:, : len(free)] = room_of(model, theta, free)
        step = gauss_newton_step(rows, left, _DAMPING, room=room)[: len(free)]
        before = float(np.sum(left**2))
        for halving in range(_HALVINGS):
            trial = theta.copy()
            moved = theta[at] + step * 0.5**halving
            trial[at] = np.clip(moved, model.low[at], model.high[at])
            tried = model.linearise(trial, batch, free)
            if not np.all(np.isfinite(tried.residual)):
                continue
            found = completed(tried.residual)
            if np.sum(found[1] ** 2) < before:
                theta, (residual, slopes, _), (best, left, changed) = trial, tried, found
                break
        else:
            break
        if 1.0 - float(np.sum(left**2)) / before < _SETTLED:
            break
    design = np.concatenate([slopes, np.moveaxis(changed, -1, 0)])
    if not np.all(np.isfinite(design)):
        return None
    return _Trial(slot, tuple(effects), theta, free, *best, left, design)


def _free_form_of(
    search: Search,
    variables: Variables,
    trial: _Trial,
    with_more_knots: _Trial,
    gain: float,
    held: float | None,
) -> FreeForm:
    """Return a free function as the result holds it.

    The knots that evidence chooses may be too few to bend as the function does, by less than the
    noise shows but by more than their own band. So the band holds that of more knots too
    [undersmoothing: Hall 1992, Ann. Stat. 20, 675].
    """
    seen = np.asarray(search.batch.weight) > 0
    predicted = np.where(seen, search.model.predict(trial.theta, search.batch), 0.0)
    span = variables.at(trial.slot, predicted)[seen]
    grid = np.linspace(float(np.nanmin(span)), float(np.nanmax(span)), _DRAWN)
    found, wider = (_drawn(search, one, grid, gain, held) for one in (trial, with_more_knots))
    return replace(
        found,
        low95=np.minimum(found.low95, wider.low95),
        high95=np.maximum(found.high95, wider.high95),
    )


def _drawn(
    search: Search, trial: _Trial, grid: np.ndarray, gain: float, held: float | None
) -> FreeForm:
    covariance, _ = covariance_and_noise(search.batch, trial.residual, trial.design)
    return drawn_form(
        trial.slot,
        (PLACES[trial.slot].variable, PLACES[trial.slot].unit),
        trial.effects,
        grid,
        trial.splines.transform(grid.reshape(-1, 1)),
        trial.coefficients,
        covariance[len(trial.free) :, len(trial.free) :],
        gain,
        search.tolerated.left(trial.residual).verdict != "unexplained",
        ErrorPair(error_of(trial.residual), held),
    )


def _held_out_error(search: Search, trial: _Trial, batch: Batch | None, runs) -> float | None:
    """Return the mean error of the runs held out, beyond whose ends the curve goes on straight."""
    if batch is None:
        return None
    weight, recorded = np.asarray(batch.weight), np.asarray(batch.recorded)
    residual = search.model.residuals([trial.theta], batch)[0]
    if not np.all(np.isfinite(residual)):
        return np.inf  # the law beside the curve runs away
    seen = weight > 0
    predicted = np.where(seen, residual / np.where(seen, weight, 1.0) + recorded, 0.0)
    values = Variables(runs, weight.shape[1]).at(trial.slot, predicted)
    changed = columns(trial.slot, trial.splines, values, predicted) * weight[..., None]
    return error_of(residual + changed @ trial.coefficients)
