"""The training data of a network, laid out for batched integration."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import diffrax
import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from discover.dataset.run import Run
from discover.forward import Records
from discover.forward.fluids import observed_on_grid
from discover.forward.grids.flow_batch import FlowBatch
from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.multimode import Fluid
from discover.laws.tensor_basis_network import TensorBasisNetwork
from discover.laws.textbook.classical import UpperConvectedMaxwell
from discover.learners.runs import laid_out
from discover.programs import on_device
from discover.statistics.noise.noise_model import rms

STRAIN_STEP = 0.2
"""Largest strain of a step of the integration."""

_IN_REVERSE = diffrax.RecursiveCheckpointAdjoint()


class TrainingProblem(eqx.Module):
    """Records of several runs, and the modes that the network serves.

    `stress`: root-mean-square of the stress of each run in Pa, with which the prior compares its
        states, shape (runs,).
    `modulus`, `relaxation_time`: of each mode, shape (k,), in Pa and s.
    """

    flows: FlowBatch  # the runs, on fixed time grids
    records: Records  # what was recorded, of one kind
    stress: Float[Array, " runs"]
    modulus: Float[Array, " k"]
    relaxation_time: Float[Array, " k"]
    solvent_viscosity: Float[Array, ""]  # in Pa s

    def fluid(self, law: AbstractConstitutiveLaw) -> Fluid:
        """Return the fluid of a trial law."""
        return Fluid(law, self.modulus, self.relaxation_time, self.solvent_viscosity)

    def predicted(
        self, law: AbstractConstitutiveLaw, adjoint: diffrax.AbstractAdjoint | None = None
    ) -> Float[Array, "runs n"]:
        """Return what is recorded of a trial law."""
        fluid = self.fluid(law)
        return self.flows.over(
            lambda protocol, grid: observed_on_grid(fluid, protocol, grid, adjoint)[:, 0]
        )

    def mean_squared_errors(self, law: AbstractConstitutiveLaw) -> Float[Array, " runs"]:
        """Return the mean squared error of each run, of stresses over the sum of the moduli.

        Its derivative, in reverse mode through the steps with recursive checkpoints, was
        measured at half the cost of storing every step and at a ninth of the continuous adjoint
        (51, 94 and 481 ms for the paper's network).
        """
        weight, total = self.records.weight, jnp.sum(self.modulus)
        unit = self.flows.over(lambda p, _: jnp.where(p.control == "stress", 1.0, total))
        scale = jnp.where(weight > 0, weight * unit[:, None], 1.0)
        errors = self.records.residual(self.predicted(law, _IN_REVERSE)) / scale
        return jnp.sum(errors**2, axis=1) / jnp.sum(weight > 0, axis=1)


def make_problem(
    runs: Sequence[Run],
    modulus: Float[np.ndarray, " k"],
    relaxation_time: Float[np.ndarray, " k"],
    strain_step: float = STRAIN_STEP,
    solvent_viscosity: float = 0.0,
    known_relaxation: bool = True,
    base: AbstractConstitutiveLaw | None = None,
    **limits: Any,
) -> TrainingProblem:
    """Return the training problem of some runs.

    The default grid is that of the paper's series with a step of 0.1: its error, 4e-6 of the
    stress, is far below what a network reaches.

    `runs`: runs whose record is learned. `modulus`, `relaxation_time`: modes, in Pa and s.
    `strain_step`: largest strain of a step of the integration. `solvent_viscosity` in Pa s.
    `known_relaxation`: whether the fluid relaxes in these times, and not only in what is learned;
    ignored where `base` is given. `base`: the known law, for steps that follow it; by default UCM.
    `**limits`: further limits of steps, as `make_grid` takes them. Raises InputError if what was
    recorded in a run is zero throughout.
    """
    law = UpperConvectedMaxwell(known_relaxation) if base is None else base
    known = Fluid(law, modulus, relaxation_time)
    flows, records = laid_out(runs, known, mean="runs", strain_step=strain_step, **limits)
    own = [run.recorded if run.quantity in ("N1", "N2") else run.stress for run in runs]
    return TrainingProblem(
        flows,
        # what was recorded beside σ12 is not learned
        records.of_one_kind(),
        on_device(np.array([rms(stress) for stress in own])),
        on_device(modulus),
        on_device(relaxation_time),
        jnp.asarray(solvent_viscosity),
    )


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
