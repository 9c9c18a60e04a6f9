"""Shapes written on functions are checked while the tests run, on first calls in each file."""

import first_calls
import jax.numpy as jnp
import jaxtyping
import numpy as np
import pytest

from discover.forward.grid import make_grid
from discover.protocols import start_up
from tensor_library import trace


def test_a_shape_that_does_not_fit_is_an_error_on_first_calls_of_each_file():
    assert not jaxtyping.config.jaxtyping_disable
    with pytest.raises(jaxtyping.TypeCheckError):
        make_grid(start_up(1.0), np.zeros((2, 2)))
    with pytest.raises(jaxtyping.TypeCheckError):
        trace(jnp.zeros((5, 4)))
    flow, wrong = start_up(1.0), np.zeros((2, 2))
    first_calls.begin_file()
    for _ in range(first_calls.CALLS):
        with pytest.raises(jaxtyping.TypeCheckError):
            make_grid(flow, wrong)
    with pytest.raises(Exception, match=r".") as later:
        make_grid(flow, wrong)
    assert not isinstance(later.value, jaxtyping.TypeCheckError)
    first_calls.begin_file()
    with pytest.raises(jaxtyping.TypeCheckError):
        make_grid(flow, wrong)
