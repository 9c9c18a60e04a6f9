"""Expected error of what was not fitted: how far laws that describe the runs as well differ."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from discover.dataset import Run
from discover.forward import AugmentedModel, make_batch
from discover.forward.of_fluids import bare_run
from discover.inference import Posterior
from discover.inference.bands import LOST, Predictions
from discover.inference.fit import Fit
from discover.inference.problem import TERM_ODDS
from discover.inference.rows import Rows
from discover.loop.by_quantity import BEYOND
from discover.loop.parts import Spread
from discover.processor import in_one_thread
from discover.protocols import in_flow, start_up
from discover.protocols.kinematics import RecordedQuantity

_LAWS = 20
# Of the runs, as which they count where laws are weighed that were fitted to them and are all
# wrong: on development seeds with one and less, bands of N1 hold 92 and 98 % of the samples
_TEMPERED = 0.5
_SAMPLES = 81
_STRAIN, _HENCKY = 20.0, 3.0
_LEAST_LIKELY = 0.01  # Of the likeliest law, below which one changes nothing

_SHEAR: tuple[RecordedQuantity, ...] = ("sigma12", "N1", "N2")


@in_one_thread
def spread_of_laws(posterior: Posterior, best: Fit) -> dict[str, Spread]:
    """Return by how much σ12, N1, N2 and uniaxial stress differ between equally good laws.

    These are `weighed_laws`, of the fluid alone, with what is uncertain of their constants. `best`:
    the law that is reported, from which differences are counted.
    """
    runs, weighed = posterior.problem.fitted.runs, weighed_laws(posterior)
    rates = [float(np.max(np.abs(run.rate))) for run in runs]
    rates = [rate for rate in rates if rate > 0.0]
    if not weighed or not rates or best.covariance is None:
        return {}
    inside, ends = _flows_inside(runs, rates), (max(rates), BEYOND * max(rates))
    n, flows = len(inside), [*inside, _start_up(ends[1], _STRAIN), *map(_uniaxial, ends)]
    predictions = Predictions(posterior, Rows.of(flows), as_recorded=False)
    reported, laws = predictions.of_laws([(best, 1.0)])[0], predictions.of_laws(weighed)
    found = []
    with np.errstate(all="ignore"):  # of extension there is no N1
        for i in range(len(flows)):
            at = predictions.rows.run == i
            own = np.where(reported.sound[i], reported.middle[at], np.nan)
            kept = [law for law in laws if law.sound[i]]
            share = sum(law.weight for law in kept)
            squares = [
                law.weight * ((law.middle[at] - own) ** 2 + law.variance[at]) for law in kept
            ]
            square = np.mean(sum(squares, np.zeros_like(own)), axis=0) / share
            size = np.sqrt(np.mean(own**2, axis=0))
            over_n1 = np.copysign(size[2], own[:, 1] @ own[:, 2]) / size[1]
            apart = np.sqrt(square) / size[[0, 1, 1]] if share >= LOST else np.nan * size
            found.append((size, apart, over_n1))
    size, apart, ratios = (np.array(each) for each in zip(*found, strict=True))
    falls, steady = steady_shear(posterior.problem.model, best.theta, rates)
    at = int(np.argmax(np.abs(ratios[:n])))  # one that is not finite first
    over_n1 = _largest(ratios[[at]])
    rate = None if over_n1 is None else float(np.max(np.abs(inside[at].rate)))
    columns = [(kind, apart[:n, k], apart[n, k], size[n - 1, k]) for k, kind in enumerate(_SHEAR)]
    columns.append(("uniaxial", apart[n + 1, 0], apart[n + 2, 0], size[n + 1, 0]))
    return {
        kind: Spread(
            _largest(within),
            _largest(beyond),
            over_n1 if kind == "N2" else None,
            _largest(stress),
            falls if kind == "sigma12" else None,
            rate if kind == "N2" else None,
            steady if kind == "N1" else None,
        )
        for kind, within, beyond, stress in columns
    }


def steady_shear(
    model: AugmentedModel, theta: Float[np.ndarray, " p"], rates: Sequence[float]
) -> tuple[float | None, float | None]:
    """Return the rate in 1/s above which the law's stress falls, and N1 in Pa at the fastest.

    In steady shear between the ends of `rates` in 1/s; None where the stress rises throughout, and
    where there is no N1. The instrument is ideal, and a start-up of a long strain stands for steady
    flow: its program is made already.
    """
    law = theta.copy()
    for effect in model.effects:
        if effect.kind != "constitutive":
            law[model.slices[effect.name].start] = 0.0
    curve = np.geomspace(min(rates), max(rates), _CURVE)
    flows = [_start_up(rate, _STEADY) for rate in curve]
    with np.errstate(all="ignore"):
        found = model.observables(law[None], make_batch(flows))[0, :, _SAMPLES - 1]
    falling = np.flatnonzero(np.diff(found[:, 0]) < -_ROUNDING * found[:-1, 0])
    return float(curve[falling[0]]) if falling.size else None, _largest(found[-1:, 1])


# Rates of a flow curve, the strain at which it is taken, and the relative error of an integration
_CURVE, _STEADY, _ROUNDING = 33, 100.0, 1e-3


def _largest(values: ArrayLike) -> float | None:
    return float(np.max(values)) if np.all(np.isfinite(values)) else None


def weighed_laws(posterior: Posterior) -> list[tuple[Fit, float]]:
    """Return laws that describe the runs about as well, with weights that add up to one.

    By their evidence where one of them is all there is. Otherwise all miss the runs, by what each
    run has in common: R misses are draws from one normal distribution of unknown deviation, whose
    density goes as the misfit to the power −R (see `predictive_mixture`). What fits σ12 best need
    not come nearest in N1, so runs count half, and a term without a law keeps its lower prior odds,
    as does a function beside a law. Where that stands out and leaves nothing it is all that counts.
    """
    if posterior.unexplained < 0.5:
        pairs = list(posterior.fits)
    else:
        problem, runs = posterior.problem, len(posterior.problem.fitted.runs)
        beside = [fit for curve in posterior.curves for fit, _ in curve.fits]
        found = [f for f in (*posterior.search.ranked(), *beside) if f.covariance is not None]
        logs = np.array([
            sum(np.log(problem.odds(name)) for name in fit.names)
            + posterior.has_function(fit) * np.log(TERM_ODDS)
            - _TEMPERED * runs * np.log(misfit(posterior, fit))
            for fit in found
        ])  # fmt: skip
        weights = np.exp(logs - np.logaddexp.reduce(logs, initial=-np.inf))
        pairs = posterior.mixed_with_curves(list(zip(found, weights.tolist(), strict=True)))
    pairs = sorted(pairs, key=lambda pair: -pair[1])[:_LAWS]
    most = max((p for _, p in pairs), default=0.0)
    pairs = [(f, p) for f, p in pairs if f.covariance is not None and p > _LEAST_LIKELY * most]
    total = sum(p for _, p in pairs)
    return [(fit, float(p / total)) for fit, p in pairs]


def misfit(posterior: Posterior, fit: Fit) -> float:
    """Return what a law leaves of the fitted runs, over their size; never zero."""
    return max(posterior.fitter_of(fit).misfit(fit), 1e-150)


def _flows_inside(runs: Sequence[Run], rates: Sequence[float]) -> list[Run]:
    """Return a slow and a fast flow of the fitted runs; start-ups where these were other tests."""
    own = [run for run in runs if run.protocol.control == "rate" and run.flow == "shear"]
    own = [run for run in own if run.quantity == "sigma12" and np.any(run.rate)]
    if own:
        own.sort(key=lambda run: float(np.max(np.abs(run.rate))))
        some = [own[0], own[-1]] if len(own) > 1 else own
        return [bare_run(run.protocol, _thinned(run.time)) for run in some]
    ends = sorted({min(rates), max(rates)})
    return [_start_up(rate, _STRAIN) for rate in ends]


def _thinned(times: Float[np.ndarray, " n"]) -> Float[np.ndarray, " m"]:
    at = np.unique(np.linspace(0, len(times) - 1, _SAMPLES).astype(int))
    return times[at]


def _start_up(rate: float, strain: float) -> Run:
    return bare_run(start_up(rate), np.linspace(0.0, strain / rate, _SAMPLES))


def _uniaxial(rate: float) -> Run:
    flow = in_flow(start_up(rate), "uniaxial")
    return bare_run(flow, np.linspace(0.0, _HENCKY / rate, _SAMPLES))
