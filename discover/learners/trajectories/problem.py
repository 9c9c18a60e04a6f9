"""The data of a fit, laid out once on the host so that every trial law shares one compilation."""

from collections.abc import Iterable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from discover.errors import InputError
from discover.forward.enough_steps import in_enough_steps
from discover.forward.grids.flow_batch import FlowBatch, lay_out
from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.multimode import Fluid
from discover.laws.textbook.maxwell import UpperConvectedMaxwell
from discover.learners.own_loadings import signals_of, with_likely_factors
from discover.learners.runs import as_runs
from discover.programs import on_device
from discover.statistics import root_of
from tensor_library.library import TermLibrary

OBSERVED = ("recorded", "first_normal_stress_difference", "second_normal_stress_difference")
"""What may be observed, in the order of the observation axis: σ12, N1, N2."""

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
        R with moduli G + R u, u of unit variance, as a sweep leaves them, shape (k, k), in Pa; zero
        where they are exact.
    flows
        The runs and their grids.
    target
        Observed σ12, N1, N2, shape (runs, n, 3), zero where nothing was observed.
    weight
        Of each observation: one over the root-mean-square of its run and kind, in a flow curve
        over its own size, over the square root of the number of observations; zero where nothing
        was observed; times how much it weighs. With equal weights a residual vector thus has a norm
        equal to the relative misfit.
    order_of_time
        Time over the duration of the run, shape (runs, n).
    loading
        Of runs that are loadings of their own, as `signals_of` returns it in units of the misfit,
        shape (runs,); None where none is.
    """

    library: TermLibrary = eqx.field(static=True)
    base: AbstractConstitutiveLaw
    modulus: Float[Array, " k"]
    relaxation_time: Float[Array, " k"]
    solvent_viscosity: Float[Array, ""]
    modulus_error: Float[Array, "k k"]
    flows: FlowBatch
    target: Float[Array, "runs n 3"]
    weight: Float[Array, "runs n 3"]
    order_of_time: Float[Array, "runs n"]
    loading: Float[Array, " runs"] | None = None

    def weighted(
        self, predicted: Float[Array, "runs n 3"], keep: Bool[Array, "runs n"] | None = None
    ) -> Float[Array, "runs n 3"]:
        """Return predictions in units of the misfit; zero where nothing was observed.

        Of runs that are loadings of their own with the factors that their records suggest.

        Parameters
        ----------
        predicted
            Of σ12, N1 and N2, in Pa.
        keep
            Which samples are looked at; all by default.
        """
        weight = self._kept(keep)
        found = jnp.where(weight > 0, weight * predicted, 0.0)
        if self.loading is None:
            return found
        # one loading has one factor, on σ12, N1 and N2
        rows = (found.shape[0], -1)
        recorded = (weight * self.target).reshape(rows)
        told = with_likely_factors(found.reshape(rows), recorded, self.loading)
        return told.reshape(found.shape)

    def weighted_columns(
        self,
        predicted: Float[Array, "runs n 3"],
        columns: Float[Array, "runs n 3 q"],
        keep: Bool[Array, "runs n"] | None = None,
    ) -> Float[Array, "runs n 3 q"]:
        """Return what parameters change of the `weighted` predictions.

        Parameters
        ----------
        predicted, keep
            As in `weighted`.
        columns
            What they change of the predictions.
        """
        weight = self._kept(keep)[..., None]
        if self.loading is None:
            return jnp.where(weight > 0, weight * columns, 0.0)
        _, change = jax.linearize(lambda p: self.weighted(p, keep), predicted)
        return jax.vmap(change, in_axes=-1, out_axes=-1)(columns)

    def _kept(self, keep):
        return self.weight if keep is None else jnp.where(keep[..., None], self.weight, 0.0)

    @property
    def weighted_target(self) -> Float[np.ndarray, " rows"]:
        """What was observed, in units of the misfit, in one vector."""
        return np.asarray(self.weight * self.target).reshape(-1)

    @property
    def n_observations(self) -> int:
        """Number of values observed."""
        return int(np.sum(np.asarray(self.weight) > 0))

    @property
    def run_of_row(self) -> Int[np.ndarray, " rows"]:
        """Run to which each row of the flattened observations belongs."""
        runs, samples, kinds = self.target.shape
        return np.repeat(np.arange(runs), samples * kinds)

    def sequences(self) -> list[np.ndarray]:
        """Return the rows of each run and observed quantity, in the order of time."""
        seen = np.asarray(self.weight) > 0
        runs, samples, kinds = seen.shape
        rows = np.arange(seen.size).reshape(runs, samples, kinds)
        sequences = [rows[i, seen[i, :, k], k] for i in range(runs) for k in range(kinds)]
        return [sequence for sequence in sequences if sequence.size]


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
    longest = max(len(run) for run in runs)
    padded = -(-longest // _PADDED_SAMPLES) * _PADDED_SAMPLES
    target = np.zeros((len(runs), padded, 3))
    weight = np.zeros_like(target)
    order = np.full((len(runs), padded), np.inf)
    for i, run in enumerate(runs):
        order[i, : len(run)] = run.time / max(run.time[-1], np.finfo(float).tiny)
        share = (run.weight, *run.normal_weights)
        for kind, name in enumerate(OBSERVED):
            values = getattr(run, name)
            if values is None or (kind > 0 and not use_normal_stresses):
                continue
            scale = float(np.sqrt(np.mean(values**2)))
            if scale == 0.0:
                if kind == 0:
                    raise InputError(
                        f"The shear stress of the run {run.name!r} is zero throughout: it says "
                        "nothing of the law. Leave the run out."
                    )
                continue  # a normal stress difference may vanish in truth, but sets no scale
            target[i, : len(run), kind] = values
            weight[i, : len(run), kind] = share[kind] / run.sizes(values)
    shares = np.array([run.weight for run in runs])
    base = UpperConvectedMaxwell(known_relaxation) if base is None else base
    fluid = Fluid(base, modulus, relaxation_time)
    flows = lay_out(
        [r.protocol for r in runs],
        [r.time for r in runs],
        padded,
        strain_step=strain_step,
        relaxation_time=fluid.settling_time,
        **limits,
    )
    return TrajectoryProblem(
        library=library,
        base=base,
        modulus=on_device(modulus),
        relaxation_time=on_device(relaxation_time),
        solvent_viscosity=jnp.asarray(float(solvent_viscosity)),
        modulus_error=on_device(_root(modulus_covariance, len(modulus))),
        flows=in_enough_steps(fluid, flows.with_steps_in(_PADDED_STEPS)),
        target=on_device(target),
        weight=on_device(weight / np.sqrt(np.sum(weight > 0))),
        order_of_time=on_device(order),
        loading=signals_of(runs, shares / np.sqrt(np.sum(weight > 0))),
    )


def _root(covariance: Any, n_modes: int) -> np.ndarray:
    """Return R with RRᵀ the covariance of moduli; zero for none."""
    if covariance is None:
        return np.zeros((n_modes, n_modes))
    values = np.asarray(covariance, dtype=float)
    usable = values.shape == (n_modes, n_modes) and np.all(np.isfinite(values))
    if not usable or not np.allclose(values, values.T):
        raise InputError(
            "modulus_covariance must be a symmetric matrix in Pa² with one row for each mode; got "
            f"the shape {values.shape} for {n_modes} modes."
        )
    return root_of(values)
