"""Which of several named laws the fitted runs ask for, before any effect is added."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from discover.closed_loop.judging.before_after import errors_of, record_runs
from discover.closed_loop.results.error_pair import ErrorPair
from discover.closed_loop.results.law_fit import LawFit
from discover.closed_loop.search import Search
from discover.closed_loop.search.first_starts import first_starts
from discover.dataset import Run
from discover.effects import AbstractEffect, KnownEffect
from discover.errors import InputError
from discover.forward import (
    MODULUS,
    RELAXATION_TIME,
    AugmentedModel,
    DeclaredModel,
    data_scales,
    make_batch,
)
from discover.inference.evidence import BARE_MENTION, criterion
from discover.inference.least_squares import Fit, best_of, fit_batch
from discover.inference.problem import effect_of
from discover.inference.step_instants import with_own_instants
from discover.laws import LAWS
from discover.laws.registry import starting_values
from discover.statistics.residual import judged_cost, summarise
from discover.words import unknown_name

_AT_END = 1e-3
"""Share of its range within which a constant stands at an end."""


def choose_law(
    declared: DeclaredModel,
    names: Sequence[str],
    fitted: Sequence[Run],
    held_out: Sequence[Run],
    say: Callable[[str], None],
    beside: Sequence[tuple[AbstractEffect, np.ndarray]] = (),
) -> tuple[DeclaredModel, tuple[LawFit, ...]]:
    """Return the declared model with the law that the fitted runs ask for, and all that were tried.

    Every law has all its constants fitted, beside what else of the declared model is. The chosen
    one has the lowest information criterion; runs held out have no part in it.

    Parameters
    ----------
    declared
        Modes, solvent and known effects, which every law shares.
    names
        Of the laws, keys of `LAWS`.
    say
        Called with a line of text for each law.
    beside
        Effects that were found, with their values, from which they are fitted along with every law;
        they are no part of the model that is returned.

    Raises
    ------
    InputError
        If a name is none, or no law can be integrated through the fitted runs.
    """
    unknown = [name for name in names if name not in LAWS]
    if unknown or not names:
        raise InputError(
            unknown_name("law", unknown[0], LAWS)
            if unknown
            else f"No law is named to choose from; write some of {', '.join(LAWS)}."
        )
    batch, scales = make_batch(fitted), data_scales(fitted)
    along = tuple(KnownEffect(effect, (None,) * len(values)) for effect, values in beside)
    with_effects = replace(declared, effects=(*declared.effects, *along))
    found: dict[str, tuple[AugmentedModel, Fit]] = {}
    for name in _contained_first(names):
        say(f"law {len(found) + 1} of {len(names)}: {LAWS[name].title}")
        model = AugmentedModel(with_law(with_effects, name), [], scales, fitted=batch)
        starts = first_starts(model, nothing_known=True)
        for effect, values in beside:
            for start in starts:
                start[model.positions(effect.name)] = values
        starts += _starts_at_contained(model, found)
        free = [model.free_positions] * len(starts)
        fits = fit_batch(model, batch, starts, free)
        found[name] = model, best_of(fits) or fits[0]
    tried = list(found.values())
    best = best_of(fit for _, fit in tried)
    if best is None:
        raise InputError(
            f"None of the laws {', '.join(names)} can be integrated through the fitted runs: their "
            "stress runs away. Check modes and units."
        )
    weight = np.asarray(batch.weight)
    effective = summarise(best.residual, weight).effective_samples
    costs = [judged_cost(fit.residual, weight) if fit.usable else np.inf for _, fit in tried]
    criteria = [
        criterion(cost, len(fit.free), 0, effective, 1) if fit.usable else np.inf
        for cost, (_, fit) in zip(costs, tried, strict=True)
    ]
    order = np.argsort(criteria, kind="stable")
    first, lines = order[0], []
    for i in order:
        model, fit = tried[i]
        line = _found(model, fit)
        if fit.usable:
            line = replace(
                line,
                error=_errors(model, fit, fitted, held_out),
                behind=float(criteria[i] - criteria[first]),
                is_told_apart=bool(effective * np.log(costs[i] / costs[first]) > BARE_MENTION),
            )
        lines.append(line)
    say(f"of {len(lines)} laws the runs ask for {lines[0].title}")
    return with_law(declared, lines[0].law, lines[0].parameters), tuple(lines)


def law_beside_effects(
    declared: DeclaredModel,
    tried: Sequence[LawFit],
    search: Search,
    fitted: Sequence[Run],
    held_out: Sequence[Run],
    say: Callable[[str], None],
) -> tuple[DeclaredModel | None, tuple[LawFit, ...]]:
    """Return the law that the runs ask for beside the effects that were found, and all of them.

    The first law was chosen while these effects were missing, and may have stood for a part of
    them: White–Metzner for a structure that flow breaks. None where it stays; its constants beside
    the effects are others all the same. The best of the laws stands first.
    """
    model = search.model
    found = [
        (effect_of(model, name), search.fit.theta[model.positions(name)]) for name in search.active
    ]
    say("the laws once more, beside the effects that were found")
    names = [one.law for one in tried]
    chosen, lines = choose_law(declared, names, fitted, held_out, say, found)
    before = next(one for one in lines if one.law == declared.law_name)
    if before.behind is not None and before.behind <= BARE_MENTION:
        return None, lines
    return chosen, lines


def taken_first(lines: Sequence[LawFit], law: str) -> tuple[LawFit, ...]:
    """Return laws that were fitted with the one that is taken first, from which others are told."""
    taken = next(one for one in lines if one.law == law)
    least = taken.behind or 0.0
    others = [
        replace(
            one,
            behind=None if one.behind is None else max(one.behind - least, 0.0),
            is_told_apart=one.is_told_apart and (one.behind is None or one.behind > least),
        )
        for one in lines
        if one is not taken
    ]
    return replace(taken, behind=0.0), *others


def _contained_first(names: Sequence[str]) -> list[str]:
    """Return each name once, a law after those of them that it contains."""
    left, order = list(dict.fromkeys(names)), []
    while left:
        ready = [name for name in left if not set(LAWS[name].contains) & set(left)]
        order += ready or left
        left = [name for name in left if name not in order]
    return order


def _starts_at_contained(
    model: AugmentedModel, found: Mapping[str, tuple[AugmentedModel, Fit]]
) -> list[np.ndarray]:
    """Return the fits of the laws that this one contains, as vectors of its own.

    A law then fits no worse than those, wherever other starts end.
    """
    declared, starts = model.declared, []
    for name, fixed in LAWS[declared.law_name].contains.items():
        if name not in found or not found[name][1].usable:
            continue
        below, fit = found[name]
        count = len(below.declared.free_parameters)
        known = {p.name: fit.theta[2 + i] for i, p in enumerate(below.declared.free_parameters)}
        start = model.zero()
        start[:2] = fit.theta[:2]
        for i, parameter in enumerate(declared.free_parameters):
            start[2 + i] = {**known, **fixed}.get(parameter.name, start[2 + i])
        # known effects stand behind the constants of either law, in one order
        start[2 + len(declared.free_parameters) :] = fit.theta[2 + count :]
        starts.append(start)
    return starts


def with_law(
    declared: DeclaredModel, name: str, values: Mapping[str, float] | None = None
) -> DeclaredModel:
    """Return the declared model with another law, all of whose constants are fitted."""
    factors = {MODULUS: declared.fit_modulus, RELAXATION_TIME: declared.fit_relaxation_time}
    return DeclaredModel.named(
        name,
        starting_values(name) if values is None else values,
        declared.modulus,
        declared.relaxation_time,
        free=[*LAWS[name].parameters, *(factor for factor, free in factors.items() if free)],
        solvent_viscosity=declared.solvent_viscosity,
        linear_error=declared.linear_error,
        linear_pattern=declared.linear_pattern,
        modulus_covariance=declared.modulus_covariance,
        effects=declared.effects,
        step_instants=declared.step_instants,
    )


def _found(model: AugmentedModel, fit: Fit) -> LawFit:
    declared, values, ends = model.declared, {}, []
    for i, parameter in enumerate(declared.free_parameters):
        value = values[parameter.name] = float(
            np.clip(fit.theta[2 + i], parameter.low, parameter.high)
        )
        room = _AT_END * (parameter.high - parameter.low)
        if min(value - parameter.low, parameter.high - value) < room:
            ends.append(parameter.name)
    return LawFit(declared.law_name, values, tuple(ends))


def _errors(model, fit: Fit, fitted: Sequence[Run], held_out: Sequence[Run]) -> ErrorPair:
    records = []
    # a law may run away in a held-out flow; its error is then none
    with np.errstate(over="ignore", invalid="ignore"):
        for runs, held in ((fitted, False), (held_out, True)):
            if runs:
                own = with_own_instants(model, fit.theta, runs) if held else runs
                records += record_runs(model, make_batch(own), own, [fit.theta], held_out=held)
        return errors_of(records, 0)
