"""Predictions of parameter vectors for each part of a batch, from one kernel."""

from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from discover.forward.batches import (
    Batch,
    Flows,
    PeriodicFlows,
    Places,
    Records,
    TransientFlows,
)
from discover.forward.declared import DeclaredModel, Numbers
from discover.forward.program import Program
from discover.forward.side_by_side import Asked

# Of the batches that were laid out for the program
_KEPT = 8


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
            jnp.asarray(declared.modulus),
            jnp.asarray(declared.relaxation_time),
            jnp.asarray(float(declared.solvent_viscosity)),
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
        """Return what predicts many vectors of a part at once."""
        return self.of_every_effect.side_by_side(self._numbers, part)

    def _of_piece(
        self, trials: Trials, piece: _Piece, normal: bool
    ) -> Float[np.ndarray, "trials runs *n_and_kinds"]:
        program, (part, judging, runs) = self.program, piece
        judged = program.are_judged_by_modes(trials.thetas)
        trials = trials._replace(limits=np.where(judged, trials.limits, np.inf))
        here, there, at_rest = self._beside_every_effect
        vectors = np.tile(at_rest, (len(trials.thetas), 1))
        vectors[:, there] = trials.thetas[:, here]
        beside = trials._replace(thetas=vectors)
        asked = Asked(self._numbers, *beside, part=part, judging=judging, runs=runs, normal=normal)
        return self.side_by_side(part).predict(asked)

    def _piece(self, part: TransientFlows, batch: Batch, rows: Sequence[int]) -> _Piece:
        """Return runs, and what judges them, as a program takes them, laid out once."""
        for known, records, piece in self._laid_out:
            if known is part and records is batch.records:
                return piece
        flows = part.in_shared_shape()
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
