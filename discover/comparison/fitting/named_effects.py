"""What has a name and explains the runs: an effect of the fluid, a flaw of the instrument, or both.

A library of laws that are functions of stress and rate holds no structure of the fluid, no chain of
finite length and no flaw of an instrument. Behind one of these its laws fit σ12 with another N1, or
do not fit. So every effect with a name is fitted beside it, alone and in pairs.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product

import numpy as np
from jaxtyping import Float
from scipy.special import ndtri
from scipy.stats import chi2

from discover.comparison.outcomes.flows import DRAWN, QUANTITIES, Flow
from discover.dataset import Run
from discover.effects import AbstractEffect, ConstitutiveEffect, KinematicEffect, named_effects
from discover.forward import AugmentedModel, Batch, data_scales, make_batch
from discover.inference.evidence import WINDOW
from discover.inference.fit_uncertainty import uncertainty
from discover.inference.least_squares import Fit, fit_batch
from discover.inference.modulus_errors import modulus_shifts, response
from discover.inference.problem import FitProblem, effect_of
from discover.inference.step_instants import with_own_instants, with_places, with_rate_steps
from discover.protocols.protocol import recording
from discover.statistics import LackOfFit, root_of
from discover.statistics.projection import rms
from discover.statistics.residual import Expectation
from discover.study.declared_model import DeclaredModel

_STARTS = (1.0, 20.0)
"""Multiples of an effect's first trial, which is the size from which it shows."""

_MOST_STEPS = 40
_LOOKED_AT = 24
"""Sets of the best criterion that are looked at; the others are far behind in any case."""

_AT_THE_END = 1e-3
"""Relative distance from the end of its range at which a constant has stopped there."""

_TAIL = 0.975

_ARITHMETIC = 3e-4
"""Of the rms of σ12 or N1: what two integrators may differ by."""

_BEYOND = 2.0 * float(np.log(WINDOW))
"""Difference of the criterion beyond which what is less probable counts no longer."""

Distribution = tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]
"""Mean and standard deviation in Pa."""


@dataclass(frozen=True)
class NamedExplanation:
    """Effects that leave noise of the fitted runs.

    Attributes
    ----------
    effects
        By name, the fluid's first; none where the declared law alone explains the runs.
    left
        What they leave of the fitted runs.
    criterion
        Twice the negative logarithm of its weight, but for a constant.
    predicted
        By the key of the flow, then of `QUANTITIES`: σ12 as recorded, N1 and N2 of the fluid.
    """

    effects: tuple[str, ...]
    left: LackOfFit
    criterion: float
    predicted: Mapping[str, Mapping[str, Distribution]]


def fit_named_effects(
    model: DeclaredModel,
    fitted: Sequence[Run],
    unseen: Sequence[Run],
    flows: Sequence[Flow],
    expectation: Expectation,
    effects: Sequence[AbstractEffect] | None = None,
) -> tuple[NamedExplanation, ...]:
    """Return the sets of at most two named effects that explain the runs, the most probable first.

    One of the two at the most is the instrument's. A set that is more probable than one that
    explains the runs is returned too. Left out are those less probable than the first of these by
    more than Occam's window, and those with a constant at the end of its range.

    Parameters
    ----------
    model
        The known part, whose law relaxes by itself.
    fitted, unseen
        Runs without what a known instrument did: those fitted, and others of the data set. The
        instants of steps that their samples do not tell are fitted along, for those that laws of
        the library like best take a lag for a later step.
    flows
        Of which those in shear, at a given rate and with σ12 recorded are predicted.
    expectation
        What a complete law may leave.
    effects
        Candidates; by default all with a name that may be behind these runs.
    """
    effects = _admitted(fitted) if effects is None else effects
    declared = model.without_effects(modulus_covariance=model.modulus_covariance)
    dated = [[with_rate_steps(run) for run in runs] for runs in (fitted, unseen)]
    declared, fitted, unseen = with_places(declared, *dated)
    batch = make_batch(fitted)
    forward = AugmentedModel(declared, effects, data_scales(fitted), batch)
    problem = FitProblem(forward, batch, len(effects))
    best = _best_fits(problem, _sets(effects))
    if not best:
        return ()
    independent = problem.independent_samples(min(best.values(), key=problem.cost))

    def worth_of(names: tuple[str, ...]) -> float:
        return problem.worth(best[names], names, independent)

    _to_the_end(problem, best, sorted(best, key=worth_of)[:_LOOKED_AT])
    looked_at = sorted(best, key=worth_of)[:_LOOKED_AT]
    worth = {names: worth_of(names) for names in looked_at}
    left = {
        names: problem.lack_of_fit(best[names], fitted, expectation)
        for names in looked_at
        if not _at_an_end(forward, best[names], names)
    }
    first = next((names for names, one in left.items() if one.verdict == "explained"), None)
    if first is None:
        return ()
    # what is more probable than one that leaves noise is not refuted by a pattern, which correlated
    # noise may have by chance
    found = {
        names: one
        for names, one in left.items()
        if worth[names] < worth[first]
        or (one.verdict == "explained" and worth[names] <= worth[first] + _BEYOND)
    }
    return tuple(
        NamedExplanation(
            names,
            one,
            worth[names],
            _predicted(problem, best[names], fitted, unseen, flows),
        )
        for names, one in found.items()
    )


def _admitted(runs: Sequence[Run]) -> list[AbstractEffect]:
    """Return the named effects that may be behind these runs.

    A rate that was measured at the tool contains already what shapes the command.
    """
    measured = any(run.rate_is_measured for run in runs)
    return [
        effect
        for effect in named_effects().values()
        if not effect.on_request
        and not (measured and isinstance(effect, KinematicEffect) and effect.shapes_command)
    ]


def _sets(effects: Sequence[AbstractEffect]) -> list[tuple[str, ...]]:
    fluid = [e.name for e in effects if isinstance(e, ConstitutiveEffect)]
    instrument = [e.name for e in effects if not isinstance(e, ConstitutiveEffect)]
    alone = [(), *((name,) for name in (*fluid, *instrument))]
    return [*alone, *combinations(fluid, 2), *product(fluid, instrument)]


def _best_fits(problem: FitProblem, sets: Sequence[tuple[str, ...]]) -> dict[tuple[str, ...], Fit]:
    """Return the best usable fit of each set that has one."""
    model = problem.model
    owners, starts, free = [], [], []
    for names in sets:
        for factor in _STARTS if names else _STARTS[:1]:
            start = model.zero()
            for name in names:
                at = model.positions(name)[0]
                start[at] = np.clip(factor * model.first_trial[at], model.low[at], model.high[at])
            owners.append(names)
            starts.append(start)
            of_names = [at for name in names for at in model.positions(name)]
            free.append([*model.free_positions, *of_names])
    fits = fit_batch(model, problem.batch, starts, free, max_steps=_MOST_STEPS, rivals=True)
    best: dict[tuple[str, ...], Fit] = {}
    for names, fit in zip(owners, fits, strict=True):
        if (names not in best or fit.cost < best[names].cost) and fit.usable:
            best[names] = fit
    return best


def _to_the_end(
    problem: FitProblem, best: dict[tuple[str, ...], Fit], sets: Sequence[tuple[str, ...]]
) -> None:
    """Fit some sets to the end, each also with the instants of steps that the first has.

    What answers late and a step that comes later may be taken for one another on the way.
    """
    at, first = problem.model.instants, best[sets[0]].theta
    starts = []
    for names in sets:
        as_first = best[names].theta.copy()
        as_first[at] = first[at]
        starts += [best[names].theta, as_first] if at.stop > at.start else [best[names].theta]
    owners = [names for names in sets for _ in range(len(starts) // len(sets))]
    free = [best[names].free for names in owners]
    fits = fit_batch(problem.model, problem.batch, starts, free)
    for names, fit in zip(owners, fits, strict=True):
        if fit.cost < best[names].cost and fit.usable:
            best[names] = fit


def _at_an_end(model: AugmentedModel, fit: Fit, names: Sequence[str]) -> bool:
    """Return whether a constant stands at the upper end of its range, where it is no finding."""
    for name in names:
        parameters = effect_of(model, name).parameters
        for parameter, at in zip(parameters, model.positions(name), strict=True):
            value, high = fit.theta[at], model.high[at]
            if "high" not in parameter.ends and high - value <= _AT_THE_END * abs(high):
                return True
    return False


def _to_predict(
    fitted: Sequence[Run], unseen: Sequence[Run], flows: Sequence[Flow]
) -> tuple[list[str], list[Run]]:
    """Return the keys of the flows, and of each quantity in turn the runs that record it."""
    runs, keys, shown = {run.name: run for run in (*fitted, *unseen)}, [], []
    for flow in flows:
        if flow.kind not in DRAWN or not flow.in_shear:
            continue
        if not flow.records_shear_stress or flow.protocol.control != "rate":
            continue
        blank = np.ones(len(flow.times))
        plain = Run(flow.name, flow.times, flow.protocol, flow.rate, blank)
        run = plain if flow.kind == "test" else runs.get(flow.name, plain)
        keys.append(flow.key)
        shown.append(
            replace(
                run, first_normal_stress_difference=blank, second_normal_stress_difference=blank
            )
        )
    of_each = [
        replace(run, protocol=recording(run.protocol, q)) for q in QUANTITIES for run in shown
    ]
    return keys, of_each


def _predicted(
    problem: FitProblem,
    fit: Fit,
    fitted: Sequence[Run],
    unseen: Sequence[Run],
    flows: Sequence[Flow],
) -> dict[str, dict[str, Distribution]]:
    """Return means and deviations, to first order in the constants; of flows that can be followed.

    Constants are moved by each of their independent deviations, and no farther than their range.
    In runs held out the rate steps when their own record says.
    """
    model, at = problem.model, list(fit.free)
    keys, runs = _to_predict(fitted, with_own_instants(model, fit.theta, unseen), flows)
    if not runs:
        return {}
    batch = make_batch(runs)
    covariance, quantile = np.zeros((0, 0)), float(ndtri(_TAIL))
    if at:
        covariance, quantile = uncertainty(problem.batch, fit.residual, fit.jacobian)
    trials = [fit.theta]
    for step in root_of(covariance).T if at else ():
        for sign in (1.0, -1.0):
            moved = fit.theta.copy()
            moved[at] = np.clip(moved[at] + sign * step, model.low[at], model.high[at])
            trials.append(moved)
    with np.errstate(over="ignore", invalid="ignore"):
        mean, *moved = model.predictions(trials, batch)
        changes = [0.5 * (up - down) for up, down in zip(moved[::2], moved[1::2], strict=True)]
        variance = np.sum(np.square(changes), axis=0) if changes else np.zeros_like(mean)
        variance = variance + _of_moduli(problem, fit, batch, mean)
    # tails of as few independent samples as there are, and a band that holds the curve as a whole,
    # wherever in their joint region the constants lie   [Scheffé 1953, Biometrika 40, 87]
    whole = np.sqrt(chi2.ppf(2.0 * _TAIL - 1.0, max(len(at), 1)))
    deviation = np.sqrt(variance) * quantile * whole / float(ndtri(_TAIL)) ** 2
    found: dict[str, dict[str, Distribution]] = {}
    for i, key in enumerate(keys):
        rows = {q: i + j * len(keys) for j, q in enumerate(QUANTITIES)}
        of_flow = {
            q: (mean[r, : len(runs[r])], deviation[r, : len(runs[r])]) for q, r in rows.items()
        }
        if np.all(np.isfinite([part for pair in of_flow.values() for part in pair])):
            size = {q: rms(of_flow[q][0]) for q in QUANTITIES[:2]}
            found[key] = {
                q: (m, np.hypot(d, _ARITHMETIC * size["N1" if q == "N2" else q]))
                for q, (m, d) in of_flow.items()
            }
    return found


def _of_moduli(
    problem: FitProblem, fit: Fit, batch: Batch, mean: np.ndarray
) -> Float[np.ndarray, "runs n"]:
    """Return the variance from errors of the moduli, as a sweep leaves them."""
    model = problem.model
    shifts = modulus_shifts(model, fit.theta, batch)
    if not len(shifts):
        return np.zeros_like(mean)
    weight = np.asarray(batch.weight)
    change = shifts / np.where(weight > 0, weight, 1.0)
    if fit.free:
        off = response(fit.jacobian, modulus_shifts(model, fit.theta, problem.batch))
        slope = model.linearise(fit.theta, batch, fit.free).jacobian
        change = change - np.tensordot(off, slope / np.where(weight > 0, weight, 1.0), axes=(0, 0))
    return np.sum(np.nan_to_num(change) ** 2, axis=0)
