"""What a rheologist would fit first: the classical laws, to the same runs with the same modes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float

from discover.comparison.outcomes.flows import (
    QUANTITIES,
    Flow,
    Stresses,
    of_recorded,
    relative_errors,
)
from discover.comparison.outcomes.truth import true_terms
from discover.dataset.run import sizes_of
from discover.identify.side_by_side.many_laws import Contender, fluid_of, predict_laws
from discover.laws.multimode import Fluid
from discover.laws.registry import LAWS
from discover.laws.textbook.maxwell import UpperConvectedMaxwell
from discover.learners.tensor_sindy.selection import extended_bic
from discover.study.declared_model import DeclaredModel
from tensor_library.law_terms import LawTerms

CLASSICAL = ("ucm", "johnson_segalman", "giesekus", "ptt_linear", "ptt_exponential")
"""Named laws with one constant at the most, as `discover.laws.registry.LAWS` spells them."""

_TRIALS = 8
_ROUNDS = 6
"""Each round of `_TRIALS` values narrows a constant's bracket to a third or less. Through what is
left goes a parabola, so that the constant is known better than any noise asks for."""

_SMALLEST = 1e-3
"""A constant below this fraction of its range shows in no flow; trials are geometric from there."""

FLOOR = 1e-5
"""Relative misfit below which data count as reproduced: what the integration promises."""


@dataclass(frozen=True)
class ClassicalFit:
    """A named law fitted to the training runs.

    Attributes
    ----------
    law
        Key of `LAWS`.
    parameters
        The constant that fits best, by name; empty for UCM.
    misfit
        Relative root-mean-square misfit of σ12 over the training samples, each run in units of its
        own size; None where the law cannot be integrated through them.
    criterion
        `extended_bic`, the price being that of five laws; None likewise.
    errors
        Relative L2 errors by flow that no fit saw, then by quantity.
    along
        Constants of modes and instrument that were fitted along with it, by name.
    """

    law: str
    parameters: Mapping[str, float]
    misfit: float | None
    criterion: float | None
    errors: Mapping[str, Mapping[str, float | None]]
    along: Mapping[str, float] = field(default_factory=dict)

    @property
    def title(self) -> str:
        """Name as a rheologist writes it."""
        return LAWS[self.law].title

    @property
    def at_bound(self) -> bool:
        """Whether a constant lies at the upper end of its range, where it is no finding."""
        ranges = LAWS[self.law].parameters
        return any(value > 0.99 * ranges[name][1] for name, value in self.parameters.items())

    def to_json(self) -> dict[str, Any]:
        """Return the fit as ``comparison.json`` holds it."""
        return {
            "parameters": self.parameters,
            "misfit": self.misfit,
            "criterion": self.criterion,
            "at_bound": self.at_bound,
            **({"fitted_along": self.along} if self.along else {}),
            "errors": self.errors,
        }


def fit_classical_laws(
    model: DeclaredModel,
    flows: Sequence[Flow],
    known_relaxation: bool = True,
    independent: float | None = None,
) -> list[ClassicalFit]:
    """Fit the classical laws to σ12 of the training flows and judge them in the others.

    The modes and the solvent are the declared ones; the declared law itself is set aside. Each law
    has one constant, so its misfit is looked at over the whole range that is physical, all laws in
    one program, and again where it is least.

    Parameters
    ----------
    flows
        Training flows, with what was measured, and flows to judge in.
    known_relaxation
        Whether −σ is part of the declared law; where it is not, it is added to each law.
    independent
        How many independent samples the criterion counts, as that of the law to compare with does;
        by default all.
    """
    training = [flow for flow in flows if flow.measured is not None]
    judged = [flow for flow in flows if flow.kind in ("held_out", "test")]
    base = Fluid(
        UpperConvectedMaxwell(known_relaxation),
        model.modulus,
        model.relaxation_time,
        model.solvent_viscosity,
    )
    trials = {name: _first_trials(name) for name in CLASSICAL}
    for left in reversed(range(_ROUNDS)):
        # the flows to judge in come along: a program of their own would take longer to compile
        predicted = _predictions(trials, base, [*training, *judged], known_relaxation)
        misfits = {name: _misfits(rows, training) for name, rows in predicted.items()}
        if left:
            trials = {
                name: _narrowed(values, misfits[name], last=left == 1)
                for name, values in trials.items()
            }
    samples = independent or sum(flow.times.size for flow in training)
    fits = []
    for name, values in trials.items():
        at = int(np.argmin(misfits[name]))
        value, misfit = values[at], float(misfits[name][at])
        if not np.isfinite(misfit):
            nothing = {
                flow.name: of_recorded(relative_errors(None, flow.reference), flow)
                for flow in judged
            }
            fits.append(ClassicalFit(name, {}, None, None, nothing))
            continue
        parameters = {} if value is None else {parameter_of(name): float(value)}
        criterion = extended_bic(max(misfit, FLOOR), samples, len(parameters), 0, len(CLASSICAL))
        errors = {
            flow.name: of_recorded(relative_errors(_stresses(rows[at]), flow.reference), flow)
            for flow, rows in zip(judged, predicted[name][len(training) :], strict=True)
        }
        fits.append(ClassicalFit(name, parameters, misfit, criterion, errors))
    return fits


def parameter_of(name: str) -> str:
    """Return the constant of a classical law."""
    return next(iter(LAWS[name].parameters))


def _first_trials(name: str) -> list[float | None]:
    if not LAWS[name].parameters:
        return [None]
    low, high = LAWS[name].parameters[parameter_of(name)]
    return [low, *(low + (high - low) * np.geomspace(_SMALLEST, 1.0, _TRIALS - 1))]


def _narrowed(
    values: Sequence[float | None], misfits: Float[np.ndarray, " trials"], last: bool
) -> list[float | None]:
    """Return as many trials between the neighbours of the best one.

    The last ones lie about the minimum of the parabola through these three.
    """
    if values[0] is None:
        return list(values)
    tried = np.array(values, dtype=float)
    at = int(np.argmin(misfits))
    around = slice(max(at - 1, 0), at + 2)
    low, high = tried[around][[0, -1]]
    squares = misfits[around] ** 2
    if last and len(squares) == 3 and np.all(np.isfinite(squares)):
        curvature, slope, _ = np.polyfit(tried[around] - tried[at], squares, 2)
        if curvature > 0.0:
            lowest = np.clip(tried[at] - 0.5 * slope / curvature, low, high)
            return [*np.full(len(values) - 1, tried[at]), float(lowest)]
    return [*np.linspace(low, high, len(values))]


def contender(name: str, value: float | None, known_relaxation: bool) -> Contender:
    """Return a classical law with this value of its constant as a sum of terms."""
    parameters = {} if value is None else {parameter_of(name): float(value)}
    terms = true_terms(name, parameters, known_relaxation)
    assert terms is not None  # the classical laws are sums of library terms
    return Contender(name, LawTerms.of(terms))


def _predictions(
    trials: Mapping[str, Sequence[float | None]],
    base: Fluid,
    flows: Sequence[Flow],
    known_relaxation: bool,
) -> dict[str, list[Float[np.ndarray, "trials _ 3"]]]:
    """Return σ12, N1 and N2 of every trial by law and flow; not finite where one runs away."""
    laws = [contender(name, value, known_relaxation) for name in trials for value in trials[name]]
    protocols, times = [flow.protocol for flow in flows], [flow.times for flow in flows]
    predicted = predict_laws(fluid_of(laws, base), protocols, times)
    out, start = {}, 0
    for name, values in trials.items():
        rows = predicted[start : start + len(values)]
        out[name] = [rows[:, i, : flow.times.size] for i, flow in enumerate(flows)]
        start += len(values)
    return out


def _misfits(
    predicted: Sequence[Float[np.ndarray, "trials _ 3"]], training: Sequence[Flow]
) -> Float[np.ndarray, " trials"]:
    """Return the relative misfit of every trial; infinite where it runs away."""
    squares = np.zeros(len(predicted[0]))
    for flow, rows in zip(training, predicted, strict=False):  # judged flows follow
        assert flow.measured is not None
        size = sizes_of(flow.measured, flow.protocol)
        off = flow.weight * (rows[:, :, 0] - flow.measured) / size
        squares += np.sum(off**2, axis=1)
    misfit = np.sqrt(squares / sum(flow.times.size for flow in training))
    return np.where(np.isfinite(misfit), misfit, np.inf)


def _stresses(row: Float[np.ndarray, "n 3"]) -> Stresses | None:
    return dict(zip(QUANTITIES, row.T, strict=True)) if np.all(np.isfinite(row)) else None
