"""The classical laws fitted to the same runs, each a hypothesis with the same instrument."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from discover.comparison.flows import Flow, of_recorded, relative_errors
from discover.comparison.hypotheses import in_flows
from discover.comparison.known_part import Frame
from discover.effects import AbstractEffect, ConstitutiveEffect, make_effect
from discover.forward import DeclaredModel
from discover.inference.fits import Fit, Fitter
from discover.laws import LAWS
from discover.loop.answering import LAW_OF_EFFECT
from discover.loop.loop import SearchOutcome
from discover.loop.task import with_law

_AS_EFFECTS = {"ucm": (), **{law: (effect,) for effect, law in LAW_OF_EFFECT.items()}}
"""Effects that make each law of upper-convected Maxwell."""

_STARTS = (0.03, 0.3)
"""Shares of the range of a constant from which its fits start."""


@dataclass(frozen=True)
class ClassicalFit:
    """Classical law fitted to the training runs, with the effects of the instrument found.

    `misfit`: relative, mean over runs. `criterion`: −2 log evidence above the best of these laws.
    Both None where it cannot be integrated. `errors`: relative, by flow that no fit saw.
    """

    law: str  # key of `LAWS`
    parameters: dict[str, float]  # its constants; empty where it cannot be integrated
    ci95: dict[str, tuple[float, float]]  # their 95 % intervals
    misfit: float | None
    criterion: float | None
    errors: dict[str, dict[str, float | None]]

    @property
    def title(self) -> str:
        """Name as a rheologist writes it, with the constants."""
        return LAWS[self.law].described(self.parameters)


def fit_classical_laws(
    found: SearchOutcome, frame: Frame, further: Sequence[str] = ()
) -> tuple[ClassicalFit, ...]:
    """Fit the classical laws, and `further` ones, to the training runs; test them in other flows.

    The declared law is set aside, and known effects that add a term to it; modes, solvent and
    other known effects stay.
    """
    judged = [flow for flow in frame.flows if flow.kind in ("held_out", "test")]
    best = found.posterior.fits[0][0] if found.posterior.fits else None
    effects = found.posterior.problem.effects
    bench = [] if best is None else [
        effects[name] for name in best.names if not isinstance(effects[name], ConstitutiveEffect)
    ]  # fmt: skip
    tried = _added_to_ucm(found, bench)
    tried |= {name: _of_law(found, name, bench) for name in further if name not in tried}
    least = min(
        (-2.0 * fit.log_evidence for _, fit in tried.values() if _is_sound(fit)), default=0.0
    )
    return tuple(_result(name, *one, judged, least) for name, one in tried.items())


def _with(found: SearchOutcome, law: str) -> DeclaredModel:
    """Return the declared model with a named law in place of all that is a law in it."""
    declared = found.posterior.problem.declared
    kept = tuple(
        known
        for known in declared.effects
        if not (isinstance(known.effect, ConstitutiveEffect) and known.effect.adds_term)
    )
    return with_law(replace(declared, by_mode=(), effects=kept), law)


def _added_to_ucm(
    found: SearchOutcome, bench: Sequence[AbstractEffect]
) -> dict[str, tuple[Fitter, Fit]]:
    """Return the classical laws as effects added to upper-convected Maxwell."""
    declared = _with(found, "ucm")
    names = {name for some in _AS_EFFECTS.values() for name in some}
    problem = found.task.problem(declared, [*map(make_effect, sorted(names)), *bench])
    fitter = Fitter(problem, problem.fitted)
    names = [effect.name for effect in bench]
    owners, starts = [], []
    for law, own in _AS_EFFECTS.items():
        for share in _STARTS if own else (0.0,):
            theta = problem.zero.copy()
            for name in own:
                at = problem.model.positions(name)[0]
                theta[at] = share * min(float(problem.model.high[at]), 1.0)
            owners.append(law)
            starts.append(fitter.start((*own, *names), theta))
    best: dict[str, tuple[Fitter, Fit]] = {}
    for law, fit in zip(owners, fitter.fit(starts), strict=True):
        if law not in best or fit.log_evidence > best[law][1].log_evidence:
            best[law] = fitter, fit
    return best


def _of_law(found: SearchOutcome, name: str, bench: Sequence[AbstractEffect]) -> tuple[Fitter, Fit]:
    """Return any named law in place of the declared one."""
    declared = _with(found, name)
    problem = found.task.problem(declared, bench)
    fitter = Fitter(problem, problem.fitted)
    names = [effect.name for effect in bench]
    starts = [problem.zero]
    for share in _STARTS:
        moved = problem.zero.copy()
        for i, parameter in enumerate(problem.model.declared.free_parameters):
            low, high = float(parameter.low), float(parameter.high)
            if np.isfinite(high):
                moved[2 + i] = low + share * (high - low)
        starts.append(moved)
    fits = fitter.fit([fitter.start(names, theta) for theta in starts])
    return fitter, max(fits, key=lambda fit: fit.log_evidence)


def _is_sound(fit: Fit) -> bool:
    return bool(np.isfinite(fit.log_evidence))


def _result(
    name: str, fitter: Fitter, fit: Fit, judged: Sequence[Flow], least: float
) -> ClassicalFit:
    if not _is_sound(fit):
        nothing = {flow.name: of_recorded(relative_errors(None, flow.reference), flow)
                   for flow in judged}  # fmt: skip
        return ClassicalFit(name, {}, {}, None, None, nothing)
    model, rows = fitter.problem.model, fitter.rows
    assert fit.covariance is not None
    values, ends = {}, {}
    places = {p.name: 2 + i for i, p in enumerate(model.declared.free_parameters)}
    for effect in _AS_EFFECTS.get(name, ()):
        own = fitter.problem.effects[effect].parameters
        places |= {p.name: at for p, at in zip(own, model.positions(effect), strict=True)}
    for constant, at in places.items():
        if constant not in LAWS[name].parameters:
            continue
        values[constant], ends[constant] = float(fit.theta[at]), fit.interval(at)
    off = (rows.recorded - fitter.record(fit)) / rows.size
    misfit = float(np.mean(rows.rms_by_run(off)))
    (predicted,) = in_flows(model, [fit.theta], judged)
    return ClassicalFit(
        name, values, ends, misfit, float(-2.0 * fit.log_evidence - least),
        {flow.name: of_recorded(relative_errors(predicted[flow.key], flow.reference), flow)
         for flow in judged},
    )  # fmt: skip
