"""The whole library with a Gaussian prior: what σ12 leaves open if the law is not sparse."""

from discover.learners.tensor_dense.estimator import TensorDense

__all__ = ["TensorDense"]
