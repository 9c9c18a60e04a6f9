"""Runs at a given stress of many vectors of parameters, eight side by side."""

from collections.abc import Callable

import jax
import numpy as np
from jaxtyping import Float

from discover.effects import SignalEffect
from discover.forward.augmented_fluid import AugmentedFluid
from discover.forward.batches import Records, StressFlows
from discover.forward.side_by_side.code import in_whole_eights
from discover.forward.side_by_side.step import Flags
from discover.forward.side_by_side.stress_code import StressCode
from discover.forward.structure import Numbers
from discover.programs import compiled, in_threads
from discover.programs.lanes import LANES
from discover.protocols.kinematics import normal_stress_differences


class StressSideBySide:
    """Predictions of strains for one structure of law and effects.

    `fluid`, `code`: the fluid with its effects, and its machine code. `driven`: of a vector and a
    run: the true stress at step ends in Pa, the inertia of the tool in Pa s², and the strain of
    what gives way in series. `made_from`: what tells these from those of another structure.
    """

    def __init__(self, fluid: AugmentedFluid, code: StressCode, driven: Callable, made_from: tuple):
        self._code, self._flags = code, Flags(fluid)
        at = fluid.slices
        signal = [e for e in fluid.structure.effects if isinstance(e, SignalEffect)]
        self._driving = [at[e.name].start for e in (*signal, *fluid.series)]
        self._packed = code.packing(fluid, made_from, -1)
        of_trials = jax.vmap(jax.vmap(driven, (None, 0)), (0, None))
        self._driven = compiled(of_trials, ("driven", *made_from))

    def predict(
        self,
        numbers: Numbers,
        thetas: Float[np.ndarray, "trials p"],
        moduli: Float[np.ndarray, "trials c"],
        limits: Float[np.ndarray, " trials"],
        part: StressFlows,
        judging: Records | None,
        runs: int,
        normal: bool,
    ) -> Float[np.ndarray, "trials runs n kinds"]:
        """Return strains, and N1 and N2 behind them if asked for; see `SideBySide.predict`.

        Limits, what judges and how many runs are no padding say nothing here.
        """
        del limits, judging, runs
        flags = self._flags.of(thetas)
        # those that need the same parts of the code go together
        order = np.lexsort(flags.T)
        sample = np.asarray(part.sample_index)
        out = np.empty((len(thetas), *sample.shape, 3 if normal else 1))

        def eight(trials: np.ndarray) -> None:
            lanes = trials[in_whole_eights(len(trials))]
            used = np.any(flags[trials], axis=0)
            found = self._eight(numbers, thetas[lanes], moduli[lanes], part, used, normal)
            out[trials] = found[: len(trials)]

        in_threads(eight, np.split(order, range(LANES, len(order), LANES)), is_compiled=True)
        return out

    def _eight(
        self, numbers: Numbers, thetas, moduli, part: StressFlows, used, normal: bool
    ) -> np.ndarray:
        """Return what is recorded of eight vectors, shape (lanes, runs, n, kinds)."""
        modes, shared = (np.asarray(array) for array in self._packed(numbers, thetas, moduli))
        # what effects add is left out where none of the eight has it
        present = np.any(modes[:, 0] != 0.0, axis=-1)
        present[: len(numbers.modulus)] = True
        times, sample = np.asarray(part.times), np.asarray(part.sample_index)
        last = np.max(sample, axis=1).astype(np.int64)
        imposed = np.broadcast_to(np.asarray(part.imposed), (LANES, *times.shape))
        inertia, given_way = np.zeros((LANES, len(times))), np.zeros(imposed.shape)
        if np.any(thetas[:, self._driving]):
            imposed, inertia, given_way = (np.asarray(of) for of in self._driven(thetas, part))
        leaves = [np.asarray(leaf) for leaf in jax.tree.leaves(part.kinematics)]
        flows = [leaf.reshape(len(leaf), -1) for leaf in leaves]
        given = {
            "imposed": np.moveaxis(imposed, 0, -1), "inertia": np.moveaxis(inertia, 0, -1),
            "shared": shared, "mode": modes[present], "last": last,
            "width": np.diff(times), "flow": np.concatenate(flows or [np.zeros((1, 1))], axis=1),
        }  # fmt: skip
        strain, of_modes = self._code(used, given, normal)
        places = np.arange(len(times))[:, None], sample
        found = np.moveaxis(strain[places], -1, 0) + given_way[:, *places]
        if not normal:
            return found[..., None]
        own = np.moveaxis(of_modes[places], -1, 0)
        beside = normal_stress_differences(part.kinematics, imposed[:, *places], own)
        return np.concatenate([found[..., None], beside], axis=-1)
