"""Constants that are fitted along with each learner: a gain, a rise time, a factor on moduli.

A learner is given the constants, then the constants are fitted given what it found, in turn, until
they settle. Both learners, and the classical laws, start from the same constants.
"""

import copy
import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from discover.comparison.instrument.corrected import InRecord, corrected
from discover.comparison.outcomes.constant import Constant
from discover.effects import KnownEffect, library_term, make_effect
from discover.errors import InputError
from discover.forward import AugmentedModel, Batch, data_scales, make_batch
from discover.forward.least_squares import Fit, fit_batch, intervals, jacobians
from discover.forward.modulus_errors import modulus_shifts, response
from discover.laws.expansion import law_of_terms
from discover.laws.maxwell import UpperConvectedMaxwell
from discover.laws.multimode import Fluid
from discover.learners.result import LearnerResult
from discover.learners.shorter_holds import with_shorter_holds
from discover.protocols import strains
from discover.statistics import least_squares_covariance, root_of
from discover.study.data import StudyData
from discover.study.declared_model import MODE_CONSTANTS, DeclaredModel, forward_model
from tensor_library.library import TermLibrary

CLASSICAL_EFFECTS: Mapping[str, str] = {
    "johnson_segalman": "non_affine_motion",
    "giesekus": "giesekus_mobility",
    "ptt_linear": "ptt_linear",
    "ptt_exponential": "ptt_exponential",
}
"""The classical laws as effects on a Maxwell law, which one compiled program holds."""

LINEAR_STRAIN = 0.4
"""Up to this strain a Maxwell-type law is linear in start-up to a few per cent of the stress, so
that constants found there owe nothing to any law."""

_FEWEST_LINEAR = 10
_ROUNDS = 3

_TWIN = 0.02
"""Share of a term's signature beyond those of the constants, below which the two are the same."""

_SETTLED = 0.5
"""Change of a constant, in halves of its 95 % interval, that is none: one standard deviation. The
coefficients of a law of terms are fitted with it in any case."""

_GAINED = 0.02
"""Share of the squared misfit that constants must remove to be worth another round."""

_TIME_STARTS = (0.1, 0.3, 1.0, 3.0, 10.0)
_LONGER_TIMES = (1.0, 10.0)
"""A law that thins may relax much more slowly than the Maxwell law that fits best, which comes near
a viscosity that falls with the rate only where it relaxes at once."""

_STRAIN_STEP = 0.1
"""Where times are fitted, the largest strain of a step. In steps of many relaxation times a law
that thins is followed wrongly, and the fit finds constants for which that looks like the record."""

_LARGEST = 10.0
"""Coefficients of terms fitted with constants may be as large as this, or as they were found."""

Train = Callable[[DeclaredModel, StudyData, TermLibrary], tuple[LearnerResult, Fluid]]
"""From a known part without free constants, corrected data and candidate terms."""


@dataclass(frozen=True)
class Learned:
    """What a learner found together with constants.

    Attributes
    ----------
    result, fluid
        What it found.
    constants
        By name.
    rounds
        How often it learned.
    settled
        Whether the constants had settled by then.
    """

    result: LearnerResult
    fluid: Fluid
    constants: Mapping[str, Constant]
    rounds: int
    settled: bool


@dataclass(frozen=True)
class _Given:
    """Constants given a law: values, what they gained, and what is known of a joint fit if any.

    Of that: half intervals of the constants, intervals of all that is fitted, by position, and what
    errors of the moduli change.
    """

    raw: dict[str, float]
    gained: float
    joint: Fit | None = None
    halves: Sequence[float] = ()
    bounds: Mapping[int, tuple[float, float]] = field(default_factory=dict)
    shifts: Float[np.ndarray, "k runs n"] | None = None

    def settled(self, before: Mapping[str, float]) -> bool:
        if self.joint is None:
            return self.gained < _GAINED
        moved = np.abs([self.raw[name] - before[name] for name in self.raw])
        return bool(np.all(moved <= _SETTLED * np.asarray(self.halves)))


class FittedAlong:
    """The constants of a declared model that are fitted along with each learner.

    Parameters
    ----------
    declared
        The known part; what is to be fitted are constants of the modes and of the instrument.
    data
        As recorded.
    library
        The study's candidate terms.

    Raises
    ------
    InputError
        If these runs cannot tell two of the constants apart.
    """

    def __init__(self, declared: DeclaredModel, data: StudyData, library: TermLibrary):
        self.declared, self.data, self.library = declared, data, library
        if not declared.law.linear_relaxation:
            raise InputError(
                "known_relaxation = false leaves the linear law to the learners, so no constant "
                f"({', '.join(declared.free_constants)}) can be fitted along with it. Write "
                "numbers."
            )
        forward = forward_model(declared)
        if not isinstance(declared.law, UpperConvectedMaxwell):
            # one law of terms, whatever its name: no parameter of it is free any more
            forward = replace(forward, law_name="", parameters=(), free_parameters=())
        classical = [make_effect(name) for name in CLASSICAL_EFFECTS.values()]
        names = {effect.name for effect in classical}
        self.terms = [library_term(t) for t in library.terms if t.closed_form is None]
        terms = [term for term in self.terms if term.name not in names]
        self.runs = list(data.fit)
        self.forward = forward
        self.model = AugmentedModel(forward, [*classical, *terms], data_scales(self.runs))

    @cached_property
    def batch(self) -> Batch:
        """The fitted runs; where times are fitted, in short steps and with shorter holds."""
        time = self.declared.relaxation_time
        # an instrument may act by its own clock, as a drift does
        if MODE_CONSTANTS[1] in self.positions and not self.declared.effects:
            # a Maxwell law is linear, and right in steps of any length
            small = AugmentedModel(self.forward, [], data_scales(self.runs))
            modes = [self.positions[name] for name in MODE_CONSTANTS if name in self.positions]
            starts = [start[: len(small.zero())] for start in self._first_starts()[0]]
            alone = self._best(small, starts, [modes] * len(starts), make_batch(self.runs))
            time = time * np.exp(alone.theta[1])
            shorter = with_shorter_holds(self.runs, float(np.max(time)))
            return make_batch(shorter, strain_step=_STRAIN_STEP)
        return make_batch(self.runs)

    @cached_property
    def positions(self) -> dict[str, int]:
        """Positions of the constants in the forward model's vector, by name."""
        found = {name: i for i, name in enumerate(MODE_CONSTANTS) if name in self.declared.free}
        for known in self.declared.effects:
            at = self.model.positions(known.name)
            for parameter, position in zip(known.effect.parameters, at, strict=True):
                if parameter.name in known.free:
                    found[f"{known.name}.{parameter.name}"] = position
        return found

    @property
    def moves_modes(self) -> bool:
        """Whether moduli or relaxation times are among them."""
        return any(name in self.positions for name in MODE_CONSTANTS)

    @property
    def free(self) -> list[int]:
        """Positions of the constants."""
        return list(self.positions.values())

    def raw(self, theta: Float[np.ndarray, " p"]) -> dict[str, float]:
        """Return the constants of a parameter vector, as the forward model has them."""
        return {name: float(theta[at]) for name, at in self.positions.items()}

    def with_values(self, raw: Mapping[str, float]) -> DeclaredModel:
        """Return the declared model with numbers in the place of the constants."""
        modulus = self.declared.modulus * np.exp(raw.get(MODE_CONSTANTS[0], 0.0))
        time = self.declared.relaxation_time * np.exp(raw.get(MODE_CONSTANTS[1], 0.0))
        effects = tuple(_valued(known, raw) for known in self.declared.effects)
        return replace(
            self.declared, modulus=modulus, relaxation_time=time, effects=effects, free=()
        )

    def corrected(
        self, raw: Mapping[str, float]
    ) -> tuple[DeclaredModel, StudyData, Mapping[str, InRecord]]:
        """Return known part, data, and what the instrument makes of them, with these constants."""
        model = self.with_values(raw)
        data, made = corrected(self.data, model.effects)
        return replace(model, effects=()), data, made

    @cached_property
    def alone(self) -> Fit:
        """The constants fitted with the declared law alone, to all samples."""
        return self._best(self.model, *self._first_starts())

    def _first_starts(self) -> tuple[list[np.ndarray], list[list[int]]]:
        starts = [self.model.zero()]
        if MODE_CONSTANTS[1] in self.positions:
            starts = [self.model.zero() for _ in _TIME_STARTS]
            for start, factor in zip(starts, _TIME_STARTS, strict=True):
                start[1] = np.log(factor)
                if MODE_CONSTANTS[0] in self.positions:
                    start[0] = -start[1]  # the viscosity is known better than either
        return starts, [self.free] * len(starts)

    @cached_property
    def classical(self) -> dict[str, Fit]:
        """The classical laws with the constants fitted along, by name of the law."""
        model, fits = self._classical_model, {"ucm": self.alone}
        if model is not self.model:
            fits["ucm"] = self._best(model, [self.alone.theta], [self.free])
        start = fits["ucm"].theta
        longer_times = _LONGER_TIMES if MODE_CONSTANTS[1] in self.positions else (1.0,)
        for law, effect in CLASSICAL_EFFECTS.items():
            at = self.model.positions(effect)
            starts = []
            for share, longer in itertools.product((1.0, 10.0), longer_times):
                theta = start.copy()
                for name, sign in zip(MODE_CONSTANTS, (-1.0, 1.0), strict=True):
                    if name in self.positions:  # the viscosity stays
                        theta[self.positions[name]] += sign * np.log(longer)
                theta[at] = np.clip(
                    share * self.model.first_trial[at], self.model.low[at], self.model.high[at]
                )
                starts.append(theta)
            best = self._best(model, starts, [[*self.free, *at]] * len(starts))
            # constants that stand for one another may have come to their last step in a valley
            fits[law] = self._best(model, [best.theta], [best.free])
        return fits

    @cached_property
    def start(self) -> dict[str, float]:
        """Constants to start from: from small strains, else those of the best classical law."""
        found = self._at_small_strain()
        if found is not None:
            return self.raw(found)
        best = min(self.classical.values(), key=lambda fit: fit.cost)
        return self.raw(best.theta)

    @cached_property
    def twins(self) -> tuple[str, ...]:
        """Terms of the library that do to these records what the constants do."""
        theta = self.model.zero()
        for name, value in self.start.items():
            theta[self.positions[name]] = value
        at = [self.model.positions(term.name)[0] for term in self.terms]
        residual = self.model.residuals([theta], self.batch)
        derivatives = jacobians(self.model, self.batch, [theta], residual, [[*self.free, *at]])[0]
        rows = derivatives.reshape(len(derivatives), -1)
        constants, terms = rows[: len(self.free)], rows[len(self.free) :]
        self._require_told_apart(constants)
        basis, _ = np.linalg.qr(constants.T)
        twins = []
        for term, row in zip(self.terms, terms, strict=True):
            size = float(np.linalg.norm(row))
            if not np.isfinite(size) or size == 0.0:
                continue
            if np.linalg.norm(row - basis @ (basis.T @ row)) < _TWIN * size:
                twins.append(term.name)
        return tuple(twins)

    @property
    def searched(self) -> TermLibrary:
        """The library without the terms that the constants stand for."""
        kept = [i for i, name in enumerate(self.library.names) if name not in self.twins]
        if not kept:
            raise InputError(
                "Every term of the library does to these records what the constants to be fitted "
                f"({', '.join(self.positions)}) do. Write numbers for them, or allow more terms."
            )
        return self.library.subset(kept)

    def learn(self, train: Train) -> Learned:
        """Return what a learner finds with the constants fitted along."""
        raw, rounds, settled = dict(self.start), 0, False
        library = self.searched if self.twins else self.library
        while True:
            rounds += 1
            model, data, _ = self.corrected(raw)
            result, _ = train(model, data, library)
            given = self._given_law(result, raw)
            if given is None:
                break
            settled, raw = given.settled(raw), given.raw
            if settled or rounds == _ROUNDS:
                break
        if given is not None and given.joint is not None:
            result = self._with_joint(result, given, given.joint)
        known = self.with_values(raw)
        fluid = Fluid(
            result.law, known.modulus, known.relaxation_time, float(known.solvent_viscosity)
        )
        bounds = {} if given is None else given.bounds
        return Learned(result, fluid, self._constants(raw, bounds), rounds, settled)

    def _given_law(self, result: LearnerResult, raw: Mapping[str, float]) -> "_Given | None":
        """Return the constants given a law; None where it cannot be integrated.

        The coefficients of a sum of terms are fitted with them; other laws stay as they are.
        """
        at: list[int] = []
        names = {term.name for term in self.terms}
        joint = result.learner == "tensor_sindy" and all(t.term in names for t in result.terms)
        if joint:
            at = [self.model.positions(term.term)[0] for term in result.terms]
            start = self._vector(self.model, raw)
            start[at] = [term.coefficient for term in result.terms]
            # a search has no limits, and its steps follow coefficients as large as it found
            model = _with_limits(self.model, at, np.maximum(np.abs(start[at]), _LARGEST))
            free = [*self.free, *at]
        else:
            law = replace(
                self.forward, law=result.law, law_name="", parameters=(), free_parameters=()
            )
            model = AugmentedModel(law, [], data_scales(self.runs))
            free, start = model.free_positions, model.zero()
            start[free] = list(raw.values())
        fit = fit_batch(model, self.batch, [start], [free])[0]
        if not fit.usable:
            return None
        before = float(np.sum(model.residuals([start], self.batch)[0] ** 2))
        values = dict(zip(raw, map(float, fit.theta[free[: len(raw)]]), strict=True))
        gained = 1.0 - fit.cost / before if before > 0.0 else 0.0
        if not joint:
            return _Given(values, gained)
        shifts = modulus_shifts(model, fit.theta, self.batch)
        at = free[len(raw) :]
        bounds = intervals(
            _with_limits(model, at, np.full(len(at), np.inf)), self.batch, fit, shifts
        )
        halves = [0.5 * (bounds[i][1] - bounds[i][0]) for i in self.free]
        return _Given(values, gained, fit, halves, bounds, shifts)

    def _vector(self, model: AugmentedModel, raw: Mapping[str, float]) -> np.ndarray:
        theta = model.zero()
        for name, value in raw.items():
            theta[self.positions[name]] = value
        return theta

    def _at_small_strain(self) -> np.ndarray | None:
        """Return the parameters fitted where every fluid is linear; None with too few samples."""
        weight = np.asarray(self.batch.weight)
        kept = np.zeros_like(weight)
        for row, run in zip(kept, self.runs, strict=True):
            if run.quantity == "sigma12" and run.from_rest:
                strain = strains(run.protocol, run.time) if run.strain is None else run.strain
                small = np.maximum.accumulate(np.abs(strain)) <= LINEAR_STRAIN
                if np.count_nonzero(small) >= _FEWEST_LINEAR:
                    row[: len(run)] = small
        if np.count_nonzero(kept.any(axis=1)) < 2:
            return None
        # weights alone differ, so that the compiled program serves
        batch = eqx.tree_at(lambda b: b.weight, self.batch, jnp.asarray(weight * kept))
        fit = fit_batch(self.model, batch, [self.alone.theta], [self.free])[0]
        return fit.theta if fit.usable else None

    def _require_told_apart(self, constants: Float[np.ndarray, "c rows"]) -> None:
        names = list(self.positions)
        for i, row in enumerate(constants):
            others = np.delete(constants, i, axis=0)
            if not len(others):
                return
            basis, _ = np.linalg.qr(others.T)
            beyond = row - basis @ (basis.T @ row)
            if np.linalg.norm(beyond) < _TWIN * np.linalg.norm(row):
                raise InputError(
                    f"These runs cannot tell {names[i]} from the other constants that are to be "
                    f"fitted ({', '.join(n for n in names if n != names[i])}). Write a number for "
                    "one of them in [model]."
                )

    def _with_joint(self, result: LearnerResult, given: _Given, fit: Fit) -> LearnerResult:
        """Return a sparse law with coefficients and intervals that allow for the constants."""
        at = [self.model.positions(term.term)[0] for term in result.terms]
        terms = tuple(
            replace(
                term,
                coefficient=float(fit.theta[position]),
                ci95=None if term.ci95 is None else given.bounds[position],
            )
            for term, position in zip(result.terms, at, strict=True)
        )
        law = law_of_terms(
            [term.term for term in terms],
            [term.coefficient for term in terms],
            {},
            result.law.linear_relaxation,
            getattr(result.law, "base", None),
        )
        details: dict[str, Any] = {**result.details, **self._uncertainty(fit, given.shifts)}
        drawn = details.get("draws") or {}
        if drawn and drawn.get("method") != "linear":
            reason = "the constants fitted along are not in the draws from its likelihood"
            details["draws"] = {**drawn, "method": "none", "reason": drawn.get("reason") or reason}
        return replace(result, terms=terms, law=law, details=details)

    def _uncertainty(
        self, fit: Fit, shifts: Float[np.ndarray, "k runs n"] | None
    ) -> dict[str, Any]:
        """Return how uncertain the coefficients are, whatever the constants, as searches say it."""
        count = len(self.free)
        if len(fit.free) == count:
            return {"covariance": None, "modulus_errors": None}
        n_runs, n = fit.residual.shape
        rows = np.arange(n_runs * n).reshape(n_runs, n)
        seen = np.asarray(self.batch.weight) > 0
        sequences = [row[kept] for row, kept in zip(rows, seen, strict=True)]
        design = fit.jacobian.reshape(len(fit.free), -1).T
        by_moduli = None
        if shifts is not None and len(shifts):
            by_moduli = shifts.reshape(len(shifts), -1).T
        covariance, _, _ = least_squares_covariance(
            design, fit.residual.ravel(), sequences, by_moduli
        )
        found: dict[str, Any] = {"covariance": covariance[count:, count:].tolist()}
        found["modulus_errors"] = None
        of_modes = self.model.declared.modulus_covariance
        if shifts is not None and by_moduli is not None and of_modes is not None:
            root = root_of(of_modes)
            off = response(fit.jacobian, shifts)[count:]
            found["modulus_errors"] = {"root": root.tolist(), "response": off.tolist()}
        return found

    def value_of(self, name: str, raw: float) -> float:
        """Return a constant in its unit from what the forward model has."""
        if name not in MODE_CONSTANTS:
            return raw
        modes = self.declared.modulus, self.declared.relaxation_time
        own = modes[MODE_CONSTANTS.index(name)]
        return float(np.exp(raw)) * (float(own[0]) if len(own) == 1 else 1.0)

    def _constants(
        self, raw: Mapping[str, float], bounds: Mapping[int, tuple[float, float]]
    ) -> dict[str, Constant]:
        single = len(self.declared.modulus) == 1
        found = {}
        for name, value in raw.items():
            limits = bounds.get(self.positions[name])
            if name in MODE_CONSTANTS:
                unit = ("Pa", "s")[MODE_CONSTANTS.index(name)] if single else ""
                title = name if single else f"{name.rsplit('_', 1)[0]}_factor"
                if limits is not None:
                    limits = self.value_of(name, limits[0]), self.value_of(name, limits[1])
                found[title] = Constant(name, self.value_of(name, value), unit, limits, value)
                continue
            effect, parameter = name.split(".")
            known = next(k.effect for k in self.declared.effects if k.name == effect)
            unit = next(p.unit for p in known.parameters if p.name == parameter)
            found[name] = Constant(name, value, unit, limits, value)
        return found

    @cached_property
    def _classical_model(self) -> AugmentedModel:
        """The forward model in which the declared law is set aside."""
        if isinstance(self.declared.law, UpperConvectedMaxwell):
            return self.model
        plain = replace(self.forward, law=UpperConvectedMaxwell())
        return AugmentedModel(plain, self.model.effects, data_scales(self.runs))

    def _best(
        self,
        model: AugmentedModel,
        starts: Sequence[np.ndarray],
        free: Sequence[Sequence[int]],
        batch: Batch | None = None,
    ) -> Fit:
        batch = self.batch if batch is None else batch
        fits = fit_batch(model, batch, list(starts), free, rivals=True)
        best = min((fit for fit in fits if fit.usable), key=lambda fit: fit.cost, default=fits[0])
        if not best.usable:
            raise InputError(
                "The declared model cannot be integrated through the fitted runs: its stress runs "
                "away. Check its parameters, modes and units."
            )
        return best


def _with_limits(
    model: AugmentedModel, at: Sequence[int], size: Float[np.ndarray, " q"]
) -> AugmentedModel:
    """Return a model in which some parameters may have these sizes."""
    other = copy.copy(model)
    other.low, other.high = model.low.copy(), model.high.copy()
    other.low[at], other.high[at] = -size, size
    return other


def _valued(known: KnownEffect, raw: Mapping[str, float]) -> KnownEffect:
    pairs = zip(known.effect.parameters, known.values, strict=True)
    values = (raw[f"{known.name}.{p.name}"] if value is None else value for p, value in pairs)
    return replace(known, values=tuple(values))
