"""Settings of the default recipe, and what it gives."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from discover.laws.tensor_basis_network import TensorBasisNetwork


@dataclass(frozen=True)
class DefaultRecipe:
    """Settings of the default recipe; none of them knows which law made the data.

    Attributes
    ----------
    width
        Neurons in each of two hidden layers; half as many where coefficients vary little.
    affordable
        Work (modes times runs times steps of time) up to which functions on single tensors are
        tried; the recipe ``"thorough"`` always tries them.
    samples
        Most samples of a run that are fitted where the work is more than that.
    strengths
        Strength of the penalty in the rounds of the first stage, relative to the squared stress.
    variations
        Strength of the penalty on variation, likewise: the first that leaves noise alone ends.
    steps
        Levenberg–Marquardt steps a round, and for each tensor tried.
    polish_steps
        Steps after the penalty is gone.
    max_tensors
        Most tensors with coefficients that vary.
    removed_below
        A term whose root mean square is below this part of the largest is removed.
    resolved
        Relative misfit below which no further tensor is asked for: less than rheometers resolve.
    exact
        Relative misfit at which data count as fitted exactly: the error of integration.
    """

    width: int = 12
    affordable: float = 6000.0
    samples: int = 100
    strengths: tuple[float, ...] = (1e-3, 1e-4)
    variations: tuple[float, ...] = (1.0, 0.1, 1e-2, 1e-3)
    steps: int = 10
    polish_steps: int = 40
    max_tensors: int = 3
    removed_below: float = 2e-3
    resolved: float = 5e-4
    exact: float = 1e-5


@dataclass(frozen=True)
class Trained:
    """A trained law.

    Attributes
    ----------
    law
        After the polish without prior.
    penalised_law
        As the prior left it.
    misfits
        Norm of all residuals after each step.
    misfit
        Relative misfit to the data at the end.
    varies
        Whether the network part was needed.
    message
        How the training ended.
    tensors
        Tensors whose coefficients vary, in the order in which they were taken.
    passed_over
        The other tensors, from which a law could have started, the least misfit first.
    others
        Less likely laws that were met on the way.
    left_out
        What was not tried, to save time, in words.
    """

    law: TensorBasisNetwork
    penalised_law: TensorBasisNetwork
    misfits: Float[np.ndarray, " m"]
    misfit: float
    varies: bool
    message: str
    tensors: tuple[int, ...] = ()
    passed_over: tuple[int, ...] = ()
    others: "tuple[Trained, ...]" = ()
    left_out: str = ""
