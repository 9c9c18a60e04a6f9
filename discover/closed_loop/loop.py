"""The closed loop: residual, attribution, augmentation, before and after."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence

import jax.numpy as jnp
import numpy as np

from discover.closed_loop.augment import FEWEST_SAMPLES
from discover.closed_loop.augmented_law import AugmentedLaw
from discover.closed_loop.before_after import (
    cut_to_strain,
    errors_of,
    record_runs,
    strain_of,
)
from discover.closed_loop.by_mode import constants_by_mode
from discover.closed_loop.error_pair import ErrorPair
from discover.closed_loop.explanation import Explanations
from discover.closed_loop.explanations import (
    BEAM_WIDTH,
    carry,
    explain,
    next_tests,
    with_band,
)
from discover.closed_loop.finer_steps import on_finer_steps
from discover.closed_loop.free_form import free_forms
from discover.closed_loop.held_out import held_out as predict_held_out
from discover.closed_loop.judgement import Judgement, Silence, judge
from discover.closed_loop.law_choice import LawFit, choose_law
from discover.closed_loop.limits import names_of_limits
from discover.closed_loop.next_test import NextTests
from discover.closed_loop.numerical_resolution import NumericalResolution
from discover.closed_loop.other_times import FACTOR, held_against_times, other_times
from discover.closed_loop.result import (
    ConstantByMode,
    DeclaredEffect,
    KnownParameter,
    LoopResult,
    Stage,
    StageParameter,
)
from discover.closed_loop.search import Search
from discover.closed_loop.search_checkpoint import SearchCheckpoint, Store
from discover.closed_loop.silence import fluid_is_silent, records_are_silent
from discover.closed_loop.tolerated_misfit import ToleratedMisfit
from discover.dataset import Dataset, Run
from discover.dataset.checking.start import doubts_of_start
from discover.dataset.run import same_samples
from discover.dataset.thinning import thin_run
from discover.effects import (
    BY_MODE,
    AbstractEffect,
    ConstitutiveEffect,
    KinematicEffect,
    ModeEffect,
    StateEffect,
    library_effects,
    make_effect,
    named_effects,
)
from discover.equations import Equation, law_parts
from discover.errors import InputError
from discover.forward import (
    MODULUS,
    RELAXATION_TIME,
    AugmentedModel,
    DeclaredModel,
    data_scales,
    make_batch,
)
from discover.forward.least_squares import Fit, intervals
from discover.laws import Fluid
from discover.statistics import isolated
from discover.statistics.residual import Expectation, fast_part, summarise

LINEAR_STRAIN = 0.4
"""Up to this strain a Maxwell-type law is linear in start-up to a few per cent of the stress."""

FEWEST_LINEAR_SAMPLES = 10
"""Fewer samples than this at small strain settle nothing."""

MOST_SAMPLES = 400
"""Samples of a run that are used by default, at most: a search costs as much as it has samples, and
more of them say little more of a law."""

_FEWEST_KEPT = 150
_RESOLVED = 1e-3
"""Relative error that the noise of as many samples as are used may leave."""

EXTRAPOLATION = 10.0
"""Ratio of held-out to fitted shear rates beyond which a law must stay well-posed."""


def run_loop(
    dataset: Dataset,
    declared: DeclaredModel,
    fit: Sequence[str] | None = None,
    held_out: Sequence[str] = (),
    effects: Sequence[str | AbstractEffect] | str | None = None,
    max_effects: int = 3,
    strain: tuple[float, float] | None = None,
    noise: float | None = None,
    most_samples: int = MOST_SAMPLES,
    explanations: int = BEAM_WIDTH,
    laws: Sequence[str] = (),
    progress: Callable[[str], None] | None = None,
    store: Store | None = None,
    name: str = "search",
) -> LoopResult:
    """Find what a declared model lacks, add it, and judge it on runs that no fit saw.

    Small strains come first: there the fluid is linear, so what the linear prediction misses is
    the instrument's. Then, at each stage, every effect is scored by its signature beyond what is
    fitted already; the leading ones are refitted together with everything fitted before; chosen
    is the one with the strongest evidence among those that also predict runs left out better.
    Effects made redundant are dropped again. The loop stops when none earns its place. Where the
    held-out flows are faster than the fitted ones by more than a decade, constitutive terms that
    name the rate are not tried: such laws may be ill-posed in fast flow (see
    `ConstitutiveEffect`). Nothing in the loop is random.

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
        Candidates, by name, by spelling of a library term, or as objects; ``"named"`` for every
        effect with a name; by default these and every library term up to one invariant.
    max_effects
        Largest number of effects added.
    strain
        Smallest and largest strain of the samples fitted and judged.
    noise
        Relative noise, where it is known; estimated from the residuals otherwise.
    most_samples
        Of a run with more samples at most so many are used, evenly chosen, to fit and to judge; of
        one with little noise fewer, but no fewer than 150.
    explanations
        How many sets of effects are carried side by side, at most.
    laws
        Named laws to choose the declared one from, by the fitted runs alone; see `choose_law`. By
        default it is as it was declared.
    progress
        Called with a line of text now and then.
    store
        Where the search is kept after each stage, so that it goes on there when it was interrupted.
    name
        Of this search among others in the store.

    Raises
    ------
    InputError
        If runs, window or effects are not as they should be.
    """
    started = time.perf_counter()
    say = progress or (lambda line: None)
    fitted_runs, held_runs, spikes = _split(dataset, fit, held_out, strain, most_samples)
    candidates = _candidates(effects)
    if max_effects < 0:
        raise InputError(f"max_effects must be 0 or more; got {max_effects}.")
    _require_samples(fitted_runs, declared)
    known = {effect.name for effect in declared.effects}
    _require_present(declared, {*known, *(effect.name for effect in candidates)})
    candidates = [effect for effect in candidates if effect.name not in known]
    _require_possible(declared, [*fitted_runs, *held_runs])
    tried_laws: tuple[LawFit, ...] = ()
    if laws and not records_are_silent(fitted_runs):
        declared, tried_laws = choose_law(declared, laws, fitted_runs, held_runs, say)
    # of one mode nothing can differ from another's
    asked = [*candidates, BY_MODE] if len(declared.modulus) > 1 else candidates
    model = AugmentedModel(declared, asked, data_scales(fitted_runs))
    batch = make_batch(fitted_runs)
    held_batch = make_batch(held_runs) if held_runs else None

    tolerated = ToleratedMisfit(
        Expectation(noise, declared.linear_error), NumericalResolution(model, batch, fitted_runs)
    )
    search = Search(
        model,
        batch,
        held_batch,
        len(candidates),
        _admission(fitted_runs, held_runs),
        tolerated,
        SearchCheckpoint(store, name),
    )
    silent = records_are_silent(fitted_runs)
    if silent:
        say("the records are noise about a constant: there is nothing to search in")
        search.start()
    elif search.resume():
        say(f"going on from what was kept: {', '.join(search.active)}")
    else:
        say(f"declared model on {len(fitted_runs)} runs")
        search.start()
        _settle(search, fitted_runs, max_effects, say)
    carried = []
    if not silent:
        search.run(max_effects, say)
        carried = carry(search, max_effects, explanations, say)
    active, thetas = search.active, search.path
    search.fit = current = on_finer_steps(model, batch, fitted_runs, search.fit, active)
    order = dataset.names
    records = record_runs(model, batch, fitted_runs, thetas, held_out=False, order=order)
    judging = []
    if held_batch is not None:
        judging = record_runs(model, held_batch, held_runs, thetas, held_out=True, order=order)
        records += judging
    summary = summarise(current.residual, np.asarray(batch.weight))
    bounds = intervals(model, batch, current)
    by_mode = constants_by_mode(model, batch, current, bounds, search.degrees, search.prior)
    differ = {name for name, found in by_mode.items() if found.degree}
    of_law = {p.name: by_mode[p.name] for p in declared.free_parameters if p.name in by_mode}
    after = errors_of(records, len(thetas) - 1)
    held = None
    if held_batch is not None:
        unseen = NumericalResolution(model, held_batch, held_runs)
        held = predict_held_out(model, batch, current, thetas[-1], unseen)
    # as they were recorded: a window of strain may have cut their start off
    whole = dataset.select([run.name for run in fitted_runs]).runs
    mistaken = [run.name for run in whole if any(doubts_of_start(run))]
    silence: Silence | None = "records" if silent else None
    if not silent and fluid_is_silent(model, batch, current, active):
        silence = "fluid"
    judgement = judge(tolerated, current, active, records, held, silence, mistaken)
    times = other_times(search, carried, judgement) if carried else []
    judgement, instead = held_against_times(judgement, active, carried, times)
    for name in instead:
        search.aliases[name] = (*search.aliases.get(name, ()), FACTOR)
    limits = names_of_limits(model, batch, fitted_runs, current, active)
    for name, other in limits.items():
        search.aliases[name] = (*search.aliases.get(name, ()), other)
    stages = tuple(
        _stage(search, name, bounds, errors_of(records, i), by_mode.get(name))
        for i, name in enumerate(active, start=1)
    )
    spikes = _with_later_ones(spikes, fitted_runs, judgement)
    side_by_side, forms, following = Explanations(), (), NextTests()
    if carried:
        runs = (fitted_runs, held_runs)
        tried = [effect.name for effect in candidates if search.admitted(effect)]
        # what explains the fitted runs and not those held out lacks no curve of the fitted ones
        if judgement.structured and judgement.carries_over:
            forms = free_forms(search, fitted_runs, held_batch, held_runs)
            forms = tuple(one for one in forms if not _predicts_worse(one.error, after))
        side_by_side = explain(
            model, batch, carried, current, runs, held_batch, judgement,
            min((one.criterion for one in times), default=np.inf),
        )  # fmt: skip
        following = next_tests(model, batch, carried, side_by_side, fitted_runs, judgement)
        parts = [(batch, records[: len(fitted_runs)]), (held_batch, judging)]
        records = with_band(model, batch, carried, side_by_side, parts, judgement, tried)
    fluid = _fluid(model, current, [*active, *known])
    return LoopResult(
        verdict=judgement.verdict,
        error_before=errors_of(records, 0),
        error_after=after,
        noise_floor=judgement.left.noise,
        stages=stages,
        remaining={
            "structured": judgement.structured,
            "error": after.fit,
            "noise_floor": judgement.left.noise,
            "outliers": sum(map(len, spikes.values())),
            "outlier_times_s": spikes,
            "probability": judgement.left.probability,
            "resolution": judgement.resolution,
            "noise_known": judgement.noise_known,
            "carries_over": judgement.carries_over,
            "without_fluid": silence is not None,
            "not_judging": list(judgement.not_judging),
            "linear_error": declared.linear_error,
            "autocorrelation": float(np.mean(summary.autocorrelation)),
            "worst_run": judgement.worst.name,
            "worst_run_error": float(judgement.worst.errors[-1]),
            "description": _with_refusals(judgement, search),
            "not_named": {n: text for n, text in search.not_named.items() if n not in active},
        },
        rankings=tuple(search.rankings),
        records=tuple(records),
        declared_parameters=_declared_parameters(declared, current, bounds) | of_law,
        declared_effects=_declared_effects(model, current, bounds, by_mode),
        declared_law=None if differ & {*of_law} else _declared_law(declared, current),
        explanations=side_by_side,
        next_tests=following,
        laws=tried_laws,
        free_form=forms,
        fluid=None if differ else fluid,
        fluid_at_mean=fluid if differ else None,
        seconds=time.perf_counter() - started,
    )


def _predicts_worse(error: ErrorPair, than: ErrorPair) -> bool:
    """Return whether runs that no fit saw speak against what explains those that were fitted."""
    return (error.held_out or 0.0) > (than.held_out or np.inf)


def _split(dataset, fit, held_out, strain, most):
    overlap = [name for name in (fit or ()) if name in held_out]
    if overlap:
        raise InputError(f"The run {overlap[0]!r} is both fitted and held out; choose one.")
    held = dataset.select(list(held_out))
    fitted = dataset.select(
        list(fit) if fit is not None else [n for n in dataset.names if n not in held_out]
    )
    if len(fitted) == 0:
        raise InputError("No run is left to fit. Take some out of held_out.")
    for run in held.runs:
        copied = next((other.name for other in fitted.runs if same_samples(run, other)), None)
        if copied is not None:
            raise InputError(
                f"The held-out run {run.name!r} holds the same samples as the fitted run "
                f"{copied!r}, so it proves nothing. Hold out another, or none."
            )
    if most < FEWEST_LINEAR_SAMPLES:
        raise InputError(
            f"most_samples must be {FEWEST_LINEAR_SAMPLES} or more; got {most}. A law cannot be "
            "told from fewer samples."
        )
    spikes: dict[str, list[float]] = {}
    fitted_runs, held_runs = (
        [
            thin_run(run, _needed(run, most))
            for run in _without_spikes(cut_to_strain(part.runs, strain), spikes)
        ]
        for part in (fitted, held)
    )
    return fitted_runs, held_runs, spikes


def _without_spikes(runs: Sequence[Run], spikes: dict[str, list[float]]) -> Iterator[Run]:
    """Give the runs without the samples that stand alone in them, whose times are noted."""
    for run in runs:
        off = isolated(run.recorded)
        if np.any(off):
            spikes[run.name] = [float(t) for t in run.time[off]]
        yield run.window(~off) if np.any(off) else run


def _with_later_ones(
    spikes: dict[str, list[float]], runs: Sequence[Run], judgement: Judgement
) -> dict[str, list[float]]:
    """Return the times of all outliers: of those that the fit showed too."""
    found = dict(spikes)
    for run, samples in zip(runs, judgement.left.outlier_samples, strict=True):
        if samples:
            times = [float(run.time[i]) for i in samples]
            found[run.name] = sorted([*found.get(run.name, []), *times])
    return found


def _needed(run: Run, most: int) -> int:
    """Return how many samples of a run resolve its stress to `_RESOLVED`."""
    size = float(np.sqrt(np.mean(run.recorded**2)))
    noise = fast_part(run.recorded) / size if size > 0.0 else 0.0
    return int(min(most, max(_FEWEST_KEPT, (noise / _RESOLVED) ** 2)))


def _require_samples(runs: Sequence[Run], declared: DeclaredModel) -> None:
    """Refuse what any law would fit."""
    count, constants = sum(len(run) for run in runs), declared.free_constants
    if count < FEWEST_SAMPLES + constants:
        raise InputError(
            f"The runs to fit ([data] fit) hold {count} samples in all, for {constants} constants "
            f"to be fitted; at least {FEWEST_SAMPLES + constants} are needed to tell a law from "
            "another. Sample more often, or declare the constants."
        )


def _require_possible(declared: DeclaredModel, runs: Sequence[Run]) -> None:
    """Refuse a known effect that the rates of these runs contain already."""
    measured = [run.name for run in runs if run.rate_is_measured]
    for known in declared.effects:
        if measured and isinstance(known.effect, KinematicEffect) and known.effect.shapes_command:
            raise InputError(
                f"The known effect {known.name} lies between the command and the tool, and the "
                f"rate of {measured[0]} was measured at the tool, so it contains it already. Leave "
                "the effect out."
            )


def _require_present(declared: DeclaredModel, present: set[str]) -> None:
    """Refuse an effect by mode that is neither declared nor a candidate."""
    free = {parameter.name for parameter in declared.free_parameters}
    absent = [name for name in declared.by_mode if name not in free and name not in present]
    if absent:
        raise InputError(
            f"by_mode names the effect {absent[0]}, which is neither declared nor a candidate. Add "
            "it to [model] effects or to [loop] effects, or take it out of by_mode."
        )


def _candidates(effects: Sequence[str | AbstractEffect] | str | None) -> list[AbstractEffect]:
    if effects is None:
        return [*named_effects().values(), *library_effects()]
    if effects == "named":
        return [*named_effects().values()]
    if isinstance(effects, str):
        raise InputError(
            f'effects must be a list of names, or "named" for every effect with a name; got '
            f"{effects!r}. Write [{effects!r}] for this one alone."
        )
    if not effects:
        raise InputError("The loop needs at least one candidate effect; got none.")
    made = [make_effect(effect) if isinstance(effect, str) else effect for effect in effects]
    names = [effect.name for effect in made]
    repeated = [name for name in names if names.count(name) > 1]
    if repeated:
        raise InputError(f"The effect {repeated[0]!r} is given twice.")
    return made


def _admission(fitted: Sequence[Run], held: Sequence[Run]):
    """Return which effects are candidates, given the rates.

    Terms that name the rate are none where the loop must extrapolate far in it; what shapes a
    command is none where the rate was measured. Rates are set, or measured, apart from the stress,
    so this looks at no held-out stress.
    """
    measured = any(run.rate_is_measured for run in fitted)
    fastest = max(float(np.max(np.abs(run.rate))) for run in fitted)
    asked = max((float(np.max(np.abs(run.rate))) for run in held), default=0.0)
    far = asked > EXTRAPOLATION * fastest

    def admitted(effect: AbstractEffect) -> bool:
        if isinstance(effect, KinematicEffect):
            return not (measured and effect.shapes_command)
        return not (far and isinstance(effect, ConstitutiveEffect) and effect.explicit_rate)

    return admitted


def _settle(search: Search, runs: Sequence[Run], max_effects: int, say) -> None:
    """Find instrument effects where the strain is small and no law differs from another.

    That holds for fluids that are linear there. Where instrument effects alone do not explain the
    small strains, the fluid may not be, and nothing is settled.
    """
    small = []
    for run in runs:
        if run.flow != "shear" or not run.from_rest or run.protocol.control != "rate":
            continue  # a fluid that flowed before is not at small strain
        reached = np.maximum.accumulate(np.abs(strain_of(run)))
        keep = reached <= LINEAR_STRAIN
        if np.count_nonzero(keep) >= FEWEST_LINEAR_SAMPLES:
            small.append(run.window(keep))
    if len(small) < 2 or max_effects == 0:
        return
    linear = search.restricted(
        small, lambda effect: effect.kind != "constitutive", "at_small_strain"
    )
    if not linear.resume():
        linear.start(by_mode=False)
    linear.run(max_effects, lambda line: say(f"at small strain, {line}"), look_ahead=False)
    if linear.active and linear.explained:
        search.adopt(linear)
        search.checkpoint.save(search)


def _with_refusals(judgement: Judgement, search: Search) -> str:
    """Return the verdict's reasons, with the effects that fitted and cannot be what is missing."""
    refused = [search.not_named[name] for name in sorted(search.refused)]
    if not judgement.structured or not refused:
        return judgement.description
    return f"{judgement.description} {' '.join(f'{text}.' for text in refused)}"


def _stage(search: Search, name: str, bounds, error, by_mode: ConstantByMode | None) -> Stage:
    model, fit = search.model, search.fit
    effect = next(e for e in model.effects if e.name == name)
    parameters = {
        p.name: StageParameter(float(fit.theta[at]), bounds[at], p.unit)
        for p, at in zip(effect.parameters, model.positions(name), strict=True)
    }
    if by_mode is not None:
        parameters[effect.parameters[0].name] = by_mode
    return Stage(
        effect=name,
        kind=effect.kind,
        parameters=parameters,
        aliases=tuple(
            other
            for other in search.aliases.get(name, ())
            if other not in search.active and other not in search.refused
        ),
        error=error,
        evidence=search.support.get(name, 0.0),
        equation=effect.equation,
        source=effect.source,
        check=effect.check,
    )


def _declared_parameters(declared: DeclaredModel, fit: Fit, bounds) -> dict[str, StageParameter]:
    named = {2 + i: p.name for i, p in enumerate(declared.free_parameters)}
    # of several modes only a common factor is fitted, which has no unit
    single = len(declared.modulus) == 1
    constants = {
        0: (MODULUS, declared.modulus[0], "Pa") if single else ("modulus_factor", 1.0, ""),
        1: (RELAXATION_TIME, declared.relaxation_time[0], "s")
        if single
        else ("relaxation_time_factor", 1.0, ""),
    }
    out: dict[str, StageParameter] = {}
    for at in declared.free_positions:
        values = np.array([fit.theta[at], *bounds[at]])
        name, scale, unit = constants.get(at) or (named[at], 1.0, "")
        if at in constants:
            # fitted as the logarithm of a factor
            values = scale * np.exp(values)
        value, low, high = (float(v) for v in values)
        out[name] = StageParameter(value, (low, high), unit)
    return out


def _declared_effects(
    model: AugmentedModel, fit: Fit, bounds, by_mode: Mapping[str, ConstantByMode]
) -> tuple[DeclaredEffect, ...]:
    """Return the known effects with their values in the final model."""
    found = []
    for known in model.declared.effects:
        parameters: dict[str, KnownParameter | ConstantByMode] = {
            p.name: KnownParameter(float(fit.theta[at]), bounds.get(at), p.unit)
            for p, at in zip(known.effect.parameters, model.positions(known.name), strict=True)
        }
        if known.name in by_mode:
            parameters[known.effect.parameters[0].name] = by_mode[known.name]
        found.append(DeclaredEffect(known.name, known.effect.kind, parameters))
    return tuple(found)


def _declared_law(declared: DeclaredModel, fit: Fit) -> Equation | None:
    """Return the declared law with its modes as fitted; None where it cannot be written out."""
    law = declared.law_with(fit.theta[2 : 2 + len(declared.free_parameters)])
    try:
        named, terms = law_parts(law)
    except InputError:
        return None
    return Equation(
        terms,
        tuple(map(float, declared.modulus * np.exp(fit.theta[0]))),
        tuple(map(float, declared.relaxation_time * np.exp(fit.theta[1]))),
        law.linear_relaxation,
        float(declared.solvent_viscosity),
        named=named,
    )


def _fluid(model: AugmentedModel, fit: Fit, active: Sequence[str]) -> Fluid | None:
    """Return the augmented fluid; None where it has a state that a law cannot carry."""
    declared = model.declared
    added = [
        (effect, jnp.asarray(fit.theta[model.positions(effect.name)]))
        for effect in model.effects
        if effect.name in active and isinstance(effect, ConstitutiveEffect)
    ]
    if any(isinstance(effect, StateEffect) for effect, _ in added):
        return None
    base = declared.law_with(fit.theta[2 : 2 + len(declared.free_parameters)])
    law = AugmentedLaw(
        base=base,
        values=tuple(values for _, values in added),
        effects=tuple(effect for effect, _ in added),
        linear_relaxation=base.linear_relaxation,
    )
    one = jnp.ones(1)
    viscosity = declared.solvent_viscosity + sum(
        float(effect.instantaneous_stress(values, one)[0]) for effect, values in added
    )
    modes = [effect.mode(values) for effect, values in added if isinstance(effect, ModeEffect)]
    modulus = declared.modulus * np.exp(fit.theta[0])
    relaxation_time = declared.relaxation_time * np.exp(fit.theta[1])
    return Fluid(
        law,
        np.append(modulus, [float(pair[0]) for pair in modes]),
        np.append(relaxation_time, [float(pair[1]) for pair in modes]),
        viscosity,
    )
