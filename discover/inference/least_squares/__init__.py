"""Least squares: one door, and two ways behind it.

- `fit_batch`: many starts and sets of free parameters of one forward model, advancing together
  within ranges, with derivatives by differences that steps correct. For the closed loop, where a
  residual costs little and a set of candidates is a vector with zeros.
- `discover.inference.least_squares.tangents`: one descent by optimistix, inside a program or step
  by step, for residuals whose derivatives are integrated beside them. For the learners. It is no
  part of this door, since it loads a solver that many commands do without.
"""

from discover.inference.least_squares.differences import fit_batch
from discover.inference.least_squares.fit import NO_PRIOR, Fit, Prior, best_of
from discover.inference.least_squares.steps import gauss_newton_step, room_of, stepped

__all__ = [
    "NO_PRIOR",
    "Fit",
    "Prior",
    "best_of",
    "fit_batch",
    "gauss_newton_step",
    "room_of",
    "stepped",
]
