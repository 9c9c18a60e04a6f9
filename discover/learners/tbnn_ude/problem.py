"""The training data of a network, laid out for batched integration."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from discover.dataset.run import Run
from discover.forward.enough_steps import in_enough_steps
from discover.forward.fluids import observed_on_grid
from discover.forward.grids.flow_batch import FlowBatch, lay_out
from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.multimode import Fluid
from discover.learners.own_loadings import signals_of, with_likely_factors
from discover.programs import on_device
from discover.protocols.kinematics import MODULI, STATES
from discover.protocols.protocol import FlowProtocol

STRAIN_STEP = 0.2
"""Largest strain of a step of the integration."""

_IN_REVERSE = diffrax.RecursiveCheckpointAdjoint()


class TrainingProblem(eqx.Module):
    """Records of several runs, and the modes that the network serves.

    Attributes
    ----------
    flows
        The runs, on fixed time grids.
    target
        What was recorded, over the sum of the moduli where it is in Pa, shape (runs, n).
    size
        Of the samples of a flow curve or a sweep, whose misfits are told in units of each; 0 for
        other runs, of which that is the root-mean-square. Shape (runs, n).
    stress_of_unit
        Stress over the sum of the moduli in a run, for each unit of its record: 1 where that is a
        stress. Shape (runs,).
    sample_mask
        Which samples are looked at, shape (runs, n): False where one is padding.
    modulus, relaxation_time
        Of each mode, shape (k,); the moduli sum to one.
    solvent_viscosity
        Over the sum of the moduli, in s; taken off every record but a strain.
    loading
        Of runs that are loadings of their own, as `signals_of` returns it in parts of the mean
        relative misfit, shape (runs,); None where none is.
    record
        What was recorded then, with the solvent's part, as `target` is; None where none is.
    """

    flows: FlowBatch
    target: Float[Array, "runs n"]
    size: Float[Array, "runs n"]
    stress_of_unit: Float[Array, " runs"]
    sample_mask: Bool[Array, "runs n"]
    modulus: Float[Array, " k"]
    relaxation_time: Float[Array, " k"]
    solvent_viscosity: Float[Array, ""]
    loading: Float[Array, " runs"] | None = None
    record: Float[Array, "runs n"] | None = None

    def less_factors(
        self, missed: Float[Array, "runs n"], scale: Float[Array, "runs n"] | float = 1.0
    ) -> Float[Array, "runs n"]:
        """Return what the likely factors of loadings leave of residuals.

        Parameters
        ----------
        missed
            What is predicted minus what was recorded.
        scale
            By what both are multiplied.
        """
        if self.loading is None or self.record is None:
            return scale * missed
        recorded = jnp.where(self.sample_mask, scale * self.record, 0.0)
        predicted = recorded + scale * missed
        return with_likely_factors(predicted, recorded, self.loading) - recorded

    def columns(
        self,
        missed: Float[Array, "runs n"],
        scale: Float[Array, "runs n"],
        jacobian: Float[Array, "runs n p"],
    ) -> Float[Array, "runs n p"]:
        """Return what weights change of `less_factors`, from what they change of predictions."""
        if self.loading is None:
            return scale[..., None] * jacobian
        _, change = jax.linearize(lambda some: self.less_factors(some, scale), missed)
        return jax.vmap(change, in_axes=-1, out_axes=-1)(jacobian)

    def fluid(self, law: AbstractConstitutiveLaw) -> Fluid:
        """Return the fluid of a trial law, in units of the total modulus."""
        return Fluid(law, self.modulus, self.relaxation_time)

    def beside(self, protocol: FlowProtocol) -> Float[Array, ""] | float:
        """Return the viscosity beside the modes that is not taken off the record of a flow."""
        return self.solvent_viscosity if protocol.control == "stress" else 0.0

    def residual(
        self,
        law: AbstractConstitutiveLaw,
        adjoint: diffrax.AbstractAdjoint | None = None,
    ) -> Float[Array, "runs n"]:
        """Return what is predicted minus what was recorded, zero where a sample is padding."""

        def one(protocol, grid):
            beside = self.beside(protocol)
            fluid = Fluid(law, self.modulus, self.relaxation_time, beside)
            return observed_on_grid(fluid, protocol, grid, adjoint)[:, 0]

        return self.missed_by(self.flows.over(one))

    def missed_by(self, predicted: Float[Array, "runs n"]) -> Float[Array, "runs n"]:
        """Return what is predicted minus what was recorded, zero where a sample is padding."""
        return jnp.where(self.sample_mask, predicted - self.target, 0.0)

    def mean_squared_errors(
        self,
        law: AbstractConstitutiveLaw,
        adjoint: diffrax.AbstractAdjoint = _IN_REVERSE,
    ) -> Float[Array, " runs"]:
        """Return the mean squared error of each run.

        The default adjoint, reverse mode through the steps with recursive checkpoints, was
        measured at half the cost of storing every step and at a ninth of the continuous adjoint
        (``benchmarks/adjoints.py``: 51, 94 and 481 ms for the paper's network).
        """
        residual = self.residual(law, adjoint)
        if self.loading is not None:
            scale = data_scale(self)
            residual = self.less_factors(residual, scale) / scale
        return jnp.sum(residual**2, axis=1) / jnp.sum(self.sample_mask, axis=1)


def data_scale(problem: TrainingProblem) -> Float[Array, "runs n"]:
    """Return the factor that turns residuals into parts of the mean relative misfit."""
    mask = problem.sample_mask
    # a run of which nothing is seen has no sample to count
    count = jnp.maximum(jnp.sum(mask, axis=1), 1)
    mean_square = jnp.sum(jnp.where(mask, problem.target, 0.0) ** 2, axis=1) / count
    # A run at rest has no scale of its own; unit modulus serves
    mean_square = jnp.where(mean_square > 0.0, mean_square, 1.0)
    size = jnp.where(problem.size > 0.0, problem.size, jnp.sqrt(mean_square)[:, None])
    return 1.0 / (size * jnp.sqrt(count * mask.shape[0])[:, None])


def make_problem(
    runs: Sequence[Run],
    modulus: Float[np.ndarray, " k"],
    relaxation_time: Float[np.ndarray, " k"],
    strain_step: float = STRAIN_STEP,
    phase_step: float = 0.15,
    solvent_viscosity: float = 0.0,
    known_relaxation: bool = True,
    base: AbstractConstitutiveLaw | None = None,
    **limits: Any,
) -> TrainingProblem:
    """Return the training problem of some runs.

    The default grid is that of the paper's series with a step of 0.1: its error, 4e-6 of the
    stress, is far below what a network reaches.

    Parameters
    ----------
    runs
        Runs whose record is learned.
    modulus, relaxation_time
        Modes, in Pa and s.
    strain_step, phase_step
        Step limits of `discover.simulate.make_grid`.
    solvent_viscosity
        In Pa s. The solvent's stress follows from the rate alone, so it is taken off a record of
        stress or moduli.
    known_relaxation
        Whether the fluid relaxes in these times, and not only in what is learned.
    base
        The known law, for steps that follow it; by default UCM.
    **limits
        Further limits of steps, as `make_grid` takes them.
    """
    total = float(np.sum(modulus))
    protocols = [_in_units_of(total, run.protocol) for run in runs]
    flows = lay_out(
        protocols,
        [run.time for run in runs],
        strain_step=strain_step,
        phase_step=phase_step,
        relaxation_time=float(np.max(relaxation_time)) if known_relaxation else None,
        **limits,
    )
    if base is not None:
        flows = in_enough_steps(Fluid(base, modulus, relaxation_time), flows)
    n = max(map(len, runs))
    unit = np.array([1.0 if run.quantity == "strain" else total for run in runs])[:, None]
    records = [run.recorded - solvent_viscosity * _viscous(run) for run in runs]
    target = np.stack([np.pad(record, (0, n - len(record)), mode="edge") for record in records])
    whole = np.stack([np.pad(run.recorded, (0, n - len(run))) for run in runs])
    shares = np.array([run.weight / np.sqrt(len(run) * len(runs)) for run in runs])
    loading = signals_of(runs, shares)
    # a transient has the size of its record, unless it weighs more or less than others
    told = [run.protocol.control in STATES or run.weight != 1.0 for run in runs]
    sized = zip(runs, told, strict=True)
    own = [run.sizes(run.recorded) * each / run.weight for run, each in sized]
    size = np.stack([np.pad(sizes, (0, n - len(sizes))) for sizes in own])
    return TrainingProblem(
        flows,
        on_device(target / unit),
        on_device(size / unit),
        jnp.asarray([_stress_of_unit(run, total) for run in runs]),
        on_device(np.arange(n) < np.array([[len(run)] for run in runs])),
        on_device(modulus / total),
        on_device(relaxation_time),
        jnp.asarray(solvent_viscosity / total),
        loading,
        None if loading is None else on_device(whole / unit),
    )


def _in_units_of(total: float, protocol: FlowProtocol) -> FlowProtocol:
    """Return a protocol whose stress, where that is given, is in units of a modulus."""
    if protocol.control != "stress":
        return protocol
    return replace(protocol, table_rates=protocol.table_rates / total)


def _stress_of_unit(run: Run, total: float) -> float:
    if run.quantity not in ("strain", *MODULI):
        return 1.0
    recorded = float(np.sqrt(np.mean(run.recorded**2)))
    if run.quantity != "strain":
        recorded /= total
    return float(np.sqrt(np.mean(run.stress**2))) / total / recorded if recorded > 0.0 else 1.0


def _viscous(run: Run) -> Float[np.ndarray, " n"]:
    """Return what a Newtonian fluid of unit viscosity adds to a record."""
    if run.quantity == "loss_modulus":
        return run.angular_frequency
    if run.quantity in ("storage_modulus", "strain"):
        return np.zeros(len(run))
    flow = run.protocol.kinematics
    return run.rate if flow is None else float(flow.viscous) * run.rate
