"""Predictions of a posterior in any flow: σ12, N1 and N2 with their 95 % bands."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from discover.comparison.flows import MEASURED, Band, Flow, Stresses, columns_of
from discover.dataset import Run
from discover.effects import ConstitutiveEffect
from discover.forward import AugmentedModel, make_batch
from discover.forward.of_fluids import bare_run
from discover.inference.engine.bands import quantiles
from discover.inference.engine.fit import Fit
from discover.inference.engine.left_out import MOST_MISSED, of_the_next_run
from discover.inference.engine.linear_errors import LinearErrors
from discover.inference.engine.problem import NUISANCES
from discover.inference.engine.rows import Rows
from discover.inference.engine.variables import SLIP_CURVE, Variable
from discover.inference.engine.with_function import WithFunction
from discover.linear_algebra_threads import in_one_thread
from discover.loop.expected_errors import SIMPLE_FLUIDS, misfit, weighed_laws
from discover.loop.loop import Found
from discover.statistics.noise.noise_model import rms

_DRAWS = 6
"""Pairs of draws of the constants of a hypothesis."""

_LEAST = 1e-3
"""Weight below which a hypothesis changes no band."""

_RUNS_AWAY = 1e3
"""Times the largest stress recorded or predicted by the known part, which no sound law exceeds."""

_LOST = 0.5
"""Weight of hypotheses that may diverge in a flow in which the others still make a band."""

_POWERS = np.array([1.0, 2.0, 2.0])
"""Powers of the shear stress with which σ12, N1 and N2 go   [second-order fluid: Bird, Armstrong &
Hassager 1987, ch. 6], and so their relative errors."""

_UNRELATED = np.array([0.0, 2.0, 0.0]), np.array([0.0, 0.05, 0.0])
"""Relative errors that a law has in N1 besides, for what relates N1 to σ12 is not known either:
over the error of σ12, and at least. On development seeds laws of no library that others fit to the
noise have N1 off by 4 to 13 %."""

_SEED = 20261128


@dataclass(frozen=True)
class _Part:
    """One hypothesis with its weight; `is_none` where it is not all there is."""

    fit: Fit
    weight: float
    is_none: bool


@in_one_thread
def flow_bands(found: Found, flows: Sequence[Flow], runs: Mapping[str, Run]) -> dict[str, Band]:
    """Return the band of each flow, by its key; those in which most hypotheses diverge have none.

    Hypotheses are weighed by evidence, constants drawn. Where none is all there is, all that
    describe the runs as well count, every stress is missed as runs left out are (more beyond the
    fastest rate), and N2 is as likely anything from −2/7 N1 to zero. Runs are predicted as
    recorded, other flows for the fluid alone. `runs`: as recorded, by name.
    """
    parts = _parts(found)
    if not parts or not flows:
        return {}
    asked = [flow_run(flow, found, runs) for flow in flows]
    as_recorded = [flow.kind in MEASURED for flow in flows]
    out: dict[str, Band] = {}
    for recorded in (True, False):
        at = [i for i, one in enumerate(as_recorded) if one is recorded]
        if at:
            some = [asked[i] for i in at]
            bands = _bands(found, parts, some, recorded)
            for i, band in zip(at, bands, strict=True):
                if band is not None:
                    out[flows[i].key] = band
    return out


def _parts(found: Found) -> list[_Part]:
    posterior = found.posterior
    none = posterior.unexplained
    parts = [_Part(fit, (1.0 - none) * share, False) for fit, share in posterior.fits]
    parts += [_Part(fit, none * share, True) for fit, share in weighed_laws(posterior)]
    return [part for part in parts if part.weight > _LEAST and part.fit.covariance is not None]


def flow_run(flow: Flow, found: Found, runs: Mapping[str, Run]) -> Run:
    """Return the run that a flow asks for; one at hand with its steps placed where they are."""
    run = runs.get(flow.name) if flow.kind in MEASURED else None
    if run is None:
        return run_of(flow)
    placed = [one for one in (*found.task.fitted, *found.task.held_out) if one.name == run.name]
    return replace(run, rate_steps=placed[0].rate_steps) if placed else run


def run_of(flow: Flow) -> Run:
    """Return a flow, with the rate as it was recorded, as a run of which nothing is recorded."""
    return replace(bare_run(flow.protocol, flow.times, flow.name), rate=flow.rate)


def in_flows(
    model: AugmentedModel,
    thetas: Sequence[Float[np.ndarray, " p"]],
    flows: Sequence[Flow],
    runs: Sequence[Run] | None = None,
) -> list[dict[str, Stresses | None]]:
    """Return what vectors of constants predict in each flow, by its key; None where they diverge.

    `runs`: that the flows ask for; by default of the fluid alone.
    """
    if not flows:
        return [{} for _ in thetas]
    runs = list(map(run_of, flows)) if runs is None else runs
    with np.errstate(all="ignore"):
        predicted = model.observables(thetas, make_batch(runs))
    return [
        {
            flow.key: columns_of(rows[: len(flow.times)])
            if np.all(np.isfinite(rows[: len(flow.times), 0]))
            else None
            for flow, rows in zip(flows, of_one, strict=True)
        }
        for of_one in predicted
    ]


def _bands(
    found: Found, parts: Sequence[_Part], runs: Sequence[Run], as_recorded: bool
) -> list[Band | None]:
    problem, rows = found.posterior.problem, Rows.of(runs)
    drawn = [_drawn(found, part.fit, as_recorded) for part in parts]
    thetas, moduli = (np.concatenate([one[i] for one in drawn]) for i in (0, 1))
    with np.errstate(all="ignore"):
        predicted = np.array(problem.model.observables(thetas, rows.batch, moduli))
        plain = np.array(problem.model.observables([problem.zero], rows.batch))[0]
    each, bands = 1 + 2 * _DRAWS, []
    values = predicted.reshape(len(parts), each, *predicted.shape[1:])
    apart = np.zeros((len(parts), *predicted.shape[1:3]))
    fitted, errors = found.posterior.search.fitter.errors, LinearErrors(problem, rows, 0)
    for at, (part, own, (_, _, linear)) in enumerate(zip(parts, values, drawn, strict=True)):
        fitter = found.posterior.fitter_of(part.fit)
        if isinstance(fitter, WithFunction):
            function = fitter.variable.at(rows)
            for stresses, sizes in zip(own, linear[:, -function.count :], strict=True):
                _add(function, sizes, stresses, rows, as_recorded)
        if as_recorded:
            seen = own[:, rows.seen, 0]
            read = _read(fitted, errors, seen, part.fit, linear)
            own[:, rows.seen, 0], apart[at, rows.seen] = read
    largest = float(np.max(np.abs(problem.fitted.recorded)))
    for i, run in enumerate(runs):
        n = len(run)
        known = np.nan_to_num(np.abs(plain[i, :n]), nan=0.0, posinf=0.0)
        limit = _RUNS_AWAY * max(largest, float(np.max(known, initial=0.0)))
        bands.append(_band(found, parts, values[:, :, i, :n], apart[:, i, :n], run, limit))
    return bands


def _read(
    fitted: LinearErrors,
    errors: LinearErrors,
    stress: Float[np.ndarray, "draws rows"],
    fit: Fit,
    linear: Float[np.ndarray, "draws q"],
) -> tuple[Float[np.ndarray, "draws rows"], Float[np.ndarray, " rows"]]:
    """Return records of draws as the bench reads them, and the variance of what is not known.

    Zero, drift and loading of a run that was fitted are its own; those of another are as large.
    """
    assert fit.covariance is not None
    variances = np.diag(fit.covariance)[len(fit.priors) :]
    with np.errstate(all="ignore"):  # a law that diverges
        apart = errors.apart(stress[0], fit.linear, variances, fitted)
        nothing = np.zeros((len(errors.rows), 0))
        found = errors.recorded(stress, errors.like(fitted, linear), nothing)
    return found, np.where(errors.places_in(fitted)[errors.rows.run] >= 0, 0.0, apart)


def _drawn(found: Found, fit: Fit, as_recorded: bool):
    """Return constants, moduli and linear errors: the likeliest, then pairs of draws."""
    problem = found.posterior.problem
    assert fit.covariance is not None
    lot = np.random.default_rng(_SEED).standard_normal((_DRAWS, len(fit.covariance)))
    thetas, linear = fit.drawn(np.concatenate([np.zeros((1, lot.shape[1])), lot, -lot]))
    moduli = np.tile(problem.moduli, (len(thetas), 1))
    if problem.modulus_root is not None:
        first, root = found.posterior.search.fitter.errors.of_runs.stop, problem.modulus_root
        shifts = linear[:, first : first + root.shape[1]] @ root.T
        moduli[:, : shifts.shape[1]] += shifts
    if not as_recorded:
        thetas[:, _of_bench(found)] = problem.zero[_of_bench(found)]
    return thetas, moduli, linear


def _add(
    function: Variable,
    sizes: Float[np.ndarray, " knots"],
    stresses: Float[np.ndarray, "runs n 3"],
    rows: Rows,
    as_recorded: bool,
) -> None:
    """Add a function beside a hypothesis to what this predicts, in place.

    A factor that depends on the strain is of the fluid and so of all its stresses   [the damping
    function of Wagner 1976, Rheol. Acta 15, 136]; any other is of the record of σ12.
    """
    if function.slot == "network":
        assert function.values is not None
        stresses[rows.seen] *= 1.0 + (function.basis(function.values) @ sizes)[:, None]
    elif as_recorded:
        stresses[rows.seen, 0] += function.columns(stresses[rows.seen, 0]) @ sizes


def _of_bench(found: Found) -> list[int]:
    """Return positions of constants of the instrument, of the clock too where it is not fitted."""
    problem, model = found.posterior.problem, found.posterior.problem.model
    names = {n for n, e in problem.effects.items() if not isinstance(e, ConstitutiveEffect)}
    names |= {SLIP_CURVE.name, *(nuisance.effect for nuisance in NUISANCES)}
    at = [place for name in names for place in model.positions(name)]
    return at if 1 in problem.declared.free_positions else [1, *at]


def _band(
    found: Found,
    parts: Sequence[_Part],
    values: Float[np.ndarray, "parts draws n 3"],
    apart: Float[np.ndarray, "parts n"],
    run: Run,
    limit: float,
) -> Band | None:
    """Return the mixture of the hypotheses that can be followed."""
    kept, weights, middles, variances = 0.0, [], [], []
    first = values[:, 0]
    with np.errstate(invalid="ignore"):
        sound = np.all(np.abs(values[..., 0]) < limit, axis=2)
    for part, own, main, more, fine in zip(parts, values, first, apart, sound, strict=True):
        if not fine[0]:
            continue
        kept += part.weight
        off = own[1:][fine[1:]] - main
        variance = np.mean(off**2, axis=0) if len(off) else np.zeros_like(main)
        variance[:, 0] += more
        size = np.sqrt(np.mean(main**2, axis=0))[[0, 1, 1]] * [1.0, 1.0, -SIMPLE_FLUIDS]
        if part.is_none:
            missed, (share, least) = _missed(found, part.fit, run), _UNRELATED
            off = (missed * _POWERS) ** 2 + np.maximum(missed * share, least) ** 2
            variance = variance + off * size**2
        problem = found.posterior.problem
        if part.is_none or problem.leaves_second_difference_open(part.fit.names):
            prior = main.copy()
            prior[:, 2] = 0.5 * SIMPLE_FLUIDS * main[:, 1]
            wide = variance.copy()
            wide[:, 2] += (SIMPLE_FLUIDS * main[:, 1]) ** 2 / 12.0
            for middle, own_variance in ((main, variance), (prior, wide)):
                weights.append(0.5 * part.weight)
                middles.append(middle)
                variances.append(own_variance)
            continue
        weights.append(part.weight)
        middles.append(main)
        variances.append(variance)
    total = sum(part.weight for part in parts)
    if not weights or kept < _LOST * total:
        return None
    shape = middles[0].shape
    flat = [np.array(one).reshape(len(weights), -1) for one in (middles, variances)]
    told = np.all(np.isfinite(flat[0]), axis=0) & np.all(np.isfinite(flat[1]), axis=0)
    limits = np.full((3, flat[0].shape[1]), np.nan)
    parts_told = (np.array(weights), flat[0][:, told], flat[1][:, told])
    limits[:, told] = np.array(quantiles(*parts_told, (0.025, 0.5, 0.975)))
    low, middle, high = limits.reshape(3, *shape)
    return Band(columns_of(middle), columns_of(low), columns_of(high))


def _missed(found: Found, fit: Fit, run: Run) -> float:
    """Return the deviation, over its size, by which a run may be missed, from runs left out."""
    posterior = found.posterior
    left = None if posterior.has_function(fit) else posterior.left
    best = fit if left is None else left.fit
    missed, fastest = posterior.missed(best), posterior.problem.fitted.fastest
    wider = of_the_next_run(len(missed))
    worse = max(misfit(posterior, fit) / misfit(posterior, best), 1.0)
    beyond = max(float(np.max(np.abs(run.rate))) / float(np.max(fastest)), 1.0)
    return float(min(wider * rms(missed) * worse * beyond, MOST_MISSED))
