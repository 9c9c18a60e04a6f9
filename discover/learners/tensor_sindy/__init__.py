"""Sparse regression on a frame-invariant library, from shear stress alone."""

from discover.learners.tensor_sindy.estimator import TensorSINDy
from discover.learners.tensor_sindy.optimisers import OPTIMISERS

__all__ = ["OPTIMISERS", "TensorSINDy"]
