"""What a closed loop leaves of the runs, and by how much a sound instrument is off in them."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from discover.inference.problem import NUISANCES
from discover.inference.rows import TORQUE
from discover.loop.from_posterior import FinishedSearch
from discover.loop.measured_rates import instants_found
from discover.loop.runs import errors_of, why_untested
from discover.words import percent_of


def remaining(
    ended: FinishedSearch, spikes: Mapping[str, Sequence[float]], of_rates: str
) -> dict[str, Any]:
    """Return what is left, as ``loop.json`` names it; `spikes`, `of_rates` as `Task` has them."""
    problem, fit = ended.posterior.problem, ended.fit
    rows = problem.fitted
    worst = max(ended.records, key=lambda record: float(record.errors[-1]))
    bounds = ended.bounds
    held = () if problem.predicted is None else problem.predicted.runs
    first = problem.model.instants.start
    told = {first + s.place for run in rows.runs for s in run.rate_steps if s.place is not None}
    instants = {at: ends for at, ends in bounds.items() if at in told}
    structured = ended.verdict == "unexplained"
    said = f"{of_rates}. " * bool(of_rates)
    return {
        "structured": structured,
        "error": errors_of(ended.records, -1).fit,
        "noise_floor": ended.noise,
        "outliers": sum(map(len, spikes.values())),
        "outlier_times_s": spikes,
        "without_fluid": ended.without_fluid,
        "untested": why_untested(_constants(ended), rows.runs, held),
        "linear_error": problem.declared.linear_error,
        "autocorrelation": fit.noise.correlation,
        "worst_run": worst.name,
        "worst_run_error": float(worst.errors[-1]),
        "oil_twin": ended.oil_twin,
        "bench": _bench(ended),
        "description": said + _in_words(ended),
        "step_instants": {}
        if not problem.declared.step_instants
        else instants_found(problem.model, ended.held_out_theta(fit), instants, rows.runs, held),
        **_loadings(ended),
    }


def _constants(ended: FinishedSearch) -> int:
    """How many constants were fitted, those of the declared model counted as one."""
    model = ended.posterior.problem.model
    added = sum(len(model.positions(name)) for name in ended.fit.names)
    return max(added, int(bool(model.declared.free_constants)))


def _in_words(ended: FinishedSearch) -> str:
    none = percent_of(ended.posterior.unexplained)
    if ended.without_fluid:
        return "Noise and instrument errors alone explain the data as well."
    text = f"Probability that an unknown effect is present: {none}."
    if ended.verdict == "unexplained":
        text = f"An effect is still missing or has another form. {text}"
    return text


def _bench(ended: FinishedSearch) -> dict[str, float]:
    """Return by how much a sound bench is off here, as fitted jointly: its nuisances."""
    problem, fit = ended.posterior.problem, ended.fit
    names = ["stress" if one == TORQUE else one for one in problem.transducers]
    found = {f"{name}_gain": float(g) for name, g in zip(names, fit.linear, strict=False)}
    if 1 not in problem.declared.free_positions:
        found["clock"] = float(fit.theta[1])
    for nuisance in NUISANCES:
        at = problem.model.positions(nuisance.effect)[0]
        if at in fit.priors and nuisance.effect not in fit.names:
            found[nuisance.effect] = float(fit.theta[at])
    return found


def _loadings(ended: FinishedSearch) -> dict[str, Any]:
    """Return the factors of loadings by run, where each run is a loading of its own."""
    problem, fit = ended.posterior.problem, ended.fit
    if not problem.loads_anew:
        return {}
    runs = problem.fitted.runs
    first = ended.posterior.search.fitter.errors.of_runs.stop - len(runs)
    assert fit.covariance is not None
    spread = np.sqrt(np.diag(fit.covariance))[len(fit.priors) :]
    found = {}
    for i, run in enumerate(runs):
        factor, half = 1.0 + float(fit.linear[first + i]), 1.96 * float(spread[first + i])
        found[run.name] = {
            "factor": factor, "ci95": [factor - half, factor + half], "held_out": False,
        }  # fmt: skip
    return {"loading_deviation": problem.loading, "loading": found}
