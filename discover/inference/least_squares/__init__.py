"""Least squares: one door, and two ways behind it.

- `fit_batch`: many starts of one forward model, advancing together within ranges, with derivatives
  by differences that steps correct. For a named law.
- `discover.inference.least_squares.tangents`: one descent by optimistix, inside a program or step
  by step, for residuals whose derivatives are integrated beside them. For the network. It is no
  part of this door, since it loads a solver that many commands do without.
"""

from discover.inference.least_squares.differences import Fit, best_of, fit_batch

__all__ = ["Fit", "best_of", "fit_batch"]
