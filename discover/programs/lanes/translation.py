"""Functions of JAX as operations on lanes: every number of an array becomes eight side by side.

An array is an array of NumPy whose elements are values of `Arithmetic`. Whatever only moves numbers
about is done by NumPy, or by JAX on their places, while code is written, and costs nothing later.
"""

import ctypes
import logging
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import llvmlite.ir as ir
import numpy as np
from jax.extend.core import jaxpr_as_fun

from discover.programs.compiler import on_device
from discover.programs.lanes.arithmetic import (
    DOUBLES,
    INTEGER,
    LANES,
    TRUTH,
    Arithmetic,
    NotTranslatable,
    Value,
)
from discover.programs.lanes.primitives import (
    ARRANGED,
    ELEMENTWISE,
    MOVED,
    SUMMED,
    Values,
    as_values,
    elementwise,
    kind_of,
    known_as,
    moved,
)

_LOGGER = logging.getLogger(__name__)


class Translation:
    """Functions of JAX, written down through an `Arithmetic` where its builder stands.

    `calls`: functions that the code calls, which have to live as long as it does. `products`: how
    many numbers the products of matrices in it multiply.
    """

    def __init__(self, arithmetic: Arithmetic):
        self.arithmetic = arithmetic
        self.calls: list[Any] = []
        self.products = 0

    def __call__(self, function: Callable, *arguments: Any) -> Any:
        """Return what a function makes of trees of arrays of values, as a tree of such arrays.

        One that does what lanes do not know is called as JAX compiles it, for all lanes at once.
        """
        leaves, tree = jax.tree.flatten(arguments, is_leaf=lambda x: isinstance(x, np.ndarray))
        leaves = [as_values(leaf) for leaf in leaves]
        shapes = [jax.ShapeDtypeStruct(leaf.shape, kind_of(leaf)) for leaf in leaves]
        traced, shape = jax.make_jaxpr(function, return_shape=True)(
            *jax.tree.unflatten(tree, shapes)
        )
        undo = self.arithmetic.mark()
        try:
            found = self.jaxpr(traced.jaxpr, traced.consts, leaves)
            if any(value is None for array in found for value in array.flat):
                raise NotTranslatable("a decomposition by itself")
        except NotTranslatable as reason:
            _LOGGER.debug("%s is left to JAX: %s", getattr(function, "__name__", "it"), reason)
            undo()
            found, call = called(self.arithmetic, traced, leaves)
            self.calls.append(call)
        return jax.tree.unflatten(jax.tree.structure(shape), found)

    def jaxpr(self, jaxpr, constants: Sequence[Any], arguments: Sequence[Values]) -> list[Values]:
        """Return the outputs of a traced function."""
        known: dict[Any, Values] = {}

        def read(variable) -> Values:
            return as_values(variable.val) if hasattr(variable, "val") else known[variable]

        known.update(zip(jaxpr.constvars, map(as_values, constants), strict=True))
        known.update(zip(jaxpr.invars, arguments, strict=True))
        for equation in jaxpr.eqns:
            inputs = [read(variable) for variable in equation.invars]
            try:
                found = self._equation(equation, inputs)
            except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
                # a primitive used in a way that nobody thought of is as unknown as another
                raise NotTranslatable(equation.primitive.name) from error
            outputs = found if equation.primitive.multiple_results else [found]
            known.update(zip(equation.outvars, map(as_values, outputs), strict=True))
        return [read(variable) for variable in jaxpr.outvars]

    def _equation(self, equation, inputs: list[Values]) -> Any:
        name, given = equation.primitive.name, equation.params
        if name in ("jit", "pjit", "closed_call", "core_call", "remat", "checkpoint"):
            return self._inner(given["jaxpr"], inputs)
        if name in ("custom_jvp_call", "custom_vjp_call"):
            return self._inner(given.get("call_jaxpr", given.get("fun_jaxpr")), inputs)
        if name == "cond":
            return self._branches(given["branches"], inputs[0], inputs[1:])
        if name in ELEMENTWISE:
            return elementwise(ELEMENTWISE[name](self.arithmetic, given), *inputs)
        if name in ARRANGED:
            return ARRANGED[name](given, *inputs)
        if name == "dot_general":
            self.products += max(array.size for array in inputs)
        if name in SUMMED:
            return SUMMED[name](self.arithmetic, given, *inputs)
        if name in MOVED:
            return moved(equation, inputs, MOVED[name])
        if name == "scatter-add":
            return self._scatter_add(equation, inputs)
        if name == "lu":
            # looked at by nothing but the solution, which begins with the matrix
            return [np.full(variable.aval.shape, None, object) for variable in equation.outvars]
        if name == "custom_linear_solve":
            return self._solution(given["const_lengths"], inputs)
        raise NotTranslatable(name)

    def _inner(self, closed, inputs: list[Values]) -> list[Values]:
        return self.jaxpr(getattr(closed, "jaxpr", closed), getattr(closed, "consts", ()), inputs)

    def _branches(self, branches, index: Values, inputs: list[Values]) -> list[Values]:
        """Return what the branch of an index gives; a branch that all lanes share is jumped to."""
        arithmetic = self.arithmetic
        which: Value = index[()]
        if arithmetic.is_known(which):
            place = min(max(int(which), 0), len(branches) - 1)
            return self._inner(branches[place], inputs)
        if len(branches) != 2:
            raise NotTranslatable("a choice between several branches")
        if which.type == DOUBLES:
            raise NotTranslatable("a branch by a number")
        no, yes = branches
        if isinstance(which.type, ir.VectorType):
            either = [self._inner(no, inputs), self._inner(yes, inputs)]
            choose = lambda a, b: arithmetic.chosen(which, b, a)  # noqa: E731
            return [elementwise(choose, *pair) for pair in zip(*either, strict=True)]
        return self._jump(which, lambda: self._inner(yes, inputs), lambda: self._inner(no, inputs))

    def _jump(self, which: Value, yes: Callable, no: Callable) -> list[Values]:
        builder, ends = self.arithmetic.builder, []
        blocks = [builder.append_basic_block(name) for name in ("yes", "no", "after")]
        builder.cbranch(which, blocks[0], blocks[1])
        for block, write in zip(blocks, (yes, no), strict=False):
            builder.position_at_end(block)
            with self.arithmetic.apart():
                found = write()
                lanes = [[self.arithmetic.lanes(v) for v in array.flat] for array in found]
            ends.append((found, lanes, builder.block))
            builder.branch(blocks[2])
        builder.position_at_end(blocks[2])
        (first, first_lanes, first_end), (second, second_lanes, second_end) = ends
        merged = [np.empty(array.shape, object) for array in first]
        for i, array in enumerate(merged):
            for j, place in enumerate(np.ndindex(array.shape)):
                a, b = first[i][place], second[i][place]
                if a is b or (self.arithmetic.is_known(a, b) and a == b):
                    array[place] = a
                    continue
                either = builder.phi(DOUBLES)
                either.add_incoming(first_lanes[i][j], first_end)
                either.add_incoming(second_lanes[i][j], second_end)
                array[place] = either
        # a truth went through as a number
        return [
            elementwise(lambda x: self.arithmetic.compare("!=", x, 0.0), array)
            if kind_of(before) == jnp.bool_
            else array
            for array, before in zip(merged, first, strict=True)
        ]

    def _solution(self, counts, inputs: list[Values]) -> list[Values]:
        """Return what solves systems of equations, by elimination with pivots of each lane."""
        if counts.matvec != 1 or len(inputs) != sum(counts) + 1 or inputs[0].ndim != 2:
            raise NotTranslatable("a system of equations of a kind of its own")
        a, right = inputs[0].copy(), inputs[-1].copy()
        arithmetic, size = self.arithmetic, len(a)
        of_row = np.concatenate([a, right.reshape(-1, size).T], axis=1)
        for i in range(size):
            for j in range(i + 1, size):
                larger = arithmetic.compare(
                    ">", arithmetic.size(of_row[j, i]), arithmetic.size(of_row[i, i])
                )
                upper, lower = of_row[i].copy(), of_row[j].copy()
                for column in range(i, of_row.shape[1]):
                    pair = upper[column], lower[column]
                    of_row[i, column] = arithmetic.chosen(larger, *pair[::-1])
                    of_row[j, column] = arithmetic.chosen(larger, *pair)
            for j in range(i + 1, size):
                share = arithmetic.divide(of_row[j, i], of_row[i, i])
                for column in range(i + 1, of_row.shape[1]):
                    less = arithmetic.multiply(share, of_row[i, column])
                    of_row[j, column] = arithmetic.subtract(of_row[j, column], less)
        for column in range(size, of_row.shape[1]):
            for i in reversed(range(size)):
                left = of_row[i, column]
                for j in range(i + 1, size):
                    known = arithmetic.multiply(of_row[i, j], of_row[j, column])
                    left = arithmetic.subtract(left, known)
                of_row[i, column] = arithmetic.divide(left, of_row[i, i])
        return [of_row[:, size:].T.reshape(right.shape)]

    def _scatter_add(self, equation, inputs: list[Values]) -> Values:
        """Return numbers with others added where constant indices say."""
        base, updates = inputs[0].copy(), inputs[2]
        indices = known_as(inputs[1], equation.invars[1])
        for place in np.ndindex(updates.shape):
            alone = np.zeros(updates.shape)
            alone[place] = 1.0
            hit = equation.primitive.bind(
                on_device(np.zeros(base.shape)), indices, on_device(alone), **equation.params
            )
            for target in zip(*np.nonzero(np.asarray(hit)), strict=True):
                base[target] = self.arithmetic.add(base[target], updates[place])
        return base


_CALL = ctypes.CFUNCTYPE(None, *[ctypes.POINTER(ctypes.c_double)] * 2)


def called(
    arithmetic: Arithmetic, traced: Any, leaves: Sequence[np.ndarray]
) -> tuple[list[np.ndarray], Any]:
    """Return the outputs of a function that is called on its way, and what is called.

    The latter has to live as long as the code does. `leaves`: its arguments, arrays of values.
    """
    b = arithmetic.builder
    unknown = [[i for i, v in enumerate(leaf.flat) if not arithmetic.is_known(v)]
               for leaf in leaves]  # fmt: skip
    given = [leaf.flat[i] for leaf, at in zip(leaves, unknown, strict=True) for i in at]
    # truths that all lanes share stay one, so that branches are taken and not chosen from
    shared = [Arithmetic.is_truth(v) and v.type == TRUTH for v in given]
    outputs = [variable.aval for variable in traced.jaxpr.outvars]

    def of_lane(values):
        read, arguments = iter(values), []
        for leaf, at, variable in zip(leaves, unknown, traced.jaxpr.invars, strict=True):
            known = [0.0 if i in at else value for i, value in enumerate(leaf.flat)]
            flat = jnp.asarray(known, float)
            for i in at:
                flat = flat.at[i].set(next(read))
            arguments.append(flat.reshape(leaf.shape).astype(variable.aval.dtype))
        found = jaxpr_as_fun(traced)(*arguments)
        return jnp.concatenate([jnp.ravel(jnp.asarray(each, float)) for each in found])

    axes = [None if one else 0 for one in shared]
    shapes = [jax.ShapeDtypeStruct(() if one else (LANES,), float) for one in shared]
    program = jax.jit(jax.vmap(of_lane, (axes,), 1)).lower(shapes).compile()
    size = sum(int(np.prod(aval.shape, dtype=int)) for aval in outputs)

    def call(inputs, results):
        rows = np.ctypeslib.as_array(inputs, (max(len(given), 1), LANES))
        values = [row[0] if one else row for row, one in zip(rows, shared, strict=False)]
        np.ctypeslib.as_array(results, (size, LANES))[:] = program(values)

    kept = _CALL(call)
    address = ctypes.cast(kept, ctypes.c_void_p).value
    with b.goto_entry_block():
        inputs, results = (
            b.alloca(DOUBLES, INTEGER(max(count, 1))) for count in (len(given), size)
        )
    for i, value in enumerate(given):
        b.store(arithmetic.lanes(value), b.gep(inputs, [INTEGER(i)]))
    kind = ir.FunctionType(ir.VoidType(), [DOUBLES.as_pointer()] * 2)
    b.call(b.inttoptr(INTEGER(address), kind.as_pointer()), [inputs, results])
    found = iter([b.load(b.gep(results, [INTEGER(i)])) for i in range(size)])
    arrays = []
    for aval in outputs:
        values = np.empty(aval.shape, object)
        for place in np.ndindex(aval.shape):
            value = next(found)
            is_truth = aval.dtype == jnp.bool_
            values[place] = arithmetic.compare("!=", value, 0.0) if is_truth else value
        arrays.append(values)
    return arrays, kept
