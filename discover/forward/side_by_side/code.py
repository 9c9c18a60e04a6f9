"""Machine code for the effects of a fluid and a law, made once for all whose constants differ."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from discover.forward.augmented_fluid import AugmentedFluid
from discover.forward.declared import Numbers
from discover.forward.side_by_side.step import Flags, Mode, Shared, laid_out
from discover.programs import compiled
from discover.programs.lanes import LANES, Arithmetic, Translation, Writing, callable_of, kept
from discover.programs.lanes.arithmetic import INTEGER
from discover.protocols.kinematics import Kinematics


def as_array(values: Sequence[Any]) -> np.ndarray:
    """Return values as an array that holds them as they are."""
    found = np.empty(len(values), object)
    found[:] = values
    return found


class Layout:
    """Trees of arrays as one axis of `size` numbers, and back.

    `axes`: how many leading axes of each leaf stay apart.
    """

    def __init__(self, tree: Any, axes: int):
        arrays = eqx.filter(
            tree, lambda leaf: isinstance(leaf, jax.ShapeDtypeStruct) or eqx.is_array(leaf)
        )
        leaves, self._structure = jax.tree.flatten(arrays)
        self._axes = axes
        self._shapes = [leaf.shape[axes:] for leaf in leaves]
        self.size = sum(int(np.prod(shape, dtype=int)) for shape in self._shapes)

    def packed(self, tree: Any) -> jax.Array:
        """Return a tree as one array."""
        leaves = jax.tree.leaves(eqx.filter(tree, eqx.is_array))
        flat = [jnp.asarray(leaf, float).reshape(*leaf.shape[: self._axes], -1) for leaf in leaves]
        return jnp.concatenate(flat, axis=-1)

    def tree(self, values: Sequence[Any]) -> Any:
        """Return the tree of values that follow one another."""
        leaves, place = [], 0
        for shape in self._shapes:
            leaf = np.empty(shape, object)
            for at in np.ndindex(shape):
                leaf[at] = values[place]
                place += 1
            leaves.append(leaf)
        return jax.tree.unflatten(self._structure, leaves)


def lanes_last(values: np.ndarray) -> np.ndarray:
    """Return values of lanes, in whole eights, with these eights first and their lanes last."""
    return np.moveaxis(values.reshape(-1, LANES, *values.shape[1:]), 1, -1)


class Packed(NamedTuple):
    """Numbers that the code takes of vectors: of each of their modes, and of all."""

    modes: Float[np.ndarray, "trials k m"]
    shared: Float[np.ndarray, "trials s"]

    def of_lanes(self, trial: Int[np.ndarray, " lanes"], declared: int) -> dict[str, np.ndarray]:
        """Return what the code takes of vectors in whole eights: the eights first, lanes last.

        Modes of effects are left out where no lane has them.
        """
        of_mode = self.modes[trial]
        present = np.any(of_mode[:, :, 0] != 0.0, axis=0)
        present[:declared] = True
        return {"shared": lanes_last(self.shared[trial]), "mode": lanes_last(of_mode[:, present])}

    def of_eight(self, lanes: Int[np.ndarray, " 8"], declared: int) -> dict[str, np.ndarray]:
        """Return what the code takes of eight vectors."""
        return {name: values[0] for name, values in self.of_lanes(lanes, declared).items()}


_PACKED_AT_ONCE = 32
"""Vectors of one call to JAX, which takes as long for eight."""

# From so many products of matrices on code is large; those of a law are some dozens
_MANY_PRODUCTS = 1000

_MADE: dict[tuple, "Code"] = {}
_KEPT = 16


class Code:
    """Machine code for the effects of a fluid and a law, with all constants and flows as data.

    `counts`, `arrays`: the whole numbers and arrays it takes; `wide`: arrays of all lanes; `whole`:
    of whole numbers. `found`: shapes of its data, from `laid_out`. `flow`: kinematics of one run;
    None where all are simple shear. `size`: numbers of a mode: σ11, σ22, σ33, σ12, and structure
    variables.
    """

    counts: ClassVar[tuple[str, ...]]
    arrays: ClassVar[tuple[str, ...]]
    wide: ClassVar[tuple[str, ...]]
    whole: ClassVar[tuple[str, ...]]

    def __init__(
        self, fluid: AugmentedFluid, found: tuple[Mode, Shared], flow: Kinematics | None = None
    ):
        self.flags = Flags(fluid)
        self._of_mode, self._shared = (
            Layout(tree, axes) for tree, axes in zip(found, (1, 0), strict=True)
        )
        self._flow = Layout(flow, 0)
        self._law = eqx.combine(found[0].law, found[1].law)
        self._plain_law = eqx.filter(self._law, _is_shape, inverse=True)
        # of a mode, and kinds of weights that its step has
        self.size = 4 + self._law.variables
        relaxations = found[0].relaxations
        self._kinds = 1 if relaxations is None else 2 * relaxations.shape[1]

    def packing(self, fluid: AugmentedFluid) -> Callable[..., Packed]:
        """Return what packs numbers, vectors and their moduli, however many.

        The solvent's viscosity stands behind the moduli.
        """

        def packed(numbers: Numbers, thetas, moduli):
            def one(theta, modulus, solvent):
                moved = Numbers(numbers.law, modulus, numbers.relaxation_time, solvent)
                of_mode, shared = laid_out(fluid, moved, theta)
                return self._of_mode.packed(of_mode), self._shared.packed(shared)

            return jax.vmap(one)(thetas, moduli[:, :-1], moduli[:, -1])

        program = compiled(packed)

        def all_packed(numbers: Numbers, thetas: np.ndarray, moduli: np.ndarray) -> Packed:
            count = len(thetas)
            each = []
            for first in range(0, count, _PACKED_AT_ONCE):
                some = np.arange(first, first + _PACKED_AT_ONCE).clip(max=count - 1)
                each.append(program(numbers, thetas[some], moduli[some]))
            both = (np.concatenate(arrays)[:count] for arrays in zip(*each, strict=True))
            return Packed(*both)

        return all_packed

    def _make(self, fluid: AugmentedFluid, found: tuple[Mode, Shared], *others: Any) -> None:
        """Write the code, or take that of an earlier start; others tell it from other code too."""
        empty = [
            jax.tree.map(
                lambda leaf, axes=axes: np.empty(leaf.shape[axes:]) if _is_shape(leaf) else leaf,
                tree,
            )
            for tree, axes in zip(found, (1, 0), strict=True)
        ]
        code = kept((type(self).__name__, fluid.structure, empty, *others), self._written)
        self._call = callable_of(code, len(self.counts), len(self.arrays))

    def _run(self, counts: Sequence[int], arrays: Mapping[str, np.ndarray]) -> None:
        # contiguous already; were one of them not, the code would read what is not its own
        laid = [np.ascontiguousarray(arrays[name]) for name in self.arrays]
        self._call(*counts, *(array.ctypes.data for array in laid))

    def _written(self) -> tuple[bytes, bool]:
        known = set(vars(self))
        self._w = Writing(self.counts, self.arrays, self.wide, self.whole)
        self._arithmetic = Arithmetic(self._w.builder)
        self._write = Translation(self._arithmetic)
        self._body()
        code, calls = self._w.compiled(self._write.products > _MANY_PRODUCTS), self._write.calls
        # what was written is large, and the code is made
        for name in set(vars(self)) - known:
            delattr(self, name)
        self._calls = calls
        return code, not calls

    def _body(self) -> None:
        raise NotImplementedError

    def _keep(self, values: Any, place: Any) -> None:
        """Write values into the scratch array, one after another."""
        for i, value in enumerate(np.asarray(values, object).flat):
            at = place if not i else self._w.at((place, 1), (i, 1))
            self._w.store(self._arithmetic.lanes(value), "scratch", at)

    def _kept(self, place: Any, *shape: int) -> Any:
        """Return what stands in the scratch array: a value, or an array of them."""
        if not shape:
            return self._w.load("scratch", place)
        places = [self._w.at((place, 1), (i, 1)) for i in range(int(np.prod(shape)))]
        return as_array([self._w.load("scratch", at) for at in places]).reshape(shape)

    def _tree(self, name: str, layout: Layout, at: Any) -> Any:
        """Return the tree of which an array holds several, at a place."""
        first = self._w.at((at, layout.size))
        places = [self._w.at((first, 1), (i, 1)) for i in range(layout.size)]
        return layout.tree([self._w.load(name, place) for place in places])

    def _record_modes(self, at: Any, factor: Any, first: int, stride: int) -> None:
        """Write down the sum of all modes: σ11, σ22, σ33, σ12, and structure variables."""
        w, a = self._w, self._arithmetic
        places = [w.at((at, self.size), (i, 1)) for i in range(self.size)]
        for place in places:
            w.store(a.lanes(0.0), "of_modes", place)
        with w.loop(w.counts["modes"]) as number, a.apart():
            own = a.multiply(factor, self._tree("mode", self._of_mode, number).modulus[()])
            stress = self._kept(w.at((number, stride), (first, 1)), self.size)
            for value, place in zip(stress, places, strict=True):
                more = a.multiply(own, value)
                w.store(a.add(w.load("of_modes", place), more), "of_modes", place)

    def _goes_on(self) -> Any:
        return self._w.builder.icmp_signed("!=", self._w.load("goes_on", 0), INTEGER(0))

    def _go_on_if(self, lanes: Any) -> None:
        """Write whether something holds in some lane, which `_goes_on` asks."""
        some = self._arithmetic.in_some(lanes)
        self._w.store(self._w.builder.zext(some, INTEGER), "goes_on", 0)

    def _truths(self) -> dict[str, Any]:
        """Return which parts are needed, by name."""
        truths = [
            self._w.builder.icmp_signed("!=", self._w.load("flags", i), INTEGER(0))
            for i in range(len(self.flags.names))
        ]
        return dict(zip(self.flags.names, truths, strict=True))

    def _rest(self, levels: Sequence[tuple[int, float]], place: int) -> None:
        """Write states of the fluid at rest, of so many numbers each."""
        self._keep([rest for count, rest in levels for _ in range(count)], place)

    def _keep_states(self, states: Sequence[Any], place: int) -> None:
        self._keep([value for state in states for value in state.flat], place)

    def _states(self, levels: Sequence[tuple[int, float]], place: int) -> tuple:
        """Return the states of the fluid, in the shapes of their effects."""
        found = []
        for count, _ in levels:
            own = self._kept(place, count)
            found.append(own if count > 1 else own.reshape(()))
            place += count
        return tuple(found)


def _is_shape(leaf: Any) -> bool:
    return isinstance(leaf, jax.ShapeDtypeStruct)


_Kind = TypeVar("_Kind", bound=Code)


def code_of(
    kind: type[_Kind],
    fluid: AugmentedFluid,
    numbers: Numbers,
    flow: Kinematics | None,
) -> _Kind:
    """Return the machine code of a kind for a fluid, made once for all whose constants differ."""
    theta = jax.ShapeDtypeStruct((fluid.size,), float)
    found = eqx.filter_eval_shape(laid_out, fluid, numbers, theta)
    structure = fluid.structure.without_constants()
    kinds = [
        leaf.shape[axes:] if _is_shape(leaf) else leaf
        for tree, axes in zip(found, (1, 0), strict=True)
        for leaf in jax.tree.leaves(tree)
    ]
    key = (kind, structure, jax.tree.structure(found), *kinds, jax.tree.structure(flow))
    made = _MADE.get(key)
    if not isinstance(made, kind):
        made = kind(AugmentedFluid(structure), found, flow)
        _MADE[key] = made
        for earliest in list(_MADE)[:-_KEPT]:
            del _MADE[earliest]
    return made
