"""What lanes do not know, called on the way as JAX compiles it, for all lanes at once."""

import ctypes
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import llvmlite.ir as ir
import numpy as np
from jax.extend.core import jaxpr_as_fun

from discover.programs.lanes.arithmetic import DOUBLES, INTEGER, LANES, TRUTH, Arithmetic

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
