"""Predictions of parameter vectors for each part of a batch, in one kernel where there is one."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import Float

from discover.forward.batches import (
    Batch,
    Flows,
    PeriodicFlows,
    Places,
    Records,
    StressFlows,
    TransientFlows,
)
from discover.forward.declared import DeclaredModel, Numbers
from discover.forward.program import Program
from discover.forward.side_by_side import Asked
from discover.programs import in_threads, on_device
from discover.protocols.kinematics import RecordedQuantity, kinematics_recording

# Of the batches that were laid out for the program
_KEPT = 8

_NORMAL: tuple[RecordedQuantity, RecordedQuantity] = ("N1", "N2")


class Trials(NamedTuple):
    """Parameter vectors side by side, and the moduli and the limit of each."""

    thetas: Float[np.ndarray, "trials p"]
    moduli: Float[np.ndarray, "trials c"]
    limits: Float[np.ndarray, " trials"]

    def taken(self, which: np.ndarray) -> "Trials":
        """Return some of them."""
        return Trials(*(each[which] for each in self))


_Piece = tuple[Flows, Records | None, int]
"""Flows that a program follows at once, what judges them on the way, and how many of the runs are
no padding."""


class Predictor:
    """Predictions of a declared model with effects, part by part of a batch.

    `program`, `of_every_effect`: compiled of the effects that there are, and of all there may be.
    """

    def __init__(self, declared: DeclaredModel, program: Program, of_every_effect: Program):
        self._declared = declared
        self.program, self.of_every_effect = program, of_every_effect
        self._laid_out: list[tuple[TransientFlows, Records, _Piece]] = []

    @cached_property
    def _numbers(self) -> Numbers:
        declared = self._declared
        return Numbers(
            declared.law,
            on_device(declared.modulus),
            on_device(declared.relaxation_time),
            on_device(float(declared.solvent_viscosity)),
        )

    @cached_property
    def _beside_every_effect(self) -> tuple[list[int], list[int], np.ndarray]:
        """What of a vector counts, where it stands beside all effects, and all of them at rest."""
        own, every = self.program.fluid, self.of_every_effect.fluid
        at_rest = np.zeros(every.size)
        for effect in every.structure.effects:
            inner = [parameter.first_trial for parameter in effect.parameters[1:]]
            at_rest[every.slices[effect.name]] = [0.0, *inner]
        # no trial passes through a factor on the moduli that is not fitted
        here = [*range(0 if self._declared.fit_modulus else 1, own.of_effects.start)]
        there = [*here, *range(every.instants.start, every.instants.stop)]
        here += range(own.instants.start, own.instants.stop)
        for name, at in own.slices.items():
            here += range(at.start, at.stop)
            there += range(every.slices[name].start, every.slices[name].stop)
        return here, there, at_rest

    def of_part(
        self, trials: Trials, batch: Batch, number: int, normal: bool = False
    ) -> Float[np.ndarray, "trials rows n kinds"]:
        """Return the records of a part, and if `normal` N1 and N2: NaN where a test has none."""
        part = batch.parts[number]
        if isinstance(part, PeriodicFlows):
            found = _of_sweeps(self._of_piece(trials, (part, None, 0), False), batch.moduli)
            found = found[..., None]
            return np.pad(found, [*[(0, 0)] * 3, (0, 2 * normal)], constant_values=np.nan)
        if not isinstance(part, TransientFlows):
            return self._of_piece(trials, (part, None, 0), normal)
        found = self._of_piece(trials, self._piece(part, batch, batch.rows[number]), normal)
        runs, samples = part.sample_index.shape
        return found[:, :runs, :samples]

    def side_by_side(self, part: Flows) -> Any:
        """Return what predicts many vectors of a part at once; None where nothing does."""
        return self.of_every_effect.side_by_side(self._numbers, part)

    def _of_piece(
        self, trials: Trials, piece: _Piece, normal: bool
    ) -> Float[np.ndarray, "trials runs *n_and_kinds"]:
        program, (part, judging, runs) = self.program, piece
        judged = program.are_judged_by_modes(trials.thetas)
        trials = trials._replace(limits=np.where(judged, trials.limits, np.inf))
        kernel = self.side_by_side(part)
        if kernel is None:
            return self._one_by_one(trials, part, normal)
        here, there, at_rest = self._beside_every_effect
        vectors = np.tile(at_rest, (len(trials.thetas), 1))
        vectors[:, there] = trials.thetas[:, here]
        beside = trials._replace(thetas=vectors)
        alone = np.zeros(len(vectors), bool)
        if isinstance(part, PeriodicFlows):
            alone = kernel.alone(vectors)
        if np.all(alone):
            return self._one_by_one(trials, part, normal)
        some = beside.taken(~alone)
        asked = Asked(self._numbers, *some, part=part, judging=judging, runs=runs, normal=normal)
        found = kernel.predict(asked)
        if not np.any(alone):
            return found
        out = np.empty((len(alone), *found.shape[1:]))
        out[~alone], out[alone] = found, self._one_by_one(trials.taken(alone), part, normal)
        return out

    def _one_by_one(
        self, trials: Trials, part: Flows, normal: bool
    ) -> Float[np.ndarray, "trials runs *n_and_kinds"]:
        """Return what vectors predict in calls of its own for each."""
        if isinstance(part, PeriodicFlows):
            return self._recorded_one_by_one(trials, part)
        found = [self._recorded_one_by_one(trials, part)]
        for quantity in _NORMAL if normal else ():
            if isinstance(part, StressFlows):
                found.append(np.full_like(found[0], np.nan))
                continue
            flow = kinematics_recording(part.kinematics, quantity, found[0].shape[1])
            found.append(self._recorded_one_by_one(trials, replace(part, kinematics=flow)))
        return np.stack(found, axis=-1)

    def _recorded_one_by_one(
        self, trials: Trials, part: Flows
    ) -> Float[np.ndarray, "trials runs *columns"]:
        program = self.program

        def one(trial: tuple[np.ndarray, np.ndarray, np.float64]) -> np.ndarray:
            theta, moduli, _ = trial
            moduli, solvent = on_device(moduli[:-1]), on_device(float(moduli[-1]))
            numbers = replace(self._numbers, modulus=moduli, solvent_viscosity=solvent)
            return np.asarray(program.predict(numbers, program.fluid.in_use(theta), theta, part))

        shape = (type(part), *(leaf.shape for leaf in jax.tree.leaves(part)))
        found = in_threads(one, zip(*trials, strict=True), is_compiled=shape in program.met)
        program.met.add(shape)
        return np.stack(found)

    def _piece(self, part: TransientFlows, batch: Batch, rows: Sequence[int]) -> _Piece:
        """Return runs, and what judges them, as a program takes them, laid out once."""
        for known, records, piece in self._laid_out:
            if known is part and records is batch.records:
                return piece
        # a kernel passes over what is padding, and a program for each vector would not
        flows = part if self.side_by_side(part) is None else part.in_shared_shape()
        judging = batch.records.of_runs(rows, part.sample_index.shape[1])
        piece = flows, judging.padded(*flows.sample_index.shape), len(rows)
        self._laid_out.append((part, batch.records, piece))
        del self._laid_out[:-_KEPT]
        return piece


def _of_sweeps(
    found: Float[np.ndarray, "trials states 2"], runs: Sequence[Places]
) -> Float[np.ndarray, "trials rows n"]:
    """Return the moduli of each run, of those of all states; zero behind a shorter run's last."""
    out = np.zeros((len(found), len(runs), max(len(places) for _, places in runs)))
    for row, (modulus, places) in enumerate(runs):
        out[:, row, : len(places)] = found[:, list(places), modulus]
    return out
