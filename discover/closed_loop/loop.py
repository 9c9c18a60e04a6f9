"""The closed loop: residual, attribution, augmentation, before and after."""

import time
from collections.abc import Callable, Sequence

import jax.numpy as jnp
import numpy as np

from discover.closed_loop.attribution import CandidateScore, attribute
from discover.closed_loop.augment import AugmentedLaw, choose, intervals, prune, refit
from discover.closed_loop.augmented_model import AugmentedModel, data_scales, make_batch
from discover.closed_loop.before_after import cut_to_strain, errors_of, record_runs
from discover.closed_loop.declared import DeclaredModel
from discover.closed_loop.least_squares import Fit, fit_batch, leave_one_run_out
from discover.closed_loop.residual import summarise
from discover.closed_loop.result import LoopResult, Stage, StageParameter, Verdict
from discover.dataset import ShearDataset
from discover.effects import (
    AbstractEffect,
    ConstitutiveEffect,
    library_effects,
    make_effect,
    named_effects,
)
from discover.errors import InputError
from discover.laws import Fluid

LEADERS = 8
"""Candidates that are refitted at each stage."""

STRUCTURE = 1.5
"""A residual this many times larger than noise and linear error together is not explained."""


def run_loop(
    dataset: ShearDataset,
    declared: DeclaredModel,
    fit: Sequence[str] | None = None,
    held_out: Sequence[str] = (),
    effects: Sequence[str | AbstractEffect] | None = None,
    max_effects: int = 3,
    strain: tuple[float, float] | None = None,
    progress: Callable[[str], None] | None = None,
) -> LoopResult:
    """Find what a declared model lacks, add it, and judge it on runs that no fit saw.

    At each stage every effect is scored by its signature beyond what is fitted already; the
    leading ones are refitted together with everything fitted before; chosen is the one with the
    strongest evidence among those that also predict runs left out better. Effects made redundant
    are dropped again. The loop stops when none earns its place. Nothing in it is random.

    Parameters
    ----------
    dataset
        All runs.
    declared
        The model to start from.
    fit
        Names of the runs to fit; by default all that are not held out.
    held_out
        Names of the runs that only judge.
    effects
        Candidates, by name, by spelling of a library term, or as objects; by default every named
        effect and every library term up to one invariant.
    max_effects
        Largest number of effects added.
    strain
        Smallest and largest strain of the samples fitted and judged.
    progress
        Called with a line of text now and then.

    Raises
    ------
    InputError
        If runs, window or effects are not as they should be.
    """
    started = time.perf_counter()
    say = progress or (lambda line: None)
    fitted_runs, held_runs = _split(dataset, fit, held_out, strain)
    candidates = _candidates(effects)
    if max_effects < 0:
        raise InputError(f"max_effects must be 0 or more; got {max_effects}.")
    model = AugmentedModel(declared, candidates, data_scales(fitted_runs))
    batch = make_batch(fitted_runs)
    held_batch = make_batch(held_runs) if held_runs else None

    always = declared.free_positions
    say(f"declared model on {len(fitted_runs)} runs")
    current = fit_batch(model, batch, [model.zero()], [always])[0]
    if not current.usable:
        raise InputError(
            "The declared model cannot be integrated through the fitted runs: its stress runs "
            "away. Check its parameters, modes and units."
        )
    left_out = _left_out(model, batch, current)
    thetas, active, rankings = [current.theta], [], []
    aliases: dict[str, tuple[str, ...]] = {}
    support: dict[str, float] = {}
    for number in range(1, max_effects + 1):
        ranking = attribute(model, batch, current, active, LEADERS).candidates
        leaders = [c for c in ranking if c.reduction > 0.0][:LEADERS]
        choices = refit(model, batch, current, leaders, len(candidates))
        choices = [c for c in choices if _predictable(model, held_batch, c.fit.theta)]
        rankings.append(_ordered(ranking))
        choice = choose(choices, left_out)
        if choice is None:
            say(f"stage {number}: no candidate earns its place")
            break
        name = choice.candidate.effect
        aliases[name] = choice.candidate.aliases
        support[name] = choice.candidate.evidence or 0.0
        kept = [*active, name]
        current, active = prune(model, batch, choice.fit, kept, len(candidates))
        if len(active) < len(kept):
            # the stages must tell how the final model is reached, so they are fitted again
            thetas = _refit_path(model, batch, always, active, current)
        else:
            thetas.append(current.theta)
        left_out = _left_out(model, batch, current)
        say(
            f"stage {number}: {name}, error {np.mean(current.run_errors):.4f}, runs left out "
            f"{left_out:.4f}"
        )

    records = record_runs(model, batch, fitted_runs, thetas, held_out=False)
    if held_batch is not None:
        records += record_runs(model, held_batch, held_runs, thetas, held_out=True)
    summary = summarise(current.residual, np.asarray(batch.weight))
    bounds = intervals(model, batch, current)
    stages = tuple(
        _stage(model, current, name, aliases, support, bounds, errors_of(records, i))
        for i, name in enumerate(active, start=1)
    )
    after = errors_of(records, len(thetas) - 1)
    expected = float(np.hypot(summary.noise_floor, declared.linear_error))
    structured = after.fit > STRUCTURE * expected
    verdict: Verdict = "unexplained" if structured else "no_effect_needed"
    if stages and not structured:
        verdict = "effects_added"
    worst = max(records, key=lambda record: record.errors[-1])
    return LoopResult(
        verdict=verdict,
        error_before=errors_of(records, 0),
        error_after=after,
        noise_floor=summary.noise_floor,
        stages=stages,
        remaining={
            "structured": structured,
            "error": after.fit,
            "noise_floor": summary.noise_floor,
            "linear_error": declared.linear_error,
            "autocorrelation": float(np.mean(summary.autocorrelation)),
            "worst_run": worst.name,
            "worst_run_error": float(worst.errors[-1]),
            "description": _describe(after.fit, expected, structured, worst),
        },
        rankings=tuple(rankings),
        records=tuple(records),
        declared_parameters=_declared_parameters(declared, current, bounds),
        fluid=_fluid(model, current, active),
        seconds=time.perf_counter() - started,
    )


def _split(dataset, fit, held_out, strain):
    overlap = [name for name in (fit or ()) if name in held_out]
    if overlap:
        raise InputError(f"The run {overlap[0]!r} is both fitted and held out; choose one.")
    held = dataset.select(list(held_out))
    fitted = dataset.select(
        list(fit) if fit is not None else [n for n in dataset.names if n not in held_out]
    )
    if len(fitted) == 0:
        raise InputError("No run is left to fit. Take some out of held_out.")
    return cut_to_strain(fitted.runs, strain), cut_to_strain(held.runs, strain)


def _candidates(effects: Sequence[str | AbstractEffect] | None) -> list[AbstractEffect]:
    if effects is None:
        return [*named_effects().values(), *library_effects()]
    if not effects:
        raise InputError("The loop needs at least one candidate effect; got none.")
    made = [make_effect(effect) if isinstance(effect, str) else effect for effect in effects]
    names = [effect.name for effect in made]
    repeated = [name for name in names if names.count(name) > 1]
    if repeated:
        raise InputError(f"The effect {repeated[0]!r} is given twice.")
    return made


def _left_out(model, batch, fit: Fit) -> float:
    return float(np.mean(leave_one_run_out(model, batch, fit)))


def _predictable(model, batch, theta) -> bool:
    # flows are commanded before they are measured: a law that cannot be integrated through a
    # held-out flow is no law of this fluid, and saying so uses none of its stresses
    return batch is None or bool(np.all(np.isfinite(model.predict(theta, batch))))


def _ordered(ranking: Sequence[CandidateScore]) -> tuple[CandidateScore, ...]:
    def key(candidate):
        known = candidate.evidence if candidate.evidence is not None else -np.inf
        return (-known, -candidate.reduction)

    return tuple(sorted(ranking, key=key))


def _refit_path(model, batch, always, active, current):
    theta, thetas = model.zero(), []
    for count in range(len(active)):
        positions = [*always, *(p for n in active[:count] for p in model.positions(n))]
        start = theta.copy()
        start[positions] = current.theta[positions]
        thetas.append(fit_batch(model, batch, [start], [positions])[0].theta)
    return [*thetas, current.theta]


def _stage(model, fit, name, aliases, support, bounds, error) -> Stage:
    effect = next(e for e in model.effects if e.name == name)
    parameters = {
        p.name: StageParameter(float(fit.theta[at]), bounds[at], p.unit)
        for p, at in zip(effect.parameters, model.positions(name), strict=True)
    }
    return Stage(
        effect=name,
        kind=effect.kind,
        parameters=parameters,
        aliases=aliases.get(name, ()),
        error=error,
        evidence=support.get(name, 0.0),
        equation=effect.equation,
        source=effect.source,
        check=effect.check,
    )


def _declared_parameters(declared: DeclaredModel, fit: Fit, bounds):
    named = {2 + i: p.name for i, p in enumerate(declared.free_parameters)}
    # the common factors are fitted as logarithms
    factors = {0: "modulus_factor", 1: "relaxation_time_factor"}
    out = {}
    for at in declared.free_positions:
        value, (low, high) = fit.theta[at], bounds[at]
        if at in factors:
            value, low, high = np.exp(value), np.exp(low), np.exp(high)
        name = factors.get(at) or named[at]
        out[name] = StageParameter(float(value), (float(low), float(high)), "")
    return out


def _fluid(model: AugmentedModel, fit: Fit, active: Sequence[str]) -> Fluid:
    declared = model.declared
    added = [
        (effect, jnp.asarray(fit.theta[model.positions(effect.name)]))
        for effect in model.effects
        if effect.name in active and isinstance(effect, ConstitutiveEffect)
    ]
    base = declared.law_with(fit.theta[2 : 2 + len(declared.free_parameters)])
    law = AugmentedLaw(
        base,
        tuple(values for _, values in added),
        tuple(effect for effect, _ in added),
        base.linear_relaxation,
    )
    one = jnp.ones(1)
    viscosity = declared.solvent_viscosity + sum(
        float(effect.instantaneous_stress(values, one)[0]) for effect, values in added
    )
    return Fluid(
        law,
        declared.modulus * np.exp(fit.theta[0]),
        declared.relaxation_time * np.exp(fit.theta[1]),
        viscosity,
    )


def _describe(error: float, expected: float, structured: bool, worst) -> str:
    if structured:
        return (
            f"The fitted runs are missed by {100 * error:.1f} %, more than noise and the error of "
            f"the linear data explain ({100 * expected:.1f} %); the worst run is {worst.name}. "
            "Some effect is still missing."
        )
    return (
        f"The fitted runs are missed by {100 * error:.1f} %, as noise and the error of the linear "
        f"data explain ({100 * expected:.1f} %)."
    )
