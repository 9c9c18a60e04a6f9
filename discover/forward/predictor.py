"""Predictions of parameter vectors of a declared model with effects, part by part of a batch."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from discover.effects import RadialAverage, Record
from discover.forward.declared import DeclaredModel, Numbers
from discover.forward.flows import (
    Batch,
    Flows,
    PeriodicFlows,
    Places,
    at_radii,
)
from discover.forward.program import Program
from discover.forward.side_by_side import Asked, MadeOnce
from discover.programs import on_device
from discover.protocols.kinematics import normal_stress_differences


class Trials(NamedTuple):
    """Parameter vectors side by side, and the moduli of each."""

    thetas: Float[np.ndarray, "trials p"]
    moduli: Float[np.ndarray, "trials c"]


class Predictor:
    """Predictions of a declared model with effects, part by part of a batch.

    `program`, `of_every_effect`: compiled of the effects that there are, and of all there may be.
    """

    def __init__(self, declared: DeclaredModel, program: Program, of_every_effect: Program):
        self._declared = declared
        self.program, self.of_every_effect = program, of_every_effect
        self._inside = MadeOnce(_inside)

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
        """Return the records of a part, and if `normal` N1 and N2: NaN where a test has none.

        These are as a transducer of force records them that acts sample by sample.
        """
        found, part = self.whole(trials, batch, number, normal), batch.parts[number]
        if not normal:
            return found
        if isinstance(part, PeriodicFlows):
            return np.pad(found, [*[(0, 0)] * 3, (0, 2)], constant_values=np.nan)
        with np.errstate(invalid="ignore", over="ignore"):  # what ran away
            both = normal_stress_differences(part.kinematics, found[..., 1], found[..., 2:6])
        places, still = np.arange(2.0), np.zeros_like(both)
        for effect in self.program.of_force:
            values = trials.thetas[:, self.program.fluid.slices[effect.name]].T[..., *[None] * 3]
            record = Record(places, still, both, np.ones(()))
            both = effect.recorded_stress(values, record)
        return np.concatenate([found[..., :1], both], axis=-1)

    def whole(
        self, trials: Trials, batch: Batch, number: int, whole: bool = True
    ) -> Float[np.ndarray, "trials rows n kinds"]:
        """Return the records of a part, and if `whole` what `Asked` says; sweeps have no more."""
        found = self._at_rim(trials, batch, number, whole)
        for effect in self.program.averages:
            share = trials.thetas[:, self.program.fluid.slices[effect.name].start]
            there = np.flatnonzero(share)
            if not len(there) or (inside := self._inside(batch, number, effect)) is None:
                continue
            flows, weights, at_rim = inside
            some, rim = Trials(*(of[there] for of in trials)), found[there, ..., 0]
            within = self._at_rim(some, flows, number, False)[..., 0]
            within = within.reshape(len(there), len(weights), *rim.shape[1:])
            mean = at_rim * rim + np.einsum("r,tr...->t...", weights, within)
            found[there, ..., 0] = rim + share[there, None, None] * (mean - rim)
        return found

    def _at_rim(
        self, trials: Trials, batch: Batch, number: int, whole: bool
    ) -> Float[np.ndarray, "trials rows n kinds"]:
        """Return the records of a part without what averages over radii."""
        part = batch.parts[number]
        if isinstance(part, PeriodicFlows):
            return _of_sweeps(self._of_runs(trials, part, False), batch.moduli)[..., None]
        return self._of_runs(trials, part, whole)

    def side_by_side(self, part: Flows) -> Any:
        """Return what predicts many vectors of a part at once."""
        return self.of_every_effect.side_by_side(self._numbers, part)

    def _of_runs(
        self, trials: Trials, part: Flows, whole: bool
    ) -> Float[np.ndarray, "trials runs *n_and_kinds"]:
        here, there, at_rest = self._beside_every_effect
        vectors = np.tile(at_rest, (len(trials.thetas), 1))
        vectors[:, there] = trials.thetas[:, here]
        asked = Asked(self._numbers, vectors, trials.moduli, part, whole)
        return self.side_by_side(part).predict(asked)


def _inside(
    batch: Batch, number: int, effect: RadialAverage
) -> tuple[Batch, np.ndarray, float] | None:
    """Return the flows of a part at the radii below the rim, their weights and that of the rim.

    All radii are runs of one batch. None where there are none.
    """
    part, moduli = batch.parts[number], batch.moduli
    is_modulus = isinstance(part, PeriodicFlows)
    weights = np.array(effect.of_modulus if is_modulus else effect.of_stress)
    at = np.flatnonzero(weights[:-1])  # on the axis no modulus has a strain to be measured by
    flows = at_radii(part, np.array(effect.radii)[at])
    if flows is None:
        return None
    if isinstance(part, PeriodicFlows):
        states = len(part.strain)
        moduli = tuple(
            (modulus, tuple(place + k * states for place in places))
            for k in range(len(at))
            for modulus, places in moduli
        )
    parts = tuple(flows if i == number else own for i, own in enumerate(batch.parts))
    return replace(batch, parts=parts, moduli=moduli), weights[at], float(weights[-1])


def _of_sweeps(
    found: Float[np.ndarray, "trials states 2"], runs: Sequence[Places]
) -> Float[np.ndarray, "trials rows n"]:
    """Return the moduli of each run, of those of all states; zero behind a shorter run's last."""
    out = np.zeros((len(found), len(runs), max(len(places) for _, places in runs)))
    for row, (modulus, places) in enumerate(runs):
        out[:, row, : len(places)] = found[:, list(places), modulus]
    return out
