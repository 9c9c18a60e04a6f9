"""Shapes written on functions are checked while the tests run; only whole commands go without."""

import jaxtyping
import numpy as np
import pytest

from discover.protocols import start_up
from discover.simulate.grid import make_grid


def test_a_shape_that_does_not_fit_is_an_error():
    assert not jaxtyping.config.jaxtyping_disable
    with pytest.raises(jaxtyping.TypeCheckError):
        make_grid(start_up(1.0), np.zeros((2, 2)))
