"""Fit a free function inside the model: how fast the fluid relaxes, slips, or loses a structure.

Where named effects leave structure, what is missing may be a rate of relaxation that depends on the
stress or on the rate of deformation, slip that depends on the stress, or the breakdown of a
structure that depends on the rate, as no candidate does. It is a spline that acts in every step of
the integration (`discover.effects.free_function`), fitted together with the constants of a law and
held against what was found by the criterion of the search.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np

from discover.closed_loop.judging.before_after import strain_of
from discover.closed_loop.results.error_pair import ErrorPair
from discover.closed_loop.results.free_curve import FreeForm, Slot, drawn_form, error_of
from discover.closed_loop.runs import all_at_a_rate_in_shear
from discover.closed_loop.search import Search
from discover.dataset import Run
from discover.effects import ConstitutiveEffect
from discover.effects.free_function import (
    FREE_BREAKDOWN,
    FREE_RELAXATIONS,
    FREE_SLIP,
    INTERVALS,
    ONSET,
    FreeBreakdown,
    FreeRelaxation,
    FreeSlip,
    spline_basis,
)
from discover.forward import AugmentedModel, Batch, data_scales
from discover.inference.evidence import INDISTINGUISHABLE, criterion
from discover.inference.fit_uncertainty import covariance_and_noise
from discover.inference.least_squares import Fit, fit_batch
from discover.statistics.residual import judged_cost, summarise

_VALUES = 2 * (INTERVALS + 1)
"""Rates from which on there is a function of the rate; between fewer it says nothing."""

_DISTINCT = 3
"""Decimals to which rates over the largest are told apart."""

_HARDLY = 4.0
"""A change of the records by fewer squared standard deviations of the noise is not seen in them."""

_HALVINGS, _DRAWN = 12, 60

_BROKEN = 0.02
"""Breakdown of a structure per strain, to begin with."""

_BESIDE = 4
"""Effects of the fluid that did best alone, beside each of which a curve is fitted."""


@dataclass(frozen=True)
class _Curve:
    """A free function, the largest value of its variable, and the value at which it sets in."""

    effect: FreeRelaxation | FreeSlip | FreeBreakdown
    largest: float

    @property
    def slot(self) -> Slot:
        if isinstance(self.effect, FreeRelaxation):
            return "relaxation"
        return "slip" if isinstance(self.effect, FreeSlip) else "breakdown"

    @property
    def unit(self) -> str:
        return {"relaxation": "", "slip": "Pa", "breakdown": "1/s"}[self.slot]

    @property
    def onset(self) -> float:
        return ONSET if self.slot == "relaxation" else ONSET * self.largest

    def place(self, x: float) -> float:
        """Return where a value lies among the knots, from 0 to their number."""
        return INTERVALS * float(np.log1p(x / self.onset) / np.log1p(self.largest / self.onset))

    def value(self, place: float) -> float:
        """Return the value that lies there."""
        whole = np.log1p(self.largest / self.onset)
        return float(self.onset * np.expm1(place / INTERVALS * whole))


def free_functions_in_model(
    search: Search, runs: Sequence[Run], held_batch: Batch | None
) -> tuple[FreeForm, ...]:
    """Return the free functions of fluid and slip that explain what a search left.

    Each is fitted beside the declared model and beside the effects of the instrument that were
    found; beside these with each of the fluid's effects that did best alone (`_BESIDE`), since what
    was found together may stand for the function; and beside all that was found, all but one and
    one alone. Kept are those with strong evidence over what was found (`INDISTINGUISHABLE`), one of
    each variable, the most probable first.

    Parameters
    ----------
    search
        A search that has ended, and left structure or missed the runs that judge.
    runs
        The fitted runs; none but starts from rest in shear at a given rate.
    held_batch
        Runs that judge.
    """
    if not all_at_a_rate_in_shear(runs) or search.degrees:
        return ()
    curves = _curves(search, runs)
    beside = _sets(search)
    names = {name for one, _ in beside for name in one}
    effects = [e for e in search.model.effects if e.name in names]
    asked = [*effects, *(curve.effect for curve in curves)]
    model = AugmentedModel(search.model.declared, asked, data_scales(runs), search.batch)
    trials = [(curve, one) for one, _ in beside for curve in curves]
    if not trials:
        return ()
    starts, free = zip(
        *(_start(search, model, curve, *one) for one in beside for curve in curves), strict=True
    )
    fits = fit_batch(model, search.batch, starts, free)
    usable = [(fit, *trial) for fit, trial in zip(fits, trials, strict=True) if fit.usable]
    if not usable:
        return ()
    weight = np.asarray(search.batch.weight)
    best = min((fit for fit, *_ in usable), key=lambda fit: fit.cost)
    effective = summarise(best.residual, weight).effective_samples

    def criterion_of(fit: Fit, effects: int) -> float:
        cost, choices = judged_cost(fit.residual, weight), search.n_candidates + len(curves)
        return criterion(cost, len(fit.free), effects, effective, choices)

    before = criterion_of(search.fit, len(search.active))
    gains = [(before - criterion_of(one[0], 1 + len(one[2])), *one) for one in usable]
    kept: dict[str, FreeForm] = {}
    for gain, fit, curve, beside in sorted(gains, key=lambda one: -one[0]):
        if gain >= INDISTINGUISHABLE and curve.effect.name not in kept:
            held = None
            if held_batch is not None:
                held = error_of(model.residuals([fit.theta], held_batch)[0])
            kept[curve.effect.name] = _form(search, model, fit, curve, beside, gain, held)
    return tuple(kept.values())


def _sets(search: Search) -> list[tuple[tuple[str, ...], np.ndarray]]:
    """Return the sets of effects beside which a curve is fitted, each with parameters to begin.

    A set may stand twice: an effect that stood for the curve is elsewhere when it is fitted alone
    than among others.
    """
    fluids = {e.name for e in search.model.effects if isinstance(e, ConstitutiveEffect)}
    found = search.path[len(search.active)]
    of_instrument = tuple(name for name in search.active if name not in fluids)
    of_fluid = tuple(name for name in search.active if name in fluids)
    sets: list[tuple[tuple[str, ...], np.ndarray]] = [((), search.path[0])]
    if of_instrument:
        sets.append((of_instrument, found))
    alone = [
        one for one in search.seen
        if len(one.effects) == 1 and set(one.effects) <= fluids - set(search.refused)
    ]  # fmt: skip
    for one in sorted(alone, key=lambda one: one.cost)[:_BESIDE]:
        theta = one.theta(search.model)
        for name in of_instrument:
            theta[search.model.slices[name]] = found[search.model.slices[name]]
        sets.append(((*one.effects, *of_instrument), theta))
    kept = [(name,) for name in of_fluid]
    kept += [tuple(other for other in of_fluid if other != name) for name in of_fluid]
    every = dict.fromkeys((*one, *of_instrument) for one in [*kept, of_fluid] if one)
    return [*sets, *((one, found) for one in every)]


def _curves(search: Search, runs: Sequence[Run]) -> list[_Curve]:
    """Return the functions that the runs can tell of."""
    slowest = float(np.max(search.model.declared.relaxation_time))
    rates = np.concatenate([np.abs(run.rate) for run in runs])
    fastest = float(np.max(rates))
    if fastest == 0.0:
        return []
    weissenberg = slowest * fastest
    strain = max(float(np.nanmax(np.abs(strain_of(run)))) for run in runs)
    # upper convected Maxwell: 2 Wi² in steady flow, γ² before that; real fluids stay below
    largest = {"trace of the stress": min(2.0 * weissenberg**2, strain**2)}
    largest["stress"] = max(float(np.max(np.abs(run.stress))) for run in runs)
    if np.unique(np.round(rates / fastest, _DISTINCT)).size >= _VALUES:
        largest |= {"rate of deformation": weissenberg, "shear rate": fastest}
    every = (*FREE_RELAXATIONS, FREE_SLIP, FREE_BREAKDOWN)
    return [_Curve(e, largest[e.variable]) for e in every if e.variable in largest]


def _start(
    search: Search,
    model: AugmentedModel,
    curve: _Curve,
    beside: Sequence[str],
    known: np.ndarray,
) -> tuple[np.ndarray, list[int]]:
    """Return the parameters from which a curve is fitted beside some effects, and the free ones."""
    theta = model.zero()
    # what is declared stands first, in both models
    own = min(at.start for at in search.model.slices.values())
    theta[:own] = known[:own]
    theta[model.instants] = known[search.model.instants]
    free = list(model.free_positions)
    for name in beside:
        theta[model.slices[name]] = known[search.model.slices[name]]
        free += model.positions(name)
    switch, largest, end, *coefficients = model.positions(curve.effect.name)
    theta[[switch, largest, end]] = 1.0, curve.largest, curve.largest
    theta[coefficients] = 0.0
    if curve.slot == "breakdown":
        # where nothing breaks, the time in which it is built up has no say
        *spline, build_up = coefficients
        theta[spline] = _BROKEN * curve.largest / INTERVALS * np.arange(1.0, INTERVALS + 2.0)
        theta[build_up] = model.first_trial[build_up]
    return theta, [*free, *coefficients]


def _form(
    search: Search,
    model: AugmentedModel,
    fit: Fit,
    curve: _Curve,
    beside: Sequence[str],
    gain: float,
    held: float | None,
) -> FreeForm:
    """Return a free function as the result holds it, as far as the runs tell of it."""
    *_, end, first = model.positions(curve.effect.name)[:4]
    reach = _reach(search, model, fit, curve, end)
    spline = range(first, first + INTERVALS + 1)
    rows = [row for row, position in enumerate(fit.free) if position in spline]
    # a spline that begins beyond has no say, and no variance
    count = min(int(np.ceil(curve.place(reach))) + 1, len(rows))
    seen = [row for row in range(len(fit.free)) if row not in rows[count:]]
    covariance, _ = covariance_and_noise(search.batch, fit.residual, fit.jacobian[seen])
    own = [seen.index(row) for row in rows[:count]]
    grid = np.linspace(0.0, reach, _DRAWN)
    basis = np.asarray(spline_basis(jnp.asarray(grid), curve.largest, curve.onset))[:, :count]
    return drawn_form(
        curve.slot,
        (curve.effect.variable, curve.unit),
        beside,
        grid,
        basis,
        fit.theta[[fit.free[row] for row in rows[:count]]],
        covariance[np.ix_(own, own)],
        gain,
        search.tolerated.left(fit.residual).verdict != "unexplained",
        ErrorPair(float(np.mean(fit.run_errors)), held),
    )


def _reach(search: Search, model: AugmentedModel, fit: Fit, curve: _Curve, end: int) -> float:
    """Return the value from which on the curve might as well be flat, by bisection."""
    weight = np.asarray(search.batch.weight)
    noise = fit.cost / summarise(fit.residual, weight).effective_samples
    low, high = 0.0, float(INTERVALS)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        theta = fit.theta.copy()
        theta[end] = curve.value(middle)
        change = model.residuals([theta], search.batch)[0] - fit.residual
        seen = not np.sum(change**2) < _HARDLY * noise  # nor is what runs away
        low, high = (middle, high) if seen else (low, middle)
    return curve.value(high)
