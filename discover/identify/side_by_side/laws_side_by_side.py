"""Many laws of one library in many flows at once: one compiled program, laws side by side."""

from collections.abc import Sequence

import jax
import numpy as np
from jaxtyping import Float

from discover.errors import InputError
from discover.forward.fluids import solve_on_grid
from discover.forward.grids.grid import IntegrationGrid
from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.expansion import LibraryExpansion
from discover.laws.multimode import Fluid
from discover.laws.textbook.maxwell import UpperConvectedMaxwell
from discover.programs import compiled, on_device
from discover.protocols.protocol import FlowProtocol
from tensor_library.law_terms import LawTerms
from tensor_library.library import TermLibrary
from tensor_library.terms import parse_term

LAWS_AT_ONCE = 8
"""Laws simulated side by side; fewer are padded, so that any number shares one program."""


def joint_library(library: TermLibrary, laws: Sequence[LawTerms]) -> TermLibrary:
    """Return a library that also holds the terms of some laws."""
    names = [name for law in laws for name in law.coefficients]
    try:
        terms = [parse_term(name) for name in names]
    except ValueError as error:
        raise InputError(str(error)) from error
    return library.extended(terms)


def _batches(library: TermLibrary, laws: Sequence[LawTerms]):
    for first in range(0, len(laws), LAWS_AT_ONCE):
        some = [law.over(library) for law in laws[first : first + LAWS_AT_ONCE]]
        count = len(some)
        some += some[-1:] * (LAWS_AT_ONCE - count)
        coefficients, inner = (on_device(np.stack(part)) for part in zip(*some, strict=True))
        yield count, coefficients, inner


def stresses_of_laws(
    library: TermLibrary,
    laws: Sequence[LawTerms],
    protocols: FlowProtocol,
    grids: IntegrationGrid,
    base: AbstractConstitutiveLaw | None = None,
) -> Float[np.ndarray, "laws runs n 4"]:
    """Return the dimensionless stresses of several laws in a batch of flows.

    `library`: holds every term of the laws. `protocols`, `grids`: from `stack_protocols` and
    `make_grids`. `base`: the known part; by default UCM. Returns σ11, σ22, σ33,
    σ12, not finite where a law runs away.
    """
    base = UpperConvectedMaxwell() if base is None else base
    parts = [
        np.asarray(_march(library, base, c, inner, protocols, grids))[:count]
        for count, c, inner in _batches(library, laws)
    ]
    return np.concatenate(parts)


def _law(library, base, coefficients, inner) -> LibraryExpansion:
    return LibraryExpansion(coefficients, inner, library, base.linear_relaxation, base)


@compiled
def _march(library, base, coefficients, inner, protocols, grids):
    def one(c, i, protocol, grid):
        law = _law(library, base, c, i)
        return solve_on_grid(Fluid.dimensionless(law), protocol, grid)

    over_runs = jax.vmap(one, in_axes=(None, None, 0, 0))
    return jax.vmap(over_runs, in_axes=(0, 0, None, None))(coefficients, inner, protocols, grids)
