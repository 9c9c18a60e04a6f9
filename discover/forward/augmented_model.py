"""One model that holds the declared law and every candidate effect, compiled once.

An effect at zero amplitude changes nothing, so a subset of effects is a vector with zeros, never
another program. All trial vectors go through one kernel (`discover.forward.side_by_side`).
"""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from discover.effects import AbstractEffect, ModeEffect
from discover.forward.declared import LARGEST, DeclaredModel, FreeParameter, Structure, decades
from discover.forward.flows import Batch, PeriodicFlows, SteadyFlows, StressFlows, TransientFlows
from discover.forward.program import Predictor, Trials, program_of

# Of the upper end of its range, to which the first trial of a parameter is kept
_TRIAL_SHARE = 0.5

# A steady state is solved for, a transient followed, a periodic state followed again and again
_BY_SPEED = (SteadyFlows, TransientFlows, StressFlows, PeriodicFlows)


_WIDTH = 1e-5
"""Of a parameter, or of its first trial, by which it is moved."""

_BEYOND = 1e-3
"""By how much a move may lengthen the residuals, whose length is an error over the record."""


class Linearised(NamedTuple):
    """Weighted residuals at one vector, not finite where it diverges, and derivatives.

    The derivatives are by the parameters at `positions`, in their units; behind them stand the
    changes with each move of the moduli.
    """

    residual: Float[np.ndarray, "runs n"]
    jacobian: Float[np.ndarray, "columns runs n"]
    positions: tuple[int, ...]  # in the vector


class Point(NamedTuple):
    """A vector, the parameters to differentiate by, and its residuals where they are known.

    `limit`: sum of squares beyond which the vector is of no use; see `AugmentedModel.residuals`.
    """

    theta: Float[np.ndarray, " p"]
    positions: Sequence[int] = ()
    residual: Float[np.ndarray, "runs n"] | None = None
    limit: float = np.inf

    @property
    def size(self) -> int:
        """How many vectors are predicted for it."""
        return len(self.positions) + (self.residual is None)


class AugmentedModel:
    """The declared model with a list of effects, as functions of one parameter vector.

    Models that differ in numbers alone share one program for each shape of the runs. The vector
    holds the declared parameters, those of `effects`, of known effects not among these, and last
    the instants at which rates step. `scales`: sizes that scale parameters; see `data_scales`.
    """

    def __init__(
        self,
        declared: DeclaredModel,
        effects: Sequence[AbstractEffect],
        scales: Mapping[str, float] | None = None,
    ):
        self.declared = declared
        names = {effect.name for effect in effects}
        known = (known.effect for known in declared.effects if known.name not in names)
        self.effects = (*effects, *known)
        free = declared.free_parameters
        structure = Structure(
            self.effects,
            tuple(p.name for p in free),
            # a law without free parameters is data; with them, its values are rebuilt
            declared.law_name if free else "",
            declared.parameters if free else (),
            declared.fit_modulus,
            tuple((n, at.start, at.stop) for n, at in declared.by_mode_slices.items()),
            declared.step_instants,
            declared.added_modes,
        )
        every_effect = structure.with_every_effect()
        program = program_of(structure)
        self._predictor = Predictor(declared, program, program_of(every_effect))
        fluid = program.fluid
        self.slices, self.size, self.instants = fluid.slices, fluid.size, fluid.instants
        parameters = [p for effect in self.effects for p in effect.parameters]
        sizes = {"one": 1.0} | dict(scales or {})
        units = [sizes.get(p.range_scale, 1.0) for p in parameters]
        lows = [p.low * unit for p, unit in zip(parameters, units, strict=True)]
        highs = [p.high * unit for p, unit in zip(parameters, units, strict=True)]
        varying = [LARGEST] * (declared.size - 2 - len(free))
        steps = declared.step_instants
        before = [-10.0, -10.0, *(p.low for p in free), *np.negative(varying)]
        self.low = np.array([*before, *lows, *[0.0] * steps])
        self.high = np.array(
            [10.0, 10.0, *(p.high for p in free), *varying, *highs, *[1.0] * steps]
        )
        trials = [p.first_trial * sizes.get(p.scale, 1.0) for p in parameters]
        # well inside the range, whatever the data's own size suggests
        trials = [
            float(np.clip(trial, max(low, _TRIAL_SHARE * low), _TRIAL_SHARE * high))
            for trial, low, high in zip(trials, lows, highs, strict=True)
        ]
        first = [0.01] * (2 + len(free)) + [1.0] * len(varying)
        self.first_trial = np.array([*first, *trials, *[0.5] * steps])

    def zero(self) -> Float[np.ndarray, " p"]:
        """Return the vector with amplitudes zero and inner parameters at start; rates step halfway.

        Known effects have their values, and where these are fitted, a first trial.
        """
        theta = np.zeros(self.size)
        theta[self.instants] = self.first_trial[self.instants]
        for i, parameter in enumerate(self.declared.free_parameters):
            theta[2 + i] = parameter.start
        for effect in self.effects:
            for i in range(1, len(effect.parameters)):
                position = self.slices[effect.name].start + i
                theta[position] = self.first_trial[position]
        for known in self.declared.effects:
            for position, value in zip(self.positions(known.name), known.values, strict=True):
                theta[position] = self.first_trial[position] if value is None else value
        return theta

    @property
    def free_positions(self) -> list[int]:
        """Positions of what is fitted of the declared model, its known effects included."""
        free = self.declared.free_positions
        for known in self.declared.effects:
            pairs = zip(self.positions(known.name), known.values, strict=True)
            free += [position for position, value in pairs if value is None]
        return [*free, *range(self.instants.start, self.instants.stop)]

    def positions(self, name: str) -> list[int]:
        """Return the positions of an effect's parameters in the vector."""
        at = self.slices[name]
        return list(range(at.start, at.stop))

    def varying(self, name: str) -> list[int]:
        """Return the positions of what varies a constant by mode; none where it is no such one."""
        at = self.declared.by_mode_slices.get(name, slice(0))
        return list(range(at.start or 0, at.stop))

    @property
    def adding_modes(self) -> list[str]:
        """Names of the effects whose modes have constants by mode of their own."""
        if not self.declared.added_modes:
            return []
        return [effect.name for effect in self.effects if isinstance(effect, ModeEffect)]

    def mode_times(self, theta: Float[np.ndarray, " p"]) -> Float[np.ndarray, " k"]:
        """Return the times in s of the modes that have constants by mode, added ones last."""
        return np.append(self.declared.relaxation_time * np.exp(theta[1]), self._added_times(theta))

    def mode_places(self, theta: Float[np.ndarray, " p"]) -> Float[np.ndarray, " k"]:
        """Return log10(λ/λ̄) of these modes; see `decades`."""
        modulus, times = jnp.asarray(self.declared.modulus), self.declared.relaxation_time
        places = np.asarray(decades(modulus, jnp.asarray(times)))
        added = self._added_times(theta)
        if not added:
            return places
        scaled = jnp.asarray(times * np.exp(theta[1]))
        return np.append(places, decades(modulus, scaled, jnp.asarray(added), beyond=True))

    def _added_times(self, theta: np.ndarray) -> list[float]:
        adding = [effect for effect in self.effects if effect.name in self.adding_modes]
        at = {e: jnp.asarray(theta[self.positions(e.name)]) for e in adding}
        modes = (e.mode(values) for e, values in at.items() if isinstance(e, ModeEffect))
        return [float(time) for _, time in modes]

    def constant(self, name: str) -> tuple[FreeParameter, int]:
        """Return a constant by mode, of the law or the amplitude of an effect, and its position."""
        for i, parameter in enumerate(self.declared.free_parameters):
            if parameter.name == name:
                return parameter, 2 + i
        at = self.slices[name].start
        start, low, high = (float(of[at]) for of in (self.first_trial, self.low, self.high))
        return FreeParameter(name, start, low, high), at

    def predict(self, theta, batch: Batch) -> Float[np.ndarray, "runs n"]:
        """Return the predicted records: stresses or moduli in Pa, or strains at a given stress."""
        return self.predictions([theta], batch)[0]

    def predictions(
        self,
        thetas: Sequence[np.ndarray] | np.ndarray,
        batch: Batch,
        moduli: Float[np.ndarray, "trials c"] | None = None,
    ) -> Float[np.ndarray, "trials runs n"]:
        """Return the predicted records of parameter vectors.

        `moduli`: of the declared modes in Pa for each vector, and behind them the viscosity of the
        solvent in Pa s; as declared by default. One that an error of a sweep moves may be negative.
        """
        return self._predicted(thetas, batch, moduli, normal=False)[..., 0]

    def observables(
        self,
        thetas: Sequence[np.ndarray] | np.ndarray,
        batch: Batch,
        moduli: Float[np.ndarray, "trials c"] | None = None,
    ) -> Float[np.ndarray, "trials runs n 3"]:
        """Return the predicted records, N1 = σ11 − σ22 and N2 = σ22 − σ33 in Pa, as in `OBSERVED`.

        All come from one integration. N1 and N2 are NaN where a test has none, as a sweep.
        """
        return self._predicted(thetas, batch, moduli, normal=True)

    def _predicted(self, thetas, batch: Batch, moduli, normal: bool):
        trials = self._trials(thetas, moduli=moduli)
        out = np.zeros((len(thetas), *batch.recorded.shape, 3 if normal else 1))
        for i, rows in enumerate(batch.rows):
            found = self._predictor.of_part(trials, batch, i, normal)
            out[:, rows, : found.shape[2]] = found
        return out

    @cached_property
    def moduli(self) -> Float[np.ndarray, " c"]:
        """Moduli of the declared modes in Pa, and behind them the viscosity of the solvent."""
        return np.append(self.declared.modulus, float(self.declared.solvent_viscosity))

    def _trials(self, thetas, limits: Any = np.inf, moduli=None) -> Trials:
        if moduli is None:
            moduli = np.broadcast_to(self.moduli, (len(thetas), len(self.moduli)))
        limits = np.broadcast_to(limits, len(thetas))
        return Trials(np.asarray(thetas, dtype=float), moduli, limits)

    def residuals(
        self,
        thetas: Sequence[np.ndarray] | np.ndarray,
        batch: Batch,
        limits: Float[np.ndarray, " trials"] | None = None,
        moduli: Float[np.ndarray, "trials c"] | None = None,
    ) -> Float[np.ndarray, "trials runs n"]:
        """Return the weighted residuals of parameter vectors; not finite where one fails.

        Those of runs that are loadings of their own are what the factors of these leave.

        `limits`: sums of squares from which on a vector is of no use: its residuals are infinite,
        its runs not followed to the end, and slower tests not asked for.
        """
        if limits is None:
            return batch.records.residual(self.predictions(thetas, batch, moduli))
        trials, sums = self._trials(thetas, limits, moduli), np.zeros(len(thetas))
        out = np.zeros((len(thetas), *batch.recorded.shape))
        # a factor may lessen what a loading leaves on the way
        ahead = np.inf if batch.records.loadings is not None else 1.0
        parts = sorted(enumerate(batch.parts), key=lambda one: _BY_SPEED.index(type(one[1])))
        for i, _ in parts:
            asked = np.flatnonzero(sums < limits)
            if not len(asked):
                break
            left = ahead * (limits[asked] - sums[asked])
            some = trials.taken(asked)._replace(limits=left)
            found = self._predictor.of_part(some, batch, i)[..., 0]
            rows, n = batch.rows[i], found.shape[2]
            off = batch.records.of_runs(rows, n).residual(found)
            out[np.ix_(asked.tolist(), rows, range(n))] = off
            with np.errstate(over="ignore", invalid="ignore"):  # a trial that ran away
                sums[asked] += np.sum(off**2, axis=(1, 2))
        out[~(sums < limits)] = np.inf  # what is not a number among them
        return out

    def linearise(
        self,
        theta: Float[np.ndarray, " p"],
        batch: Batch,
        positions: Sequence[int] = (),
        moves: Float[np.ndarray, "m c"] | None = None,
    ) -> Linearised:
        """Return the weighted residuals of a vector and their one-sided differences, from one call.

        `positions`: parameters to differentiate by. `moves`: of the moduli in Pa and of the solvent
        in Pa s; half the difference between each move and its opposite stands behind the
        derivatives.
        """
        if moves is None or not len(moves):
            return linearised(self, [Point(theta, positions)], batch)[0]
        widths = widths_of(self, theta, positions)
        vectors = np.tile(theta, (1 + len(widths) + 2 * len(moves), 1))
        vectors[np.arange(1, 1 + len(widths)), list(positions)] += widths
        still = np.zeros((1 + len(widths), len(self.moduli)))
        moduli = self.moduli + np.concatenate([still, moves, -np.asarray(moves)])
        found = self.residuals(vectors, batch, moduli=moduli)
        base, moved, up, down = np.split(found, np.cumsum([1, len(widths), len(moves)]))
        with np.errstate(invalid="ignore", over="ignore"):  # what ran away
            by_parameters = (moved - base) / widths[:, None, None]
            jacobian = np.concatenate([by_parameters, 0.5 * (up - down)])
        return Linearised(base[0], jacobian, tuple(positions))


def widths_of(
    model: Any, theta: Float[np.ndarray, " p"], positions: Sequence[int]
) -> Float[np.ndarray, " positions"]:
    """Return by how much parameters are moved for a derivative, away from an upper bound."""
    at = list(positions)
    width = _WIDTH * np.maximum(np.abs(theta[at]), model.first_trial[at])
    return np.where(theta[at] + width > model.high[at], -width, width)


def linearised(model: Any, points: Sequence[Point], batch: Batch) -> list[Linearised]:
    """Return residuals and derivatives at several vectors, from one call of an `AugmentedModel`."""
    vectors, limits, widths = [], [], []
    for point in points:
        widths.append(widths_of(model, point.theta, point.positions))
        if point.residual is None:
            vectors.append(point.theta)
        for position, width in zip(point.positions, widths[-1], strict=True):
            moved = point.theta.copy()
            moved[position] += width
            vectors.append(moved)
        limits += [(np.sqrt(point.limit) + _BEYOND) ** 2] * point.size
        if point.residual is None:
            limits[-point.size] = point.limit
    if not vectors:
        none = (np.zeros((0, *np.asarray(point.residual).shape)) for point in points)
        return [_of(*one) for one in zip(points, none, widths, strict=True)]
    known = np.array(limits)
    ended = () if np.all(np.isinf(known)) else (known,)
    found = model.residuals(np.array(vectors), batch, *ended)
    ends = np.cumsum([point.size for point in points])[:-1]
    each = zip(points, np.split(found, ends), widths, strict=True)
    return [_of(point, rows, width) for point, rows, width in each]


def _of(point: Point, rows: np.ndarray, widths: np.ndarray) -> Linearised:
    base, moved = (rows[0], rows[1:]) if point.residual is None else (point.residual, rows)
    with np.errstate(invalid="ignore", over="ignore"):  # what ran away
        jacobian = (moved - base) / widths[:, None, None]
    return Linearised(base, jacobian, tuple(point.positions))
