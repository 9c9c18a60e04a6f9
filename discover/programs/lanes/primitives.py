"""Primitives of JAX that compute with numbers, or move them about, on values of lanes."""

import math
from collections.abc import Callable, Sequence
from functools import partial, reduce
from typing import Any

import jax.numpy as jnp
import llvmlite.ir as ir
import numpy as np

from discover.programs.compiler import on_device
from discover.programs.lanes.arithmetic import DOUBLES, Arithmetic, NotTranslatable, Value

Values = np.ndarray
"""An array of values."""

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


def kind_of(values: Values) -> Any:
    """Return the type of JAX of an array of values."""
    first: Value = values.flat[0] if values.size else 0.0
    if isinstance(first, ir.Value):
        return jnp.bool_ if Arithmetic.is_truth(first) else jnp.float64
    return np.asarray(first).dtype


def known_as(values: Values, variable) -> Any:
    """Return numbers that are known, for JAX."""
    if not Arithmetic.is_known(*values.flat):
        raise NotTranslatable("a place that depends on the numbers")
    return on_device(np.array(values.tolist(), dtype=variable.aval.dtype))


def elementwise(function: Callable[..., Value], *arrays: Values) -> Values:
    """Return a function of values of each of the elements of arrays, broadcast to one shape."""
    shape = np.broadcast_shapes(*(array.shape for array in arrays))
    wide = [np.broadcast_to(array, shape) for array in arrays]
    found = np.empty(shape, object)
    for place in np.ndindex(shape):
        found[place] = function(*(array[place] for array in wide))
    return found


def moved(equation, inputs: list[Values], moving: Sequence[int]) -> Values:
    """Return what only moves numbers to places known beforehand: JAX moves their labels."""
    values: list[Value] = []
    given = []
    for i, array in enumerate(inputs):
        if i in moving:
            labels = np.arange(len(values), len(values) + array.size).reshape(array.shape)
            values += list(array.flat)
            given.append(on_device(labels.astype(float)))
        else:
            given.append(known_as(array, equation.invars[i]))
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
            array = reduce(lambda a, b: elementwise(pairwise, a, b), rows)
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


_ALL_SQUARE = 1e8
"""Size from which on one is below the last digit of the square."""


def _asinh(arithmetic: Arithmetic, x: Value) -> Value:
    """Return ± ln(1 + |x| + x²/(1 + √(1 + x²))); ln 2|x| where the square is all there is."""
    size = arithmetic.size(x)
    inside = arithmetic.smaller(size, _ALL_SQUARE)
    square = arithmetic.multiply(inside, inside)
    root = arithmetic.root(arithmetic.add(1.0, square))
    more = arithmetic.add(inside, arithmetic.divide(square, arithmetic.add(1.0, root)))
    far = arithmetic.add(arithmetic.logarithm(size), math.log(2.0))
    found = arithmetic.chosen(
        arithmetic.compare(">", size, _ALL_SQUARE), far, _log_of_one_more(arithmetic, more)
    )
    return arithmetic.chosen(arithmetic.compare("<", x, 0.0), arithmetic.negative(found), found)


def _sign(arithmetic: Arithmetic, x: Value) -> Value:
    below = arithmetic.chosen(arithmetic.compare("<", x, 0.0), -1.0, 0.0)
    return arithmetic.chosen(arithmetic.compare(">", x, 0.0), 1.0, below)


def _logistic(arithmetic: Arithmetic, x: Value) -> Value:
    more = arithmetic.add(1.0, arithmetic.exponential(arithmetic.negative(x)))
    return arithmetic.divide(1.0, more)


def _same(_arithmetic, _given) -> Callable[[Value], Value]:
    return lambda x: x


ELEMENTWISE: dict[str, Callable[[Arithmetic, dict], Callable[..., Value]]] = {
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
    "asinh": lambda a, _: lambda x: _asinh(a, x),
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

ARRANGED: dict[str, Callable[..., Any]] = {
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

SUMMED: dict[str, Callable[..., Values]] = {
    "reduce_sum": _reduced("add"),
    "reduce_max": _reduced("larger"),
    "reduce_min": _reduced("smaller"),
    "reduce_prod": _reduced("multiply"),
    "reduce_and": _reduced("both", "and"),
    "reduce_or": _reduced("both", "or"),
    "dot_general": _dot,
}

MOVED: dict[str, tuple[int, ...]] = {
    "gather": (0,),
    "dynamic_slice": (0,),
    "dynamic_update_slice": (0, 1),
    "scatter": (0, 2),
}
