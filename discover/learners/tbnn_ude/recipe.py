"""Settings of the default recipe, and what it gives."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from discover.laws.tensor_basis_network import TensorBasisNetwork


@dataclass(frozen=True)
class DefaultRecipe:
    """Settings of the default recipe; none of them knows which law made the data.

    `width`: neurons in each of two hidden layers; half as many where coefficients vary little.
    `affordable`: work (modes times runs times steps of time) up to which functions on single
        tensors are tried; the recipe ``"thorough"`` always tries them.
    `strengths`: strength of the penalty in the rounds of the first stage, relative to the squared
        stress.
    `variations`: strength of the penalty on variation, likewise: the first that leaves noise alone
        ends.
    `removed_below`: a term whose root mean square is below this part of the largest is removed.
    `resolved`: relative misfit below which no further tensor is asked for: less than rheometers
        resolve.
    `exact`: relative misfit at which data count as fitted exactly: the error of integration.
    """

    width: int = 12
    affordable: float = 6000.0
    samples: int = 100  # most samples of a run that are fitted where the work is more than that
    strengths: tuple[float, ...] = (1e-3, 1e-4)
    variations: tuple[float, ...] = (1.0, 0.1, 1e-2, 1e-3)
    steps: int = 10  # levenberg–Marquardt steps a round, and for each tensor tried
    polish_steps: int = 40  # steps after the penalty is gone
    max_tensors: int = 3  # most tensors with coefficients that vary
    removed_below: float = 2e-3
    resolved: float = 5e-4
    exact: float = 1e-5


@dataclass(frozen=True)
class Trained:
    """A trained law.

    `tensors`: tensors whose coefficients vary, in the order in which they were taken.
    `passed_over`: the other tensors, from which a law could have started, the least misfit first.
    """

    law: TensorBasisNetwork  # after the polish without prior
    penalised_law: TensorBasisNetwork  # as the prior left it
    misfits: Float[np.ndarray, " m"]  # norm of all residuals after each step
    misfit: float  # relative misfit to the data at the end
    varies: bool  # whether the network part was needed
    message: str  # how the training ended
    tensors: tuple[int, ...] = ()
    passed_over: tuple[int, ...] = ()
    others: "tuple[Trained, ...]" = ()  # less likely laws that were met on the way
    left_out: str = ""  # what was not tried, to save time, in words
