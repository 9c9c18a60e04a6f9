"""Many laws of one library in many flows at once: one compiled program, laws side by side."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from discover.errors import InputError
from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.expansion import LibraryExpansion
from discover.laws.maxwell import UpperConvectedMaxwell
from discover.programs import compiled
from discover.protocols.shear import ShearProtocol
from discover.simulate.grid import IntegrationGrid
from tensor_library.kinematics import planar_extension, uniaxial_extension
from tensor_library.library import TermLibrary
from tensor_library.terms import parse_term

LAWS_AT_ONCE = 8
"""Laws simulated side by side; fewer are padded, so that any number shares one program."""


@dataclass(frozen=True)
class LawTerms:
    """A law by the canonical spelling of its terms, beyond a known part that laws share.

    Attributes
    ----------
    coefficients
        Term → coefficient.
    inner
        Inner parameters of closed forms by name.
    """

    coefficients: Mapping[str, float]
    inner: Mapping[str, float] = field(default_factory=dict)


def joint_library(library: TermLibrary, laws: Sequence[LawTerms]) -> TermLibrary:
    """Return a library that also holds the terms of some laws.

    Raises
    ------
    InputError
        If a term cannot be read.
    """
    names = [name for law in laws for name in law.coefficients]
    try:
        terms = [parse_term(name) for name in names]
    except ValueError as error:
        raise InputError(str(error)) from error
    return library.extended(terms)


def dense(library: TermLibrary, law: LawTerms) -> tuple[np.ndarray, np.ndarray]:
    """Return coefficients over a library, shape (n,), and its inner parameters, shape (m,)."""
    coefficients = np.zeros(len(library))
    for name, value in law.coefficients.items():
        coefficients[library.names.index(name)] = value
    inner = [
        law.inner.get(name, default)
        for name, default in zip(library.inner_names, library.inner_default, strict=True)
    ]
    return coefficients, np.asarray(inner, dtype=float)


def _batches(library: TermLibrary, laws: Sequence[LawTerms]):
    for first in range(0, len(laws), LAWS_AT_ONCE):
        some = [dense(library, law) for law in laws[first : first + LAWS_AT_ONCE]]
        count = len(some)
        some += some[-1:] * (LAWS_AT_ONCE - count)
        coefficients, inner = (jnp.asarray(np.stack(part)) for part in zip(*some, strict=True))
        yield count, coefficients, inner


def shear_stresses(
    library: TermLibrary,
    laws: Sequence[LawTerms],
    protocols: ShearProtocol,
    grids: IntegrationGrid,
    base: AbstractConstitutiveLaw | None = None,
) -> Float[np.ndarray, "laws runs n 4"]:
    """Return the dimensionless stresses of several laws in a batch of shear flows.

    Parameters
    ----------
    library
        Holds every term of the laws.
    laws
        The laws.
    protocols, grids
        From `stack_protocols` and `make_grids`.
    base
        The known part; by default UCM.

    Returns
    -------
    σ11, σ22, σ33, σ12; not finite where a law runs away.
    """
    base = UpperConvectedMaxwell() if base is None else base
    parts = [
        np.asarray(_shear(library, base, c, inner, protocols, grids))[:count]
        for count, c, inner in _batches(library, laws)
    ]
    return np.concatenate(parts)


def _law(library, base, coefficients, inner) -> LibraryExpansion:
    return LibraryExpansion(coefficients, inner, library, base.linear_relaxation, base)


@compiled
def _shear(library, base, coefficients, inner, protocols, grids):
    # Classical Runge–Kutta steps: to compare laws of one relaxation time needs no more, and a plain
    # scan compiles in a fraction of the time of a solver made for spectra.
    def one(c, i, protocol, grid):
        law = _law(library, base, c, i)

        def advance(stress, interval):
            t, step = interval
            after = runge_kutta_step(
                lambda time, s: law.stress_rate(s, protocol.shear_rate(time)), t, step, stress
            )
            return after, after

        start = jnp.zeros(4)
        _, after = jax.lax.scan(advance, start, (grid.times[:-1], jnp.diff(grid.times)))
        return jnp.concatenate([start[None], after])[grid.sample_index]

    over_runs = jax.vmap(one, in_axes=(None, None, 0, 0))
    return jax.vmap(over_runs, in_axes=(0, 0, None, None))(coefficients, inner, protocols, grids)


def runge_kutta_step(slope, t, step, state):
    """Return the state after one classical fourth-order step of dy/dt = slope(t, y)."""
    k1 = slope(t, state)
    k2 = slope(t + 0.5 * step, state + 0.5 * step * k1)
    k3 = slope(t + 0.5 * step, state + 0.5 * step * k2)
    k4 = slope(t + step, state + step * k3)
    return state + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


def extensional_stresses(
    library: TermLibrary,
    laws: Sequence[LawTerms],
    rates: Float[np.ndarray, " r"],
    times: Float[np.ndarray, " n"],
    base: AbstractConstitutiveLaw | None = None,
) -> Float[np.ndarray, "laws kinds r n 3"]:
    """Return σ11, σ22, σ33 of several laws after the start of uniaxial and planar extension.

    Classical Runge–Kutta steps from each time to the next; `times` are equally spaced and start
    at 0.

    Parameters
    ----------
    library, laws, base
        As in `shear_stresses`.
    rates
        Extension rates, dimensionless.
    times
        Dimensionless.
    """
    base = UpperConvectedMaxwell() if base is None else base
    step = jnp.asarray(float(times[1] - times[0]))
    parts = [
        np.asarray(_extend(library, base, c, inner, jnp.asarray(rates), step, len(times)))[:count]
        for count, c, inner in _batches(library, laws)
    ]
    return np.concatenate(parts)


@compiled
def _extend(library, base, coefficients, inner, rates, step, n_times):
    def one(c, i, gradient: Float[Array, "3 3"]):
        law = _law(library, base, c, i)

        def advance(stress, _):
            after = runge_kutta_step(lambda _, s: law.stress_rate(s, gradient), 0.0, step, stress)
            return after, jnp.diagonal(stress)

        return jax.lax.scan(advance, jnp.zeros((3, 3)), None, length=n_times)[1]

    gradients = jnp.stack([jax.vmap(f)(rates) for f in (uniaxial_extension, planar_extension)])
    over_rates = jax.vmap(one, in_axes=(None, None, 0))
    over_kinds = jax.vmap(over_rates, in_axes=(None, None, 0))
    return jax.vmap(over_kinds, in_axes=(0, 0, None))(coefficients, inner, gradients)
