"""Ordinary SINDy, where all four stress components were measured: nothing is hidden."""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from pysindy.differentiation import BaseDifferentiation, FiniteDifference

from discover.errors import InputError
from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.maxwell import UpperConvectedMaxwell
from discover.learners.tensor_sindy.optimisers import SparseSolution, solve_sparse
from tensor_library.kinematics import rate_of_deformation
from tensor_library.library import TermLibrary


def derivative_problem(
    times: Sequence[np.ndarray],
    stresses: Sequence[np.ndarray],
    shear_rates: Sequence[np.ndarray],
    library: TermLibrary,
    known: AbstractConstitutiveLaw | None = None,
    differentiation: BaseDifferentiation | None = None,
) -> tuple[Float[np.ndarray, "rows terms"], Float[np.ndarray, " rows"]]:
    """Return design and target of the regression of stress rates on library terms.

    With the whole stress measured the linearised trajectory is not needed: at every sample
    known rate − dσ/dt = Σ cₙ termₙ, linear in c, and that is SINDy. The four components share their
    coefficients, so they are rows and not separate equations.

    Parameters
    ----------
    times, stresses, shear_rates
        For each run: dimensionless times, shape (n,), σ11, σ22, σ33, σ12, shape (n, 4), and shear
        rates, shape (n,).
    library
        Candidate terms; closed forms are taken at their default inner parameters.
    known
        The known law, by default UCM.
    differentiation
        A pysindy method; by default central differences of fourth order.

    Raises
    ------
    InputError
        If shapes disagree.
    """
    known = UpperConvectedMaxwell() if known is None else known
    differentiation = FiniteDifference(order=4) if differentiation is None else differentiation
    inner = jnp.asarray(library.inner_default)

    def at_sample(stress, shear_rate):
        terms = library.evaluate(stress, rate_of_deformation(shear_rate), inner)
        return terms, known.stress_rate(stress, shear_rate)

    designs, targets = [], []
    for time, stress, shear_rate in zip(times, stresses, shear_rates, strict=True):
        time, stress, shear_rate = (np.asarray(a, dtype=float) for a in (time, stress, shear_rate))
        if stress.shape != (time.size, 4) or shear_rate.shape != (time.size,):
            raise InputError(
                f"A run of {time.size} samples needs stresses of shape ({time.size}, 4) and as "
                f"many shear rates; got {stress.shape} and {shear_rate.shape}."
            )
        terms, rates = jax.vmap(at_sample)(jnp.asarray(stress), jnp.asarray(shear_rate))
        change = np.asarray(differentiation(stress, time))  # pyright: ignore[reportArgumentType]
        designs.append(np.moveaxis(np.asarray(terms), 1, 2).reshape(time.size * 4, -1))
        targets.append((np.asarray(rates) - change).reshape(-1))
    return np.concatenate(designs), np.concatenate(targets)


def regress_full_stress(
    times: Sequence[np.ndarray],
    stresses: Sequence[np.ndarray],
    shear_rates: Sequence[np.ndarray],
    library: TermLibrary,
    optimizer="stlsq",
    max_terms: int = 5,
    **problem,
) -> list[SparseSolution]:
    """Return the sparse solutions of ordinary SINDy, from dense to empty.

    Parameters
    ----------
    times, stresses, shear_rates, library, **problem
        As in `derivative_problem`.
    optimizer, max_terms
        As in `TensorSINDy`.
    """
    design, target = derivative_problem(times, stresses, shear_rates, library, **problem)
    return solve_sparse(optimizer, design, target, max_terms)
