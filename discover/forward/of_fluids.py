"""Fluids without instrument in flows of any control, many side by side: what is recorded of them.

Fluids go together that differ in numbers alone: those of their law, moduli, a solvent, and one
factor on all relaxation times.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Float

from discover.dataset.run import COLUMN_OF, Run
from discover.forward.declared import DeclaredModel, Structure
from discover.forward.flows import Batch, PeriodicFlows, make_batch
from discover.forward.grid import STRAIN_STEP, was_periodic
from discover.forward.predictor import Predictor, Trials
from discover.forward.program import program_of
from discover.forward.side_by_side import MadeOnce
from discover.laws.expansion import in_shared_form
from discover.laws.multimode import Fluid
from discover.protocols.kinematics import FOLLOWED, MODULI
from discover.protocols.protocol import FlowProtocol, recorded_at, shear_rates, strains_in_table

# Change on halving every step, relative to the size of a run, up to which steps are short enough
# for chains as they retract, and the most pieces that a step is cut into
_TOLERANCE, _MOST_PIECES = 1e-4, 8

# σ11, σ22, σ33 and σ12 of the rate of deformation, over L11, L22, L33 and L12
_OF_RATE = np.array([2.0, 2.0, 2.0, 1.0])


def bare_run(protocol: FlowProtocol, times: Float[np.ndarray, " n"], name: str = "run") -> Run:
    """Return a flow as a run of which zero is recorded; of oscillations their amplitudes."""
    nothing = np.zeros(len(times))
    columns: dict[str, Any] = {}
    if protocol.table_strains is not None:
        columns["strain"] = strains_in_table(protocol, times)
    if protocol.control == "oscillation":
        columns |= dict.fromkeys(MODULI, nothing)
    if protocol.quantity in ("N1", "N2"):
        columns[COLUMN_OF[protocol.quantity]] = nothing
    if protocol.control == "stress":
        return Run(name, times, protocol, nothing, nothing, **{"strain": nothing, **columns})
    return Run(name, times, protocol, shear_rates(protocol, times), nothing, **columns)


def followed(fluid: Fluid, run: Run) -> Run:
    """Return a run whose cycles are gone through where the fluid has no relaxation of its own."""
    if fluid.settling_time is not None or not was_periodic(run.protocol):
        return run
    return replace(run, protocol=replace(run.protocol, cycle=np.zeros(2)))


def observed(fluids: Sequence[Fluid], batch: Batch) -> Float[np.ndarray, "fluids runs n 3"]:
    """Return what is recorded of fluids, N1 and N2 in Pa: zero of sweeps, which have none.

    Not finite where a law runs away, or no state is reached.
    """
    predictor, trials = _BESIDE(*fluids)
    out = np.zeros((len(fluids), *batch.recorded.shape, 3))
    for number, (part, rows) in enumerate(zip(batch.parts, batch.rows, strict=True)):
        found = predictor.of_part(trials, batch, number, normal=True)
        if isinstance(part, PeriodicFlows):
            found[..., 1:] = 0.0
        out[:, rows, : found.shape[2]] = found
    return out


def observed_in(
    fluid: Fluid,
    protocol: FlowProtocol,
    times: Float[np.ndarray, " n"],
    strain_step: float = STRAIN_STEP,
    **how: Any,
) -> Float[np.ndarray, "n 3"]:
    """Return what `observed` does of one fluid in one flow, at times in s."""
    return observed([fluid], make_batch([bare_run(protocol, times)], strain_step, **how))[0, 0]


def components(fluids: Sequence[Fluid], batch: Batch) -> Float[np.ndarray, "fluids runs n s"]:
    """Return σ11, σ22, σ33, σ12 of the modes in Pa, without a solvent, in flows at a given rate.

    The structure variables stand behind, summed as if they were stresses.
    """
    predictor, trials = _BESIDE(*fluids)
    size = 4 + fluids[0].law.variables
    out = np.zeros((len(fluids), *batch.recorded.shape, size))
    for number, rows in enumerate(batch.rows):
        found = predictor.whole(trials, batch, number)[..., 2:]
        out[:, rows, : found.shape[2]] = found
    return out


def velocity_gradients(
    protocol: FlowProtocol, rates: Float[np.ndarray, " n"]
) -> Float[np.ndarray, "n 4"]:
    """Return L11, L22, L33 and L12 in 1/s of a flow at some rates."""
    flow = protocol.kinematics
    gradient = np.array([0.0, 0.0, 0.0, 1.0]) if flow is None else np.asarray(flow.gradient)
    return rates[:, None] * gradient


def of_solvent(
    fluid: Fluid, protocol: FlowProtocol, rates: Float[np.ndarray, " n"]
) -> Float[np.ndarray, "n 4"]:
    """Return σ11, σ22, σ33 and σ12 in Pa of a fluid's solvent in a flow at some rates."""
    return float(fluid.solvent_viscosity) * velocity_gradients(protocol, rates) * _OF_RATE


def recorded_and_normal(
    protocol: FlowProtocol, stress: Float[np.ndarray, "n 4"]
) -> Float[np.ndarray, "n 3"]:
    """Return what is recorded of a stress in a flow, N1 and N2."""
    s11, s22, s33, _ = stress.T
    return np.stack([recorded_at(protocol, stress), s11 - s22, s22 - s33], axis=-1)


def pieces_in_time(fluid: Fluid, runs: Sequence[Run], strain_step: float, **how: Any) -> int:
    """Return into how many pieces steps have to be cut for a fluid's chains as they retract.

    One for another law, or one that runs away. `strain_step`, `**how`: as of `make_batch`.
    """
    followed = all(run.protocol.control in FOLLOWED for run in runs)
    if not fluid.law.retracts or not followed:
        return 1

    def found(pieces: int) -> np.ndarray:
        return observed([fluid], make_batch(runs, strain_step, pieces=pieces, **how))[0]

    pieces, coarse = 1, found(1)
    while pieces < _MOST_PIECES:
        fine = found(2 * pieces)
        size = np.sqrt(np.mean(fine**2, axis=(1, 2)))
        apart = np.sqrt(np.mean((fine - coarse) ** 2, axis=(1, 2)))
        # not a number where the shorter steps run away too
        if not np.any(apart > _TOLERANCE * size) and np.all(np.isfinite(apart)):
            return pieces
        pieces, coarse = 2 * pieces, fine
    return pieces if np.all(np.isfinite(coarse)) else 1


def _side_by_side_predictor(*fluids: Fluid) -> tuple[Predictor, Trials]:
    """Return what predicts fluids, and the vectors that they are to it."""
    laws = [in_shared_form(fluid.law) for fluid in fluids]
    if len({jax.tree.structure(law) for law in laws}) > 1:
        laws = [fluid.law for fluid in fluids]
    numbers = np.array([_numbers_of(law) for law in laws])
    structure = Structure((), (), "", (), False, law_numbers=numbers.shape[1])
    first, program = fluids[0], program_of(structure)
    times = np.array([np.asarray(fluid.relaxation_time) for fluid in fluids])
    thetas = np.concatenate([np.zeros((len(fluids), 2)), numbers], axis=1)
    thetas[:, 1] = np.log(times[:, 0] / times[0, 0])
    moduli = [np.append(fluid.modulus, fluid.solvent_viscosity) for fluid in fluids]
    declared = DeclaredModel(laws[0], np.asarray(first.modulus), times[0])
    return Predictor(declared, program, program), Trials(thetas, np.array(moduli))


# flows of the same fluids are often asked for one after another
_BESIDE = MadeOnce(_side_by_side_predictor, kept=2)


def _numbers_of(law: Any) -> Float[np.ndarray, " numbers"]:
    leaves = jax.tree.leaves(eqx.filter(law, eqx.is_inexact_array))
    return np.concatenate([np.zeros(0), *(np.ravel(np.asarray(leaf)) for leaf in leaves)])
