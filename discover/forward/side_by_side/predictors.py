"""What is asked of many vectors of parameters at once, and how eights of lanes take it up."""

from collections.abc import Callable, Iterable, Sequence
from operator import is_
from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import Float, Int

from discover.effects import AbstractEffect, KinematicEffect
from discover.forward.augmented_fluid import AugmentedFluid
from discover.forward.declared import Numbers
from discover.forward.side_by_side.code import Code, Packed
from discover.forward.side_by_side.step import Flags
from discover.programs import compiled, in_threads
from discover.programs.lanes import LANES


class Asked(NamedTuple):
    """What is asked of vectors of parameters.

    `moduli`: of the declared modes in Pa, the solvent's viscosity in Pa s last. `part`: runs of one
    control. `whole`: whether behind what is recorded the stress without what distorts a signal is
    asked for, and the components of the modes.
    """

    numbers: Numbers
    thetas: Float[np.ndarray, "trials p"]
    moduli: Float[np.ndarray, "trials c"]
    part: Any
    whole: bool

    @property
    def declared(self) -> int:
        """How many modes are declared."""
        return len(self.numbers.modulus)

    def taken(self, which: np.ndarray) -> "Asked":
        """Return what is asked of some of the vectors."""
        return self._replace(thetas=self.thetas[which], moduli=self.moduli[which])


def in_whole_eights(count: int) -> Int[np.ndarray, " lanes"]:
    """Return places of so many lanes, the last again until the eights are full."""
    return np.arange(-(-count // LANES) * LANES).clip(max=count - 1)


def flows_of(kinematics: Any) -> Float[np.ndarray, "runs numbers"]:
    """Return the kinematics of runs as one array; a zero where all are simple shear."""
    leaves = [np.asarray(leaf) for leaf in jax.tree.leaves(kinematics)]
    if not leaves:
        return np.zeros((1, 1))
    return np.concatenate([leaf.reshape(len(leaf), -1) for leaf in leaves], axis=1)


def per_run(thetas: Float[np.ndarray, "trials p"]) -> Float[np.ndarray, "p trials 1 1"]:
    """Return parameters of vectors before axes of runs and of time."""
    return thetas.T[..., None, None]


class MadeOnce:
    """What is made of something, as parts of a batch, once for each of the `kept` last."""

    def __init__(self, make: Callable[..., Any], kept: int = 8):
        self._make, self._kept = make, kept
        self._known: list[tuple[tuple, Any]] = []

    def __call__(self, *given: Any) -> Any:
        """Return what was made of these very objects."""
        for known, made in self._known:
            if len(known) == len(given) and all(map(is_, known, given)):
                return made
        made = self._make(*given)
        self._known = [*self._known, (given, made)][-self._kept :]
        return made


class LanePredictor:
    """Predictions of one kind of flows for one structure of law and effects, in lanes."""

    def __init__(self, fluid: AugmentedFluid, code: Any):
        self._fluid, self._code, self._flags = fluid, code, Flags(fluid)
        self._packed: Callable[..., Packed] = code.packing(fluid)

    def _amplitudes(self, effects: Iterable[AbstractEffect]) -> list[int]:
        return [self._fluid.slices[effect.name].start for effect in effects]

    def _program(self, function: Callable, *axes: Sequence[int | None]) -> Callable:
        """Return a program of a function mapped over axes, that of the vectors last."""
        *inner, outermost = axes
        for along in inner:
            function = jax.vmap(function, along)
        return compiled(jax.vmap(function, outermost))

    def _by_eights(
        self,
        thetas: Float[np.ndarray, "trials p"],
        keys: Sequence[np.ndarray],
        of_eight: Callable[[np.ndarray, np.ndarray], np.ndarray],
    ) -> np.ndarray:
        """Return what is found of vectors, eights of which are computed together.

        Those that need the same parts of the code, and agree in `keys`, go together. `of_eight`: of
        eight vectors, the last again until there are eight, and the parts they need.
        """
        flags = self._flags.of(thetas)
        order = np.lexsort([*keys, *np.packbits(flags, axis=1).T])

        def found(trials: np.ndarray) -> np.ndarray:
            lanes = trials[in_whole_eights(len(trials))]
            return of_eight(lanes, np.any(flags[trials], axis=0))[: len(trials)]

        # to compile is behind a lock, so that no first call is needed alone
        eights = np.split(order, range(LANES, len(order), LANES))
        each = np.concatenate(in_threads(found, eights, is_compiled=True))
        out = np.empty_like(each)
        out[order] = each
        return out


class StatePredictor(LanePredictor):
    """Predictions of states, steady or periodic, each of which is a lane of its own.

    `rates`: the felt rates, of vectors as `per_run` has them, the effects present, the commanded
    rates of runs and their flow.
    """

    def __init__(self, fluid: AugmentedFluid, code: Code, rates: Callable):
        super().__init__(fluid, code)
        self._acting = [e for e in fluid.structure.effects if e.acts_on_steady_states]
        shaping = [e for e in self._acting if isinstance(e, KinematicEffect)]
        self._shaping, self._rates = self._amplitudes(shaping), rates

    def _felt(self, asked: Asked, commanded: np.ndarray, flow: Any = None) -> np.ndarray:
        """Return the rates that each vector feels: as commanded, or as effects shape them."""
        found = commanded
        if np.any(asked.thetas[:, self._shaping]):
            present = self._fluid.present(asked.thetas)
            found = self._rates(per_run(asked.thetas), present, commanded, flow)
        return np.broadcast_to(found, (len(asked.thetas), *commanded.shape))
