"""The training data of a network, laid out for batched integration."""

from collections.abc import Sequence

import diffrax
import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from discover.dataset.run import Run
from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.multimode import Fluid
from discover.simulate.enough_steps import in_enough_steps
from discover.simulate.flow_batch import FlowBatch, lay_out
from discover.simulate.solve import solve_on_grid

_IN_REVERSE = diffrax.RecursiveCheckpointAdjoint()


class TrainingProblem(eqx.Module):
    """Recorded stress of several runs, and the modes that the network serves.

    Attributes
    ----------
    flows
        The runs, on fixed time grids.
    target
        Measured stress over the sum of the moduli, shape (runs, n).
    size
        Of a flow curve's samples, whose misfits are told in units of each; 0 for other runs, of
        which that is the root-mean-square. Shape (runs, n).
    sample_mask
        Which samples are looked at, shape (runs, n): False where one is padding.
    modulus, relaxation_time
        Of each mode, shape (k,); the moduli sum to one.
    """

    flows: FlowBatch
    target: Float[Array, "runs n"]
    size: Float[Array, "runs n"]
    sample_mask: Bool[Array, "runs n"]
    modulus: Float[Array, " k"]
    relaxation_time: Float[Array, " k"]

    def fluid(self, law: AbstractConstitutiveLaw) -> Fluid:
        """Return the fluid of a trial law, in units of the total modulus."""
        return Fluid(law, self.modulus, self.relaxation_time)

    def residual(
        self,
        law: AbstractConstitutiveLaw,
        adjoint: diffrax.AbstractAdjoint | None = None,
    ) -> Float[Array, "runs n"]:
        """Return predicted minus measured stress, zero where a sample is padding."""
        fluid = self.fluid(law)

        def one(protocol, grid):
            return protocol.recorded_stress(solve_on_grid(fluid, protocol, grid, adjoint).T)

        return self._missed_by(self.flows.over(one))

    def misses(self, states: Float[Array, "runs n k 4"]) -> Float[Array, "runs n"]:
        """Return predicted minus measured stress from the stresses of the modes at the samples."""
        total = jnp.tensordot(self.modulus, states, axes=(0, 2))

        def recorded(protocol, _, components):
            return protocol.recorded_stress(components.T)

        return self._missed_by(self.flows.over(recorded, total))

    def _missed_by(self, predicted: Float[Array, "runs n"]) -> Float[Array, "runs n"]:
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
        return jnp.sum(residual**2, axis=1) / jnp.sum(self.sample_mask, axis=1)


def make_problem(
    runs: Sequence[Run],
    modulus: Float[np.ndarray, " k"],
    relaxation_time: Float[np.ndarray, " k"],
    strain_step: float = 0.2,
    phase_step: float = 0.15,
    solvent_viscosity: float = 0.0,
    known_relaxation: bool = True,
    base: AbstractConstitutiveLaw | None = None,
) -> TrainingProblem:
    """Return the training problem of some runs.

    The default grid is that of the paper's series with a step of 0.1: its error, 4e-6 of the
    stress, is far below what a network reaches.

    Parameters
    ----------
    runs
        Runs whose σ12 is learned.
    modulus, relaxation_time
        Modes, in Pa and s.
    strain_step, phase_step
        Step limits of `discover.simulate.make_grid`.
    solvent_viscosity
        In Pa s. The solvent's stress follows from the rate alone, so it is taken off the record.
    known_relaxation
        Whether the fluid relaxes in these times, and not only in what is learned.
    base
        The known law, for steps that follow it; by default UCM.
    """
    total = float(np.sum(modulus))
    protocols = [run.protocol for run in runs]
    flows = lay_out(
        protocols,
        [run.time for run in runs],
        strain_step=strain_step,
        phase_step=phase_step,
        relaxation_time=float(np.max(relaxation_time)) if known_relaxation else None,
    )
    if base is not None:
        flows = in_enough_steps(Fluid(base, modulus, relaxation_time), flows)
    n = max(map(len, runs))
    records = [run.recorded - solvent_viscosity * _viscous(run) for run in runs]
    target = np.stack([np.pad(record, (0, n - len(record)), mode="edge") for record in records])
    own = [run.sizes(run.recorded) * (run.protocol.control == "steady") for run in runs]
    size = np.stack([np.pad(sizes, (0, n - len(sizes))) for sizes in own])
    return TrainingProblem(
        flows,
        jnp.asarray(target / total),
        jnp.asarray(size / total),
        jnp.asarray(np.arange(n) < np.array([[len(run)] for run in runs])),
        jnp.asarray(modulus / total),
        jnp.asarray(relaxation_time),
    )


def _viscous(run: Run) -> Float[np.ndarray, " n"]:
    """Return what a Newtonian fluid of unit viscosity adds to a record."""
    flow = run.protocol.kinematics
    return run.rate if flow is None else float(flow.viscous) * run.rate
