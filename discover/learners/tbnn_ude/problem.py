"""Training problem of a network, laid out for batched integration, and its recipe."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from discover.dataset.run import Run
from discover.forward.flow_batch import FlowBatch, lay_out
from discover.forward.fluids import observed_in_reverse
from discover.forward.of_fluids import pieces_in_time
from discover.laws import AbstractConstitutiveLaw, Fluid, TensorBasisNetwork
from discover.learners.files import kept_in_files
from discover.programs import on_device
from discover.statistics.noise_model import rms

STRAIN_STEP = 0.2
"""Largest strain of a step of the integration."""


class Records(eqx.Module):
    """What was recorded in runs, and what every value weighs.

    A value weighs one over its size (`Run.sizes`) and over the roots of the numbers of samples and
    of runs, so that squares add up to a mean squared relative misfit. `recorded`: in Pa, of creep
    the strain. `weight`: zero at padding, and where nothing is looked at.
    """

    recorded: Float[Array, "runs n"]
    weight: Float[Array, "runs n"]

    @classmethod
    def of(cls, runs: Sequence[Run]) -> "Records":
        """Return what was recorded in runs."""
        recorded, weight = np.zeros((2, len(runs), max(map(len, runs))))
        for i, run in enumerate(runs):
            n = len(run)
            recorded[i, :n] = run.recorded
            weight[i, :n] = 1.0 / (run.sizes(run.recorded) * np.sqrt(n * len(runs)))
        return cls(on_device(recorded), on_device(weight))

    @property
    def seen(self) -> Bool[np.ndarray, "runs n"]:
        """Whether a value was recorded and is looked at."""
        return np.asarray(self.weight) > 0

    def residual(self, predicted: Float[Array, "runs n"]) -> Float[Array, "runs n"]:
        """Return predictions minus records, weighted; zero where none is looked at."""
        return jnp.where(self.weight > 0, self.weight * (predicted - self.recorded), 0.0)

    def linearised(
        self, predicted: Float[Array, "runs n"], columns: Float[Array, "runs n p"]
    ) -> tuple[Float[Array, "runs n"], Float[Array, "runs n p"]]:
        """Return the residual and its derivatives, of predictions and theirs."""
        weight = self.weight[..., None]
        return self.residual(predicted), jnp.where(weight > 0, weight * columns, 0.0)


class TrainingProblem(eqx.Module):
    """Records of several runs, and the modes that the network serves."""

    flows: FlowBatch  # the runs, on fixed time grids
    records: Records
    stress: Float[Array, " runs"]  # rms in Pa, with which the prior compares states
    modulus: Float[Array, " k"]  # in Pa
    relaxation_time: Float[Array, " k"]  # in s
    solvent_viscosity: Float[Array, ""]  # in Pa s

    def fluid(self, law: AbstractConstitutiveLaw) -> Fluid:
        """Return the fluid of a trial law."""
        return Fluid(law, self.modulus, self.relaxation_time, self.solvent_viscosity)

    def mean_squared_errors(self, law: AbstractConstitutiveLaw) -> Float[Array, " runs"]:
        """Return the mean squared error of each run, of stresses over the sum of the moduli.

        In reverse mode with recursive checkpoints at half the cost of storing every step and a
        ninth of the continuous adjoint (51, 94 and 481 ms for the paper's network).
        """
        import diffrax  # a second, of which no other recipe has any use

        fluid, in_reverse = self.fluid(law), diffrax.RecursiveCheckpointAdjoint()
        predicted = self.flows.over(
            lambda protocol, grid: observed_in_reverse(fluid, protocol, grid, in_reverse)[:, 0]
        )
        weight, total = self.records.weight, jnp.sum(self.modulus)
        unit = self.flows.over(lambda p, _: jnp.where(p.control == "stress", 1.0, total))
        scale = jnp.where(weight > 0, weight * unit[:, None], 1.0)
        errors = self.records.residual(predicted) / scale
        return jnp.sum(errors**2, axis=1) / jnp.sum(weight > 0, axis=1)


def make_problem(
    runs: Sequence[Run], known: Fluid, strain_step: float = STRAIN_STEP, **limits: Any
) -> TrainingProblem:
    """Return the training problem of some runs.

    `known`: fluid whose modes the network serves and whose steps are followed. `strain_step`: of
    the integration; the error of the default, 4e-6 of the stress, is far below what a network
    reaches. `**limits`: of steps, as of `make_grid`. Raises InputError if a record is zero
    throughout.
    """
    flows = lay_out(
        [run.protocol for run in runs],
        [run.time for run in runs],
        relaxation_time=known.settling_time,
        pieces=pieces_in_time(known, runs, strain_step),
        strain_step=strain_step,
        **limits,
    )
    own = [run.recorded if run.quantity in ("N1", "N2") else run.stress for run in runs]
    return TrainingProblem(
        flows,
        Records.of(runs),
        on_device(np.array([rms(stress) for stress in own])),
        on_device(np.asarray(known.modulus)),
        on_device(np.asarray(known.relaxation_time)),
        on_device(float(known.solvent_viscosity)),
    )


@kept_in_files
@dataclass(frozen=True)
class DefaultRecipe:
    """Settings of the default recipe, independent of the law that made the data.

    `strengths`, `variations`: of the penalties in successive rounds, relative to the squared
    stress; of the latter the first that leaves noise alone ends.
    """

    width: int = 12  # neurons in each of two hidden layers, half where coefficients vary little
    affordable: float = 6000.0  # modes × runs × steps up to which single tensors are tried
    samples: int = 100  # most samples of a run that are fitted where the work is more than that
    strengths: tuple[float, ...] = (1e-3, 1e-4)
    variations: tuple[float, ...] = (1.0, 0.1, 1e-2, 1e-3)
    steps: int = 10  # levenberg–Marquardt steps a round, and for each tensor tried
    polish_steps: int = 40  # steps after the penalty is gone
    max_tensors: int = 3  # most tensors with coefficients that vary
    removed_below: float = 2e-3  # rms over the largest term's below which a term is removed
    resolved: float = 5e-4  # relative misfit below what rheometers resolve
    exact: float = 1e-5  # that of integration


@dataclass(frozen=True)
class Trained:
    """Trained law."""

    law: TensorBasisNetwork  # after the polish without prior
    penalised_law: TensorBasisNetwork  # as the prior left it
    misfit: float  # relative misfit to the data at the end
    varies: bool  # whether the network part was needed
    message: str  # how the training ended
    tensors: tuple[int, ...] = ()  # those whose coefficients vary, in the order taken
    passed_over: tuple[int, ...] = ()  # others a law could have started from, least misfit first
    others: "tuple[Trained, ...]" = ()  # less likely laws that were met on the way
    left_out: str = ""  # what was not tried, to save time, in words
