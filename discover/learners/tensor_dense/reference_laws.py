"""Named laws about which the prior is centred, each fitted to the data with its own constants.

σ12 is fitted alike by laws that differ in N1, and the terms that a prior about one law needs to
imitate another bend N1 on the way. So the prior is put about each of several laws in turn. One of
them, of White and Metzner, is no sum of library terms.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.optimize import least_squares

from discover.laws.base import (
    AbstractConstitutiveLaw,
    AbstractExtendedLaw,
    State,
    as_state,
    stress_in,
)
from discover.learners.trajectories.problem import TrajectoryProblem
from discover.learners.trajectories.sensitivities import predict_many
from tensor_library.algebra import Symmetric
from tensor_library.integrity_basis import TENSOR_NAMES, integrity_basis
from tensor_library.invariants import INVARIANT_NAMES, scalar_invariants

_RATE_SQUARED = INVARIANT_NAMES.index("tr(gammadot.gammadot)")
_SQUARE = TENSOR_NAMES.index("sigma.sigma")
_PRODUCT = TENSOR_NAMES.index("sigma.gammadot+gammadot.sigma")

MOBILITY, SLIP, EXTENSIBILITY, RATE_FACTOR, RATE_EXPONENT = range(5)
N_CONSTANTS = 5


class ReferenceLaw(AbstractExtendedLaw):
    """h = α σ·σ + (ξ/2)(σ·γ̇ + γ̇·σ) + (ε tr σ + k |γ̇|ᵐ) σ + r σ, on top of a known law.

    [Giesekus 1982, JNNFM 11, 69; Johnson & Segalman 1977, JNNFM 2, 255; Phan-Thien & Tanner 1977,
    JNNFM 2, 353; White & Metzner 1963, J. Appl. Polym. Sci. 7, 1867, with Cross's 1/λ(γ̇)]

    Attributes
    ----------
    constants
        α, ξ, ε, k and m.
    relaxation
        r: one where the known law lacks −σ, else zero.
    linear_relaxation
        Whether the known law holds −σ.
    """

    constants: Float[Array, " 5"]
    relaxation: Float[Array, ""]
    base: AbstractConstitutiveLaw
    linear_relaxation: bool = eqx.field(static=True, default=True)

    def extra_term(self, stress: State, rate: Symmetric) -> State:
        """Return h(σ, γ̇), the known law's included."""
        mobility, slip, extensibility, factor, exponent = self.constants
        own = stress_in(stress)
        tensors, invariants = integrity_basis(own, rate), scalar_invariants(own, rate)
        squared = 0.5 * invariants[_RATE_SQUARED]
        flows = squared > 0.0
        # at rest a power of the rate has no derivative
        power = jnp.where(flows, jnp.where(flows, squared, 1.0) ** (0.5 * exponent), 0.0)
        faster = extensibility * invariants[0] + factor * power
        added = (
            mobility * tensors[_SQUARE]
            + 0.5 * slip * tensors[_PRODUCT]
            + (self.relaxation + faster) * own
        )
        return self.base.extra_term(stress, rate) + as_state(added, stress)


@dataclass(frozen=True)
class Reference:
    """A named law as a centre of the prior.

    Attributes
    ----------
    free
        Start and range of its free constants, by position.
    terms
        What it adds to the library's coefficients, by spelling: the position of a constant and
        its factor; None if it is no sum of library terms.
    """

    free: Mapping[int, tuple[float, float, float]]
    terms: Mapping[str, tuple[int, float]] | None


REFERENCES: Mapping[str, Reference] = {
    "ucm": Reference({}, {}),
    "giesekus": Reference({MOBILITY: (0.2, 0.0, 1.0)}, {"sigma.sigma": (MOBILITY, 1.0)}),
    "johnson_segalman": Reference(
        {SLIP: (0.2, 0.0, 1.9)}, {"sigma.gammadot+gammadot.sigma": (SLIP, 0.5)}
    ),
    "ptt_linear": Reference(
        {EXTENSIBILITY: (0.2, 0.0, 10.0)}, {"tr(sigma)*sigma": (EXTENSIBILITY, 1.0)}
    ),
    "white_metzner": Reference(
        {RATE_FACTOR: (0.4, 0.0, 10.0), RATE_EXPONENT: (0.6, 0.1, 2.0)}, None
    ),
}
"""Centres of the prior by name."""

_RUNAWAY = 10.0
"""Relative misfit that stands for running away: worse than no stress at all."""

_EVALUATIONS = 20
_STEP = 1e-4


def with_reference(
    problem: TrajectoryProblem, constants: Float[np.ndarray, " 5"]
) -> TrajectoryProblem:
    """Return a problem whose known law is the reference law with these constants."""
    return eqx.tree_at(lambda p: p.base.constants, problem, jnp.asarray(constants, float))


def fit_reference(problem: TrajectoryProblem, name: str) -> tuple[Float[np.ndarray, " 5"], float]:
    """Return the constants of a reference law that fit best, and the relative misfit."""
    free = REFERENCES[name].free
    places = list(free)

    def constants(values) -> np.ndarray:
        filled = np.zeros(N_CONSTANTS)
        filled[RATE_EXPONENT] = 1.0
        filled[places] = values
        return filled

    def residual(values) -> np.ndarray:
        return _residual(problem, constants(values))

    values = np.zeros(0)
    if free:
        start, low, high = (np.array(column) for column in zip(*free.values(), strict=True))
        found = least_squares(
            residual,
            start,
            bounds=(low, high),
            diff_step=_STEP,
            x_scale=0.1,
            max_nfev=_EVALUATIONS,
        )
        values = found.x
    return constants(values), float(np.linalg.norm(residual(values)))


def left_beside_modes(
    problem: TrajectoryProblem,
    name: str,
    constants: Float[np.ndarray, " 5"],
    shifts: Float[np.ndarray, "rows k"],
    prior: float,
) -> float:
    """Return the relative misfit of a fitted reference law where the moduli may move too.

    To first order, constants moving along.

    Parameters
    ----------
    problem, name, constants
        Data, law, and its constants as `fit_reference` returns them.
    shifts
        Change of the weighted predictions with each error of the moduli, of unit size.
    prior
        Weight of such an error beside the relative misfit, σ/√n.
    """
    residual, columns = _residual(problem, constants), [shifts]
    for place in REFERENCES[name].free:
        moved = constants.copy()
        moved[place] += _STEP
        columns.append((_residual(problem, moved) - residual)[:, None] / _STEP)
    design = np.hstack(columns)
    errors = shifts.shape[1]
    held = np.hstack([prior * np.eye(errors), np.zeros((errors, design.shape[1] - errors))])
    target = np.append(-residual, np.zeros(errors))
    change = np.linalg.lstsq(np.vstack([design, held]), target, rcond=None)[0]
    return float(np.linalg.norm(residual + design @ change))


def _residual(problem: TrajectoryProblem, constants) -> Float[np.ndarray, " rows"]:
    """Return prediction minus data of a reference law; where it runs away, of a size that shows."""
    target = problem.records.weighted_record
    at = with_reference(problem, constants)
    nothing = jnp.zeros((1, len(problem.library)))
    predicted = predict_many(at, jnp.arange(nothing.shape[1]), nothing, jnp.zeros((1, 0)))
    largest = _RUNAWAY / np.sqrt(target.size)
    left = np.nan_to_num(np.asarray(predicted)[0] - target, nan=largest)
    return np.clip(left, -largest, largest)
