"""Runs, known physics and a library, laid out once so that every trial law shares a program."""

from collections.abc import Iterable
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from discover.errors import InputError
from discover.forward import Records
from discover.forward.grids.flow_batch import FlowBatch
from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.multimode import Fluid
from discover.laws.textbook.maxwell import UpperConvectedMaxwell
from discover.learners.laid_out_runs import laid_out
from discover.learners.runs import as_runs
from discover.programs import on_device
from discover.statistics import root_of
from tensor_library.library import TermLibrary

_PADDED_SAMPLES = 16
_PADDED_STEPS = 32


class TrajectoryProblem(eqx.Module):
    """Runs, known physics and library of a fit.

    Attributes
    ----------
    library
        Candidate terms of the unknown part.
    base
        The known law; the library's terms are added to its extra term.
    modulus, relaxation_time
        Of each mode, shape (k,), in Pa and s.
    solvent_viscosity
        In Pa s.
    modulus_error
        R with moduli G + R u, u of unit variance, as a sweep leaves them, shape (k, k), in Pa; of
        one with a solvent its row comes last. Zero where they are exact.
    flows
        The runs and their grids.
    records
        What was recorded, of three kinds.
    order_of_time
        Time over the duration of the run, shape (runs, n); infinite at padding.
    """

    library: TermLibrary = eqx.field(static=True)
    base: AbstractConstitutiveLaw
    modulus: Float[Array, " k"]
    relaxation_time: Float[Array, " k"]
    solvent_viscosity: Float[Array, ""]
    modulus_error: Float[Array, "c c"]
    flows: FlowBatch
    records: Records
    order_of_time: Float[Array, "runs n"]


def make_problem(
    runs: Iterable[Any],
    library: TermLibrary,
    modulus: Any = 1.0,
    relaxation_time: Any = 1.0,
    solvent_viscosity: float = 0.0,
    base: AbstractConstitutiveLaw | None = None,
    known_relaxation: bool = True,
    use_normal_stresses: bool = False,
    strain_step: float = 0.1,
    modulus_covariance: Any = None,
    **limits: Any,
) -> TrajectoryProblem:
    """Return the problem of finding library terms from runs.

    Parameters
    ----------
    runs
        Measured or synthetic runs.
    library
        Candidate terms.
    modulus, relaxation_time, solvent_viscosity
        Known linear viscoelasticity, in Pa, s and Pa s; the first two numbers, or one for each
        mode.
    base
        Known law, by default UCM, with or without its linear relaxation.
    known_relaxation
        Whether −σ is known; ignored where `base` is given.
    use_normal_stresses
        Whether N1 and N2, where measured, are observed too.
    strain_step
        Largest strain between two steps of the integration.
    modulus_covariance
        Of the moduli, in Pa²; None where they are exact.
    **limits
        Further limits of steps, as `make_grid` takes them.

    Raises
    ------
    InputError
        If runs or moduli are unusable, or normal stresses would be fitted twice.
    """
    runs = as_runs(runs)
    own = [run.name for run in runs if run.quantity in ("N1", "N2")]
    if use_normal_stresses and own:
        raise InputError(
            f"{own[0]!r} is a record of its own, which use_normal_stresses would fit once more. "
            "Leave out one of the two."
        )
    modulus = np.atleast_1d(np.asarray(modulus, dtype=float))
    relaxation_time = np.atleast_1d(np.asarray(relaxation_time, dtype=float))
    if modulus.shape != relaxation_time.shape or modulus.ndim != 1:
        raise InputError(
            "modulus and relaxation_time must have one value for each mode; got shapes "
            f"{modulus.shape} and {relaxation_time.shape}."
        )
    for label, values in (("modulus", modulus), ("relaxation_time", relaxation_time)):
        if not np.all(np.isfinite(values) & (values > 0)):
            raise InputError(f"{label} must be positive and finite; got {values.tolist()}.")
    base = UpperConvectedMaxwell(known_relaxation) if base is None else base
    flows, records = laid_out(
        runs,
        Fluid(base, modulus, relaxation_time),
        use_normal_stresses,
        samples_in=_PADDED_SAMPLES,
        steps_in=_PADDED_STEPS,
        strain_step=strain_step,
        **limits,
    )
    order = np.full(records.recorded.shape[:2], np.inf)
    for row, run in zip(order, runs, strict=True):
        row[: len(run)] = run.time / max(run.time[-1], np.finfo(float).tiny)
    return TrajectoryProblem(
        library=library,
        base=base,
        modulus=on_device(modulus),
        relaxation_time=on_device(relaxation_time),
        solvent_viscosity=jnp.asarray(float(solvent_viscosity)),
        modulus_error=on_device(_root(modulus_covariance, len(modulus))),
        flows=flows,
        records=records,
        order_of_time=on_device(order),
    )


def _root(covariance: Any, n_modes: int) -> np.ndarray:
    """Return R with RRᵀ the covariance of moduli; zero for none."""
    if covariance is None:
        return np.zeros((n_modes, n_modes))
    values = np.asarray(covariance, dtype=float)
    usable = values.shape in ((n_modes,) * 2, (n_modes + 1,) * 2) and np.all(np.isfinite(values))
    if not usable or not np.allclose(values, values.T):
        raise InputError(
            "modulus_covariance must be a symmetric matrix in Pa² with one row for each mode, and "
            f"one for a solvent or none; got the shape {values.shape} for {n_modes} modes."
        )
    return root_of(values)
