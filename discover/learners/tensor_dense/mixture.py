"""Many laws that fit alike: draws about several references, each with several widths of the prior.

One Gaussian about one optimum is too sure: laws whose N1 differ twofold fit σ12 to the noise. So
every optimum that fits takes part, and all count alike: evidence compares laws one of which is
right, and none may be. Only where a named law itself fits does evidence decide half of the weight.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from discover.errors import InputError
from discover.learners.tensor_dense.posterior import (
    log_evidence,
    mode,
    most_evident,
    spread,
)
from discover.learners.tensor_dense.reference_laws import (
    REFERENCES,
    fit_reference,
    left_beside_modes,
    with_reference,
)
from discover.learners.trajectories.modulus_errors import amounts_of, modulus_columns
from discover.learners.trajectories.problem import TrajectoryProblem
from discover.learners.trajectories.sensitivities import predict_many
from discover.statistics.noise.noise_model import noise_model

WIDTHS = (0.01, 0.03, 0.1, 0.3)
"""Widths κ of the prior, in units of one over the size of a term along the trajectories."""

FITS = 1.5
"""An optimum takes part whose misfit is at most so many times the noise."""

SHARED = 0.5
"""Weight that all optima share alike where a named law fits; everywhere else it is one."""

_NAMED_FITS = 1.05
"""A named law fits whose own misfit is at most so many times the noise."""

_NAMED_NEARLY_FITS = 1.1
"""Up to so many times the noise a named law is not ruled out, for 64 terms take up noise too."""

_PAIRS = 4
"""Draws about an optimum, in pairs of opposites."""

_STRAY = 1.25
"""A draw is kept whose misfit is at most so many times that of its optimum."""

_CORRECTIONS = 2
_FARTHEST = 6.0  # standard deviations that a correction may move a draw
_FIRST_WIDTH = 0.1
_NOISE_ROUNDS = 3
_FEWEST_RECORDS = 10.0


@dataclass(frozen=True)
class Optimum:
    """A mode of the posterior.

    Attributes
    ----------
    reference, constants
        The law about which the prior is centred.
    reference_misfit
        Relative misfit of that law alone.
    width
        κ of the prior.
    coefficients
        z, the scaled coefficients.
    columns, residual
        Prediction minus data in units of the relative misfit, and its derivatives with z.
    misfit
        Relative misfit.
    log_evidence
        Up to a constant that all share.
    """

    reference: str
    constants: Float[np.ndarray, " 5"]
    reference_misfit: float
    width: float
    coefficients: Float[np.ndarray, " n"]
    columns: Float[np.ndarray, "rows n"]
    residual: Float[np.ndarray, " rows"]
    misfit: float
    log_evidence: float = -np.inf


@dataclass(frozen=True)
class Mixture:
    """Laws that fit the data, each with its weight.

    Attributes
    ----------
    optima
        The modes that take part, and their weights, shape (optima,).
    weights
        Of the optima.
    noise
        Relative noise.
    records
        Number of independent records.
    scale
        Typical size of each coefficient.
    optimum_of_draw
        Position in `optima`, shape (draws,).
    coefficients
        Of the library, on top of the reference law, shape (draws, n).
    moduli
        Of each draw in Pa, shape (draws, k).
    weights_of_draws
        Adding up to one, shape (draws,).
    named_law_fits
        Whether one of the reference laws by itself may be the fluid's.
    """

    optima: tuple[Optimum, ...]
    weights: Float[np.ndarray, " optima"]
    noise: float
    records: float
    scale: Float[np.ndarray, " n"]
    optimum_of_draw: Int[np.ndarray, " draws"]
    coefficients: Float[np.ndarray, "draws n"]
    moduli: Float[np.ndarray, "draws c"]
    weights_of_draws: Float[np.ndarray, " draws"]
    named_law_fits: bool


def explore(
    problem: TrajectoryProblem,
    sizes: Callable[[Float[np.ndarray, " 5"]], Float[np.ndarray, " n"]],
    noise_floor: float,
    seed: int,
    progress: Callable[[str], None] | None,
) -> Mixture:
    """Return the laws of a library that fit the data.

    Parameters
    ----------
    problem
        Data; its known law is a `ReferenceLaw`.
    sizes
        Returns the root-mean-square of every term along the trajectories of a reference law, given
        its constants.
    noise_floor
        Relative misfit that no data are taken to go below.
    progress
        Called with a line of text, or None.

    Raises
    ------
    InputError
        If no reference law can be integrated through the runs.
    """
    say = progress or (lambda text: None)
    references = {name: fit_reference(problem, name) for name in REFERENCES}
    best = min(references, key=lambda name: references[name][1])
    size = sizes(references[best][0])
    usable = np.isfinite(size) & (size > 0.0)
    if not np.any(usable):
        raise InputError(
            "No named law can be integrated through these runs with the modes given. Check the "
            "units of modulus, relaxation_time and shear rate."
        )
    # a term that vanishes along all trajectories is left out by a scale of zero
    scale = np.where(usable, 1.0 / np.where(usable, size, 1.0), 0.0)
    noise = _noise(problem, references[best], scale, noise_floor)
    found: list[Optimum] = []
    for name, (constants, misfit) in references.items():
        say(f"the library about {name.replace('_', ' ')}")
        found += _path(problem, name, constants, misfit, scale, noise)
    closest = min(found, key=lambda o: o.misfit)
    noise = max(min(noise, closest.misfit), noise_floor)
    records = _independent(problem, closest.residual)
    fitting = _fitting(found, noise, records)
    weights = _weights(fitting, noise)
    rng = np.random.default_rng(seed)
    drawn = [_draws(problem, optimum, scale, noise, records, rng) for optimum in fitting]
    counts = np.array([len(laws) for laws, _ in drawn])
    owner = np.repeat(np.arange(len(fitting)), counts)
    return Mixture(
        tuple(fitting),
        weights,
        noise,
        records,
        scale,
        owner,
        np.concatenate([laws for laws, _ in drawn]) * scale,
        np.concatenate([moduli for _, moduli in drawn]),
        (weights / counts)[owner],
        _named_law_fits(problem, references, scale, noise, records),
    )


def _noise(problem, reference, scale, floor: float) -> float:
    """Return the relative noise, from one fit of all terms."""
    constants, misfit = reference
    at, records = with_reference(problem, constants), float(problem.records.n_observations)
    noise, start = max(misfit / 3.0, floor), np.zeros(len(scale))
    for _ in range(_NOISE_ROUNDS):
        start, residual, columns = mode(at, scale, _FIRST_WIDTH, noise, records, start)
        _, noise = most_evident(residual, start, columns, _FIRST_WIDTH, noise, records)
        noise = max(noise, floor)
    return noise


def _independent(problem, residual) -> float:
    """Return how many independent records a residual is worth."""
    worth = noise_model([residual[rows] for rows in problem.records.sequences()]).effective_samples
    return float(np.clip(worth, _FEWEST_RECORDS, problem.records.n_observations))


def _named_law_fits(problem, references, scale, noise: float, records: float) -> bool:
    """Return whether a reference law may be the fluid's, its moduli as a sweep leaves them."""
    allowed = _NAMED_NEARLY_FITS * noise
    if any(misfit <= allowed for _, misfit in references.values()):
        return True
    if not np.any(np.asarray(problem.modulus_error)):
        return False
    n, nothing = len(scale), np.zeros(len(scale))
    for name, (constants, _) in references.items():
        at = with_reference(problem, constants)
        shifts = modulus_columns(at, range(n), n, nothing, np.zeros(0))
        prior = noise / np.sqrt(records)
        if left_beside_modes(problem, name, constants, shifts, prior) <= allowed:
            return True
    return False


def _weights(fitting: list[Optimum], noise: float) -> Float[np.ndarray, " optima"]:
    named = min(o.reference_misfit for o in fitting) <= _NAMED_FITS * noise
    shared = SHARED if named else 1.0
    evidence = np.array([o.log_evidence for o in fitting])
    likely = np.exp(evidence - np.max(evidence))
    return (1.0 - shared) * likely / np.sum(likely) + shared / len(fitting)


def _path(problem, name, constants, misfit, scale, noise) -> list[Optimum]:
    """Return the modes about one reference from the narrowest width on, until evidence falls."""
    at, start = with_reference(problem, constants), np.zeros(len(scale))
    records, path = float(problem.records.n_observations), []
    for width in WIDTHS:
        start, residual, columns = mode(at, scale, width, noise, records, start)
        left = float(np.linalg.norm(residual))
        evidence = log_evidence(left, start, columns, width, noise, records)
        if path and evidence < path[-1].log_evidence:
            break
        path.append(
            Optimum(name, constants, misfit, width, start, columns, residual, left, evidence)
        )
    return path


def _fitting(found: list[Optimum], noise: float, records: float) -> list[Optimum]:
    """Return the optima that fit, with their evidence at one noise, the likeliest in any case."""
    told = [
        replace(
            o,
            log_evidence=log_evidence(o.misfit, o.coefficients, o.columns, o.width, noise, records),
        )
        for o in found
    ]
    likeliest = max(told, key=lambda o: o.log_evidence)
    # the law that is written out is a sum of library terms
    named = [o for o in told if REFERENCES[o.reference].terms is not None]
    written = max(named, key=lambda o: o.log_evidence)
    return [o for o in told if o.misfit <= FITS * noise or o is likeliest or o is written]


def _draws(
    problem, optimum: Optimum, scale, noise, records, rng
) -> tuple[Float[np.ndarray, "m n"], Float[np.ndarray, "m c"]]:
    """Return an optimum and draws about it that fit as it does: scaled coefficients, and moduli.

    The covariance is that of the linearisation, which long directions leave: each draw is moved
    until its prediction is what the linearisation said it would be. Moduli that a sweep leaves
    open count as coefficients with a prior of their own.
    """
    # a misfit beyond the noise counts as more noise
    size = max(noise, optimum.misfit)
    modulus, error = amounts_of(problem), np.asarray(problem.modulus_error)
    columns = optimum.columns
    if np.any(error):
        # of the unit that the coefficients' prior has
        shifts = _modulus_columns(problem, optimum, scale) / optimum.width
        columns = np.hstack([columns, shifts])
    n, errors = len(scale), columns.shape[1] - len(scale)
    error = error / optimum.width
    root, inverse = spread(columns, optimum.width, size, records)
    back = root @ (columns @ root).T * (records / size**2)
    centre = np.append(optimum.coefficients, np.zeros(errors))
    if errors:
        # where the moduli may move too, the mode is elsewhere: one step of Gauss and Newton
        prior = root @ (root.T @ np.append(optimum.coefficients, np.zeros(errors)))
        centre = centre - back @ optimum.residual - prior / optimum.width**2
    unit = rng.normal(size=(_PAIRS, n + errors))
    moved = centre + np.concatenate([unit, -unit]) @ root.T
    start = np.append(optimum.coefficients, np.zeros(errors))
    wanted = optimum.residual + (moved - start) @ columns.T
    laws = moved

    def moduli(laws):
        return modulus + laws[:, n:] @ error.T if errors else np.tile(modulus, (len(laws), 1))

    def residuals(laws):
        own = moduli(laws) if errors else None
        return _residuals(problem, optimum, laws[:, :n] * scale, own)

    # a law that runs away has no prediction to be corrected, and is not kept
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(_CORRECTIONS):
            off = residuals(laws) - wanted
            step = np.where(np.all(np.isfinite(off), axis=1)[:, None], off, 0.0) @ back.T
            length = np.linalg.norm(step @ inverse.T, axis=1)
            laws = laws - step * np.minimum(1.0, _FARTHEST / np.maximum(length, 1e-12))[:, None]
        misfit = np.linalg.norm(residuals(laws), axis=1)
        kept = misfit <= _STRAY * optimum.misfit
    found = np.vstack([start, laws[kept]])
    return found[:, :n], moduli(found)


def _modulus_columns(problem, optimum: Optimum, scale) -> Float[np.ndarray, "rows c"]:
    """Return the change of an optimum's weighted predictions with each error of the moduli."""
    at, places = with_reference(problem, optimum.constants), range(len(scale))
    inner = np.zeros(0)
    return modulus_columns(at, places, len(scale), optimum.coefficients * scale, inner)


def _residuals(problem, optimum: Optimum, coefficients, moduli) -> Float[np.ndarray, "m rows"]:
    target = problem.records.weighted_record
    at = with_reference(problem, optimum.constants)
    places, inner = jnp.arange(coefficients.shape[1]), jnp.zeros((len(coefficients), 0))
    own = None if moduli is None else jnp.asarray(moduli)
    return np.asarray(predict_many(at, places, jnp.asarray(coefficients), inner, own)) - target
