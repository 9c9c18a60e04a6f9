"""Many laws in one compiled simulation: rivals, or draws of one law's parameters."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array, Float
from scipy.stats import norm
from scipy.stats.qmc import LatinHypercube

from discover.forward.enough_steps import in_enough_steps
from discover.forward.fluids import observed_on_grid
from discover.forward.grids.flow_batch import FlowBatch, lay_out
from discover.laws.expansion import LibraryExpansion
from discover.laws.multimode import Fluid, moduli_and_solvent
from discover.learners.trajectories.modulus_errors import ModulusErrors
from discover.programs import compiled, on_device
from discover.protocols.kinematics import FOLLOWED
from discover.protocols.protocol import FlowProtocol
from discover.statistics import root_of
from tensor_library.law_terms import LawTerms
from tensor_library.library import TermLibrary
from tensor_library.terms import parse_term


@dataclass(frozen=True)
class Contender:
    """A law that may be the right one, and how well its parameters are known.

    Attributes
    ----------
    name
        For tables and pictures.
    law
        Its terms, beyond a known part that laws share.
    covariance
        Of the `values` of the law, shape (p, p); None where the parameters count as exact.
    drawn
        Equally likely parameters in the same order, shape (draws, p), where the covariance does
        not serve; None where it does.
    modulus_errors
        Errors of the moduli that the covariance allows for; None where they are exact.
    modulus
        Of this law in Pa, shape (k,), and behind them the solvent viscosity in Pa s where it is
        not that declared; None for those declared.
    without_band
        Why nothing is known of the parameters' uncertainty; empty where something is.
    """

    name: str
    law: LawTerms
    covariance: Float[np.ndarray, "p p"] | None = None
    drawn: Float[np.ndarray, "draws p"] | None = None
    without_band: str = ""
    modulus_errors: ModulusErrors | None = None
    modulus: Float[np.ndarray, " c"] | None = None


def fluid_of(contenders: Sequence[Contender], declared: Fluid) -> Fluid:
    """Return one fluid whose arrays have a leading axis of laws.

    Every law is written in one library that holds the terms of all, so that one program serves
    them. Take them apart with `jax.vmap`.

    Parameters
    ----------
    declared
        The known part: its law is the base, its modes are shared where a law has no own.
    """
    names = sorted({name for c in contenders for name in c.law.coefficients}) or ["sigma"]
    library = TermLibrary(tuple(parse_term(name) for name in names))
    rows = [c.law.over(library) for c in contenders]
    coefficients, inner = (np.stack(part) for part in zip(*rows, strict=True))

    amounts = np.append(np.asarray(declared.modulus), float(declared.solvent_viscosity))
    own = [np.zeros(0) if c.modulus is None else c.modulus for c in contenders]
    moduli = [np.append(given, amounts[len(given) :]) for given in own]

    def make(coefficients, inner, modulus):
        law = LibraryExpansion(
            coefficients=coefficients,
            inner=inner,
            library=library,
            linear_relaxation=declared.law.linear_relaxation,
            base=declared.law,
        )
        modes = moduli_and_solvent(modulus, declared.n_modes, 0.0)
        return Fluid(law, modes[0], declared.relaxation_time, modes[1])

    stacked = (on_device(part) for part in (coefficients, inner, np.stack(moduli)))
    return eqx.filter_vmap(make)(*stacked)


def draws(
    contender: Contender,
    n_draws: int,
    rng: np.random.Generator,
    modulus: Float[np.ndarray, " c"] | None = None,
) -> tuple[Contender, ...]:
    """Return laws with parameters drawn from the contender's uncertainty; itself comes first.

    Moduli about `modulus` in Pa, and the solvent behind them, are drawn with them where they are
    uncertain too.

    From a covariance by Latin hypercubes   [McKay, Beckman & Conover 1979, Technometrics 21, 239].
    """
    if n_draws == 0 or not _is_uncertain(contender):
        return (contender,)
    if contender.drawn is None:
        assert contender.covariance is not None  # one of the two is there
        root = root_of(contender.covariance)
        # evenly along every axis, or the ends of a band of few draws would be a matter of luck
        even = norm.ppf(LatinHypercube(len(root), scramble=False, rng=rng).random(n_draws))
        drawn = contender.law.values + even @ root.T
    else:
        drawn = rng.permutation(contender.drawn)[:n_draws]
    errors, moduli = contender.modulus_errors, None
    if errors is not None and modulus is not None and contender.covariance is not None:
        moved = drawn - contender.law.values
        moduli = modulus[: len(errors.root)] + errors.draw(moved, contender.covariance, rng)
    return (contender, *_with_parameters(contender, drawn, moduli))


def sigma_points(
    contender: Contender, most: int, rng: np.random.Generator
) -> tuple[Contender, ...]:
    """Return laws whose predictions have the contender's covariance; itself comes first.

    To second order, and with two laws for each parameter, by the unscented transform   [Julier &
    Uhlmann 2004, Proc. IEEE 92, 401]. Where the covariance does not serve, or has too many
    parameters, `draws`.

    Parameters
    ----------
    most
        So many besides itself.
    rng
        Of draws.
    """
    if not _is_uncertain(contender) or contender.drawn is not None or contender.covariance is None:
        return draws(contender, most, rng)
    root = root_of(contender.covariance)
    seen = root.T[np.any(root, axis=0)]
    if 2 * len(seen) > most:
        return draws(contender, most, rng)
    far = np.sqrt(len(seen)) * seen
    return (contender, *_with_parameters(contender, contender.law.values + np.array([*far, *-far])))


def _is_uncertain(contender: Contender) -> bool:
    if contender.without_band:
        return False
    return contender.drawn is not None or contender.covariance is not None


def _with_parameters(
    contender: Contender,
    values: Float[np.ndarray, "draws p"],
    moduli: Float[np.ndarray, "draws c"] | None = None,
) -> list[Contender]:
    """Return the law with other parameters and, where they are given, other moduli."""
    own = [None] * len(values) if moduli is None else moduli
    return [
        Contender(contender.name, contender.law.at(row), modulus=modulus)
        for row, modulus in zip(values, own, strict=True)
    ]


def predict_laws(
    fluids: Fluid,
    protocols: Sequence[FlowProtocol],
    times: Sequence[Float[np.ndarray, " _"]],
    **limits: Any,
) -> Float[np.ndarray, "laws flows n 3"]:
    """Return the recorded stress, N1 and N2 in Pa of every law in every flow.

    Not finite where a law runs away. Flows with fewer samples than others repeat their last one.

    Parameters
    ----------
    fluids
        A fluid with a leading axis of laws on every array.
    **limits
        Limits of steps, as `make_grids` takes them.
    """
    flows = lay_out(protocols, times, relaxation_time=fluids.settling_time, **limits)
    first = jax.tree.map(
        lambda leaf: on_device(np.asarray(leaf)[0, ...]), eqx.filter(fluids, eqx.is_array)
    )
    fluid = eqx.combine(first, eqx.filter(fluids, eqx.is_array, inverse=True))
    flows = in_enough_steps(fluid, flows)
    return np.asarray(_predict(fluids, flows))


@compiled
def _predict(fluids: Fluid, flows: FlowBatch) -> Float[Array, "laws flows n 3"]:
    arrays, rest = eqx.partition(fluids, eqx.is_array)

    def of_law(own):
        return flows.over(partial(observed_on_grid, eqx.combine(own, rest)))

    if all(protocols.control in FOLLOWED for protocols, _ in flows.parts):
        return jax.vmap(of_law)(arrays)
    # where a rate is solved for, side by side all laws would take as many steps as the slowest
    return jax.lax.map(of_law, arrays)
