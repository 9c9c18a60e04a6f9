"""Functions of JAX as operations on lanes: every number of an array becomes eight side by side.

An array is an array of NumPy whose elements are values of `Arithmetic`. Whatever only moves numbers
about is done by NumPy, or by JAX on their places, while code is written, and costs nothing later.
"""

import ctypes
import logging
from collections.abc import Callable, Sequence
from functools import partial, reduce
from typing import Any

import jax
import jax.numpy as jnp
import llvmlite.ir as ir
import numpy as np
from jax.extend.core import jaxpr_as_fun

from discover.programs.lanes.arithmetic import (
    DOUBLES,
    INTEGER,
    LANES,
    TRUTH,
    Arithmetic,
    NotTranslatable,
    Value,
)
from discover.programs.threads import on_device

_LOGGER = logging.getLogger(__name__)

Values = np.ndarray
"""An array of values."""

_CALL = ctypes.CFUNCTYPE(None, *[ctypes.POINTER(ctypes.c_double)] * 2)

_COMPARED = {"lt": "<", "le": "<=", "gt": ">", "ge": ">=", "eq": "==", "ne": "!="}


def as_values(array: Any) -> Values:
    """Return an array of values."""
    if isinstance(array, np.ndarray) and array.dtype == object:
        return array
    if isinstance(array, ir.Value | float | int):
        values = np.empty((), object)
        values[()] = array
        return values
    known = np.asarray(array)
    values = np.empty(known.shape, object)
    for place in np.ndindex(known.shape):
        values[place] = known[place].item()
    return values


class Translation:
    """Functions of JAX, written down through an `Arithmetic` where its builder stands.

    `calls`: functions that the code calls, which have to live as long as it does.
    """

    def __init__(self, arithmetic: Arithmetic):
        self.arithmetic = arithmetic
        self.calls: list[Any] = []

    def __call__(self, function: Callable, *arguments: Any) -> Any:
        """Return what a function makes of trees of arrays of values, as a tree of such arrays.

        One that does what lanes do not know is called as JAX compiles it, for all lanes at once.
        """
        leaves, tree = jax.tree.flatten(arguments, is_leaf=lambda x: isinstance(x, np.ndarray))
        leaves = [as_values(leaf) for leaf in leaves]
        shapes = [jax.ShapeDtypeStruct(leaf.shape, _kind(leaf)) for leaf in leaves]
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
            found = self._by_jax(traced, leaves)
        return jax.tree.unflatten(jax.tree.structure(shape), found)

    def _by_jax(self, traced: Any, leaves: list[Values]) -> list[Values]:
        """Return the outputs of a function that is called on its way, for all lanes at once."""
        arithmetic, b = self.arithmetic, self.arithmetic.builder
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
        self.calls.append(kept)
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
        return arrays

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
        if name in _ELEMENTWISE:
            return _elementwise(_ELEMENTWISE[name](self.arithmetic, given), *inputs)
        if name in _ARRANGED:
            return _ARRANGED[name](given, *inputs)
        if name in _SUMMED:
            return _SUMMED[name](self.arithmetic, given, *inputs)
        if name in _MOVED:
            return _moved(equation, inputs, _MOVED[name])
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
            return [_elementwise(choose, *pair) for pair in zip(*either, strict=True)]
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
            _elementwise(lambda x: self.arithmetic.compare("!=", x, 0.0), array)
            if _kind(before) == jnp.bool_
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
        indices = _known_as(inputs[1], equation.invars[1])
        for place in np.ndindex(updates.shape):
            alone = np.zeros(updates.shape)
            alone[place] = 1.0
            hit = equation.primitive.bind(
                on_device(np.zeros(base.shape)), indices, on_device(alone), **equation.params
            )
            for target in zip(*np.nonzero(np.asarray(hit)), strict=True):
                base[target] = self.arithmetic.add(base[target], updates[place])
        return base


def _kind(values: Values) -> Any:
    """Return the type of JAX of an array of values."""
    first: Value = values.flat[0] if values.size else 0.0
    if isinstance(first, ir.Value):
        return jnp.bool_ if Arithmetic.is_truth(first) else jnp.float64
    return np.asarray(first).dtype


def _known_as(values: Values, variable) -> Any:
    """Return numbers that are known, for JAX."""
    if not Arithmetic.is_known(*values.flat):
        raise NotTranslatable("a place that depends on the numbers")
    return on_device(np.array(values.tolist(), dtype=variable.aval.dtype))


def _elementwise(function: Callable[..., Value], *arrays: Values) -> Values:
    shape = np.broadcast_shapes(*(array.shape for array in arrays))
    wide = [np.broadcast_to(array, shape) for array in arrays]
    found = np.empty(shape, object)
    for place in np.ndindex(shape):
        found[place] = function(*(array[place] for array in wide))
    return found


def _moved(equation, inputs: list[Values], moving: Sequence[int]) -> Values:
    """Return what only moves numbers to places known beforehand: JAX moves their labels."""
    values: list[Value] = []
    given = []
    for i, array in enumerate(inputs):
        if i in moving:
            labels = np.arange(len(values), len(values) + array.size).reshape(array.shape)
            values += list(array.flat)
            given.append(on_device(labels.astype(float)))
        else:
            given.append(_known_as(array, equation.invars[i]))
    places = np.asarray(equation.primitive.bind(*given, **equation.params)).astype(int)
    found = np.empty(places.shape, object)
    for place in np.ndindex(places.shape):
        found[place] = values[places[place]]
    return found


def _broadcast(given, array: Values) -> Values:
    shape = [1] * len(given["shape"])
    for axis, size in zip(given["broadcast_dimensions"], array.shape, strict=True):
        shape[axis] = size
    return np.broadcast_to(array.reshape(shape), given["shape"])


def _slice(given, array: Values) -> Values:
    strides = given["strides"] or [1] * array.ndim
    bounds = zip(given["start_indices"], given["limit_indices"], strides, strict=True)
    return array[tuple(slice(*one) for one in bounds)]


def _iota(given) -> Values:
    shape, along = given["shape"], given["dimension"]
    rows = [-1 if axis == along else 1 for axis in range(len(shape))]
    return np.broadcast_to(np.arange(shape[along]).reshape(rows), shape)


def _unstacked(given, array: Values) -> list[Values]:
    return [as_values(row) for row in np.moveaxis(array, given["axis"], 0)]


def _pad(given, array: Values, filler: Values) -> Values:
    if any(low < 0 or high < 0 or between for low, high, between in given["padding_config"]):
        raise NotTranslatable("pad")
    widths = [(low, high) for low, high, _ in given["padding_config"]]
    found = np.empty([n + a + b for n, (a, b) in zip(array.shape, widths, strict=True)], object)
    found.fill(filler[()])
    inside = zip(array.shape, widths, strict=True)
    found[tuple(slice(low, low + n) for n, (low, _) in inside)] = array
    return found


def _reduced(operation: str, *first: str):
    def over(arithmetic: Arithmetic, given, array: Values) -> Values:
        pairwise = partial(getattr(arithmetic, operation), *first)
        for axis in sorted(given["axes"], reverse=True):
            rows = [as_values(row) for row in np.moveaxis(array, axis, 0)]
            array = reduce(lambda a, b: _elementwise(pairwise, a, b), rows)
        return array

    return over


def _dot(arithmetic: Arithmetic, given, first: Values, second: Values) -> Values:
    (left, right), (batch, _) = given["dimension_numbers"]
    if batch:
        raise NotTranslatable("a batch of products of matrices")
    a = np.moveaxis(first, left, range(-len(left), 0)) if left else first
    b = np.moveaxis(second, right, range(len(right))) if right else second
    rows, columns = a.shape[: a.ndim - len(left)], b.shape[len(right) :]
    inner = int(np.prod(b.shape[: len(right)], dtype=int))
    a, b = a.reshape(-1, inner), b.reshape(inner, -1)
    found = np.empty((len(a), b.shape[1]), object)
    for i, j in np.ndindex(found.shape):
        products = (arithmetic.multiply(a[i, k], b[k, j]) for k in range(inner))
        found[i, j] = reduce(arithmetic.add, products, 0.0)
    return found.reshape(rows + columns)


def _converted(arithmetic: Arithmetic, given) -> Callable[[Value], Value]:
    kind = np.dtype(given["new_dtype"])

    def convert(x: Value) -> Value:
        if arithmetic.is_known(x):
            return kind.type(x).item()
        if kind.kind == "f":
            return arithmetic.lanes(x)
        if x.type == DOUBLES:
            raise NotTranslatable("a number as a whole one")
        return x  # a truth that chooses a branch

    return convert


def _log_of_one_more(arithmetic: Arithmetic, x: Value) -> Value:
    """Return ln(1 + x) with the digits of x that the sum loses."""
    total = arithmetic.add(1.0, x)
    lost = arithmetic.subtract(x, arithmetic.subtract(total, 1.0))
    return arithmetic.add(arithmetic.logarithm(total), arithmetic.divide(lost, total))


def _tanh(arithmetic: Arithmetic, x: Value) -> Value:
    """Return (e^2x − 1)/(e^2x + 1), which is one beyond 20."""
    inside = arithmetic.smaller(arithmetic.larger(x, -20.0), 20.0)
    more = arithmetic.exponential(arithmetic.multiply(2.0, inside), less_one=True)
    return arithmetic.divide(more, arithmetic.add(more, 2.0))


def _sign(arithmetic: Arithmetic, x: Value) -> Value:
    below = arithmetic.chosen(arithmetic.compare("<", x, 0.0), -1.0, 0.0)
    return arithmetic.chosen(arithmetic.compare(">", x, 0.0), 1.0, below)


def _logistic(arithmetic: Arithmetic, x: Value) -> Value:
    more = arithmetic.add(1.0, arithmetic.exponential(arithmetic.negative(x)))
    return arithmetic.divide(1.0, more)


def _same(_arithmetic, _given) -> Callable[[Value], Value]:
    return lambda x: x


_ELEMENTWISE: dict[str, Callable[[Arithmetic, dict], Callable[..., Value]]] = {
    "add": lambda a, _: a.add,
    "add_any": lambda a, _: a.add,
    "sub": lambda a, _: a.subtract,
    "mul": lambda a, _: a.multiply,
    "div": lambda a, _: a.divide,
    "neg": lambda a, _: a.negative,
    "max": lambda a, _: a.larger,
    "min": lambda a, _: a.smaller,
    "abs": lambda a, _: a.size,
    "sqrt": lambda a, _: a.root,
    "exp": lambda a, _: a.exponential,
    "log": lambda a, _: a.logarithm,
    "pow": lambda a, _: a.power,
    "rsqrt": lambda a, _: lambda x: a.divide(1.0, a.root(x)),
    "square": lambda a, _: lambda x: a.multiply(x, x),
    "expm1": lambda a, _: lambda x: a.exponential(x, less_one=True),
    "log1p": lambda a, _: lambda x: _log_of_one_more(a, x),
    "tanh": lambda a, _: lambda x: _tanh(a, x),
    "logistic": lambda a, _: lambda x: _logistic(a, x),
    "sign": lambda a, _: lambda x: _sign(a, x),
    "integer_pow": lambda a, given: lambda x: a.whole_power(x, given["y"]),
    "clamp": lambda a, _: lambda low, x, high: a.smaller(a.larger(x, low), high),
    "select_n": lambda a, _: lambda which, no, yes: a.chosen(which, yes, no),
    "and": lambda a, _: lambda x, y: a.both("and", x, y),
    "or": lambda a, _: lambda x, y: a.both("or", x, y),
    "not": lambda a, _: a.opposite,
    "is_finite": lambda a, _: lambda x: a.compare("<", a.size(x), float("inf")),
    "convert_element_type": _converted,
    "stop_gradient": _same,
    "copy": _same,
    "copy_p": _same,
    **{
        name: lambda a, _, how=how: lambda x, y: a.compare(how, x, y, of_nothing=how == "!=")
        for name, how in _COMPARED.items()
    },
}

_ARRANGED: dict[str, Callable[..., Any]] = {
    "broadcast_in_dim": _broadcast,
    "reshape": lambda given, x: x.reshape(given["new_sizes"]),
    "squeeze": lambda given, x: np.squeeze(x, axis=tuple(given["dimensions"])),
    "expand_dims": lambda given, x: np.expand_dims(x, given["dimensions"]),
    "concatenate": lambda given, *x: np.concatenate(x, axis=given["dimension"]),
    "stack": lambda given, *x: np.stack(x, axis=given["axis"]),
    "unstack": _unstacked,
    "split": lambda given, x: np.split(x, np.cumsum(given["sizes"])[:-1], axis=given["axis"]),
    "transpose": lambda given, x: np.transpose(x, given["permutation"]),
    "rev": lambda given, x: np.flip(x, given["dimensions"]),
    "slice": _slice,
    "pad": _pad,
    "iota": _iota,
    # written over before it is looked at
    "empty2": lambda given: as_values(0.0),
}

_SUMMED: dict[str, Callable[..., Values]] = {
    "reduce_sum": _reduced("add"),
    "reduce_max": _reduced("larger"),
    "reduce_min": _reduced("smaller"),
    "reduce_prod": _reduced("multiply"),
    "reduce_and": _reduced("both", "and"),
    "reduce_or": _reduced("both", "or"),
    "dot_general": _dot,
}

_MOVED: dict[str, tuple[int, ...]] = {
    "gather": (0,),
    "dynamic_slice": (0,),
    "dynamic_update_slice": (0, 1),
    "scatter": (0, 2),
}
