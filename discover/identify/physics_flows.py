"""Flows in which laws are checked, many at once."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from discover.equations.equation import mean_relaxation_time
from discover.forward import make_batch
from discover.forward.of_fluids import (
    bare_run,
    followed,
    observed,
    of_each_mode,
    of_solvent,
    pieces_in_time,
    recorded_and_normal,
    velocity_gradients,
)
from discover.laws import Fluid
from discover.laws.each_mode import over_modes
from discover.laws.expansion import in_shared_form
from discover.programs import compiled, on_device
from discover.protocols.kinematics import FOLLOWED
from discover.protocols.protocol import FlowProtocol, oscillatory_shear
from discover.words import plainly

_CYCLES = 3
_SAMPLES_A_CYCLE = 48


@dataclass(frozen=True)
class Trajectories:
    """What a fluid does along flows: what is recorded, and what its conformation says.

    `observed`: of each flow what is recorded, N1 and N2 in Pa, shape (n, 3); not finite where the
    law diverges. `smallest_conformation`: eigenvalue of I + σ/G, the least over modes and samples,
    shape (flows,); nan where the law diverges, and in flows at no given rate. `dissipation`: the
    least σ:d − dF/dt over G/λ, with the energy F of Hookean dumbbells; nan if undefined.
    """

    observed: tuple[Float[np.ndarray, "_ 3"], ...]
    smallest_conformation: Float[np.ndarray, " flows"]
    dissipation: Float[np.ndarray, " flows"]

    def some(self, flows: Sequence[int]) -> "Trajectories":
        """Return those along some of the flows."""
        kept = list(flows)
        observed = tuple(self.observed[i] for i in kept)
        return Trajectories(observed, self.smallest_conformation[kept], self.dissipation[kept])

    @staticmethod
    def lowest(values: Float[np.ndarray, " flows"]) -> tuple[int | None, float]:
        """Return the flow with the smallest value, and the value; None where there is none."""
        if not np.any(np.isfinite(values)):
            return None, float("nan")
        flow = int(np.nanargmin(values))
        return flow, float(values[flow])


_STRAIN_STEP = 0.15
"""Largest strain of a step: the stress of a Giesekus fluid is then off by less than 1e-6."""

# Numbers of states are rounded up to multiples of this, so that they share programs
_STATES = 1024


def trajectories(
    fluid: Fluid, protocols: Sequence[FlowProtocol], times: Sequence[Float[np.ndarray, " _"]]
) -> Trajectories:
    """Return what a fluid does along flows from their starts on, at `times` in s."""
    runs = [followed(fluid, bare_run(*pair)) for pair in zip(protocols, times, strict=True)]
    steps = {
        "strain_step": _STRAIN_STEP,
        "relaxation_time": fluid.settling_time,
        "pieces": pieces_in_time(fluid, runs, _STRAIN_STEP),
    }
    given = [i for i, run in enumerate(runs) if run.protocol.control in FOLLOWED]
    solved = [i for i in range(len(runs)) if i not in given]
    found: list[Any] = [None] * len(runs)
    smallest, dissipation = np.full((2, len(runs)), np.nan)
    if solved:
        of_runs = observed([fluid], make_batch([runs[i] for i in solved], **steps))[0]
        for i, own in zip(solved, of_runs, strict=True):
            found[i] = own[: len(runs[i])]
    if given:
        of_modes = of_each_mode(fluid, make_batch([runs[i] for i in given], **steps))
        states = [of_modes[:, row, : len(runs[i])] for row, i in enumerate(given)]
        for i, own in zip(given, states, strict=True):
            flow, rates = runs[i].protocol, runs[i].rate
            stress = np.tensordot(np.asarray(fluid.modulus), own[..., :4], axes=1)
            found[i] = recorded_and_normal(flow, stress + of_solvent(fluid, flow, rates))
        gradients = [velocity_gradients(runs[i].protocol, runs[i].rate) for i in given]
        smallest[given], dissipation[given] = _energies(fluid, states, gradients)
    return Trajectories(tuple(found), smallest, dissipation)


def _energies(
    fluid: Fluid,
    states: Sequence[Float[np.ndarray, "k _ s"]],
    gradients: Sequence[Float[np.ndarray, "_ 4"]],
) -> tuple[Float[np.ndarray, " flows"], Float[np.ndarray, " flows"]]:
    """Return the smallest eigenvalue and the least dissipation of each of some flows.

    Not a number where the law diverges, or the conformation is not positive definite.
    """
    law, times = in_shared_form(fluid.law), np.asarray(fluid.relaxation_time)
    every, rates = np.concatenate(states, axis=1), np.concatenate(gradients)
    more = -every.shape[1] % _STATES
    every = np.pad(every, ((0, 0), (0, more), (0, 0))).swapaxes(0, 1)
    scaled = np.pad(rates, ((0, more), (0, 0)))[:, None] * times[:, None]
    both = _of_states(law, *map(on_device, (every, scaled)))
    ends = np.cumsum([len(rate) for rate in gradients])
    least, lost = (
        np.array([np.min(own) for own in np.split(np.asarray(of), ends)[:-1]]) for of in both
    )
    whole = np.array([np.all(np.isfinite(own)) for own in states])
    least = np.where(whole, least, np.nan)
    # without a positive definite conformation the stored energy is not defined
    return least, np.where(least > 0.0, lost, np.nan)


@compiled
def _of_states(law, states, gradients):
    smallest, dissipation = jax.vmap(over_modes(_energy, law))(states, gradients)
    return jnp.min(smallest, axis=1), jnp.min(dissipation, axis=1)


def _energy(law, stress, gradient):
    """Return the smallest eigenvalue of A = I + σ and the dissipation σ:d − dF/dt, dimensionless.

    F = (tr A − ln det A − 3)/2, so that dF/dt = tr((I − A⁻¹)·dA/dt)/2   [Beris & Edwards 1994,
    Thermodynamics of Flowing Systems; Wapperom & Hulsen 1998, J. Rheol. 42, 999].
    """
    change = law.stress_rate(stress, gradient)
    a11, a22, a33, a12 = 1.0 + stress[0], 1.0 + stress[1], 1.0 + stress[2], stress[3]
    determinant = a11 * a22 - a12**2
    middle, radius = 0.5 * (a11 + a22), jnp.hypot(0.5 * (a11 - a22), a12)
    smallest = jnp.minimum(middle - radius, a33)
    trace = change[0] + change[1] + change[2]
    inverse = (a22 * change[0] + a11 * change[1] - 2.0 * a12 * change[3]) / determinant
    stored = 0.5 * (trace - inverse - change[2] / a33)
    return smallest, jnp.sum(stress[:4] * gradient) - stored


@dataclass(frozen=True)
class Cycles:
    """Three cycles of oscillation from rest, over a grid of Weissenberg and Deborah numbers."""

    weissenberg: Float[np.ndarray, " flows"]  # with the mean relaxation time
    deborah: Float[np.ndarray, " flows"]  # likewise
    protocols: tuple[FlowProtocol, ...]
    times: tuple[Float[np.ndarray, " n"], ...]  # of samples, in s

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the flows, Weissenberg number first."""
        pairs = zip(self.weissenberg, self.deborah, strict=True)
        return tuple(f"oscillation at Wi = {plainly(wi)}, De = {plainly(de)}" for wi, de in pairs)

    def work(self, stress: Sequence[Float[np.ndarray, " n"]]) -> Float[np.ndarray, " flows"]:
        """Return ∫ σ12 γ̇ dt over the last cycle, over its length and the largest stress and rate.

        `stress`: σ12 of each flow in Pa. nan where the law diverges.
        """
        work = np.full(len(self.times), np.nan)
        for i, (values, times) in enumerate(zip(stress, self.times, strict=True)):
            if not np.all(np.isfinite(values)):
                continue
            last = slice(times.size - 1 - _SAMPLES_A_CYCLE, None)
            phase = np.linspace(0.0, 2.0 * np.pi, _SAMPLES_A_CYCLE + 1)
            largest = np.max(np.abs(values[last]))
            # equally spaced samples over a whole period: the trapezoidal rule is exact to rounding
            power = np.mean((values[last] * np.cos(phase))[:-1])
            work[i] = power / largest if largest > 0 else 0.0
        return work


def time_scale(fluid: Fluid) -> float:
    """Return Σ G λ² / Σ G λ in s."""
    return mean_relaxation_time(np.asarray(fluid.modulus), np.asarray(fluid.relaxation_time))


def cycles(scale: float, weissenberg: Sequence[float], deborah: Sequence[float]) -> Cycles:
    """Return the cycles of every pair of Wi and De. `scale`: the time, in s, that these are of."""
    pairs = [(wi, de) for wi in weissenberg for de in deborah]
    samples = np.linspace(0.0, _CYCLES * 2.0 * np.pi, _CYCLES * _SAMPLES_A_CYCLE + 1)
    numbers = np.array(pairs)
    return Cycles(
        numbers[:, 0],
        numbers[:, 1],
        tuple(oscillatory_shear(wi / scale, de / scale) for wi, de in pairs),
        tuple(samples * scale / de for _, de in pairs),
    )
