"""Sets of fewer effects that explain the runs as well on a bench that is a little off.

A gap or the angle of a cone, a calibration and the temperature of the bath are the same in every
run of a session, and each is known to a per cent or two. What all of them together leave of the
records looks like an effect: rates told 2 % too high and times 2 % too short are like a tool that
yields. So each effect of an explanation is held against all of them at once, each normal with that
width.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from discover.closed_loop.explanations.beam import Carried
from discover.closed_loop.search import Search
from discover.inference.evidence import INDISTINGUISHABLE, WINDOW
from discover.inference.least_squares import Fit, Prior
from discover.statistics.reading.small_faults import WIDTHS
from discover.words import percent_of

BENCH = "small_bench_faults"
"""Among the aliases of an effect, that small faults of all runs do instead."""

_WIDTH = max(WIDTHS)
_MOST = 4  # explanations of which it is asked
_TIMES = "relaxation times"
_TIMES_AT = 1  # of the logarithm of their factor, in the parameter vector
_TOOL = "tool_compliance"
_FAULTS = {
    "rate_gain": "rates",
    "stress_gain": "stresses",
    _TOOL: "strain of the tool",
}
"""Effects that a bench may have a little of, and what is more than told by them."""

FACTORS = tuple(name for name in _FAULTS if name != _TOOL)
"""Of these, those that a bench may have where they are no candidates."""


@dataclass(frozen=True)
class OtherBench:
    """A set of effects that explains the records beside small faults of the bench.

    Attributes
    ----------
    carried
        The set, with a fit that holds the faults.
    instead
        The effect in whose place they are.
    """

    carried: Carried
    instead: str

    @property
    def sentence(self) -> str:
        """What the faults do, and what to do about it."""
        sizes = [
            f"{what} {100 * abs(size):.2g} % {'more' if size > 0 else 'less'} than told"
            if what != _FAULTS[_TOOL]
            else f"a tool that yields by {100 * size:.2g} % of the strain of the fluid"
            for what, size in self.carried.bench.items()
            if abs(size) >= 1e-3
        ]
        error = percent_of(float(np.mean(self.carried.fit.run_errors)))
        return (
            f"With {' and '.join(sizes) or 'nothing off'}, the fitted runs are missed by {error} "
            f"without {self.instead}: check gap, calibration and temperature."
        )


def other_benches(search: Search, carried: Sequence[Carried]) -> list[OtherBench]:
    """Return sets less one effect that explain the runs as well on a bench a little off.

    Both the set and the set less the effect are fitted with all faults, so that what these cost by
    themselves   [MacKay 1992, Neural Comput. 4, 415] is the same in both but for what the runs
    tell of them. No bench is exact, so that faults are no choice among candidates and have no price
    as an effect has.

    Parameters
    ----------
    search
        That has ended.
    carried
        What explains the records, the likeliest first.
    """
    if not carried or not search.tolerated.explained(search.fit, search.active):
        return []
    best = min(one.criterion for one in carried)
    known = {frozenset(one.effects) for one in carried}
    found: dict[frozenset[str], OtherBench] = {}
    for one in carried[:_MOST]:
        # an effect is no small fault in its own place
        whole = _on_bench(search, one.fit.theta, one.fit.free, one.effects, one.effects)
        for name in one.effects:
            left = tuple(other for other in one.effects if other != name)
            if whole is None or frozenset(left) in known:
                continue
            less = _on_bench(search, *search.problem.without(one.fit, name), left, one.effects)
            if less is None or not search.tolerated.explained(less.fit, left):
                continue
            worth = one.criterion + less.cost - whole.cost
            if worth > best + 2.0 * np.log(WINDOW):
                continue
            found_so = Carried(left, less.fit, worth, less.faults, less.left_open)
            own = OtherBench(found_so, name)
            key = frozenset(left)
            if key not in found or worth < found[key].carried.criterion:
                found[key] = own
    return sorted(found.values(), key=lambda one: one.carried.criterion)


def instead_of(
    benches: Sequence[OtherBench], carried: Sequence[Carried], active: Sequence[str]
) -> dict[str, OtherBench]:
    """Return the effects found of which faults of the bench do as well, or better."""
    own = next((one.criterion for one in carried if set(one.effects) == set(active)), np.inf)
    found = {}
    for one in benches:
        gone = set(active) - set(one.carried.effects)
        part = set(one.carried.effects) < set(active)
        if part and len(gone) == 1 and one.carried.criterion < own + INDISTINGUISHABLE:
            name = gone.pop()
            found[name] = replace(one, instead=name)
    return found


@dataclass(frozen=True)
class _OnBench:
    """A fit that holds faults, its criterion but for a constant, the faults, what they leave open.

    The last as of `Carried`.
    """

    fit: Fit
    cost: float
    faults: Mapping[str, float]
    left_open: Mapping[int, float]


def _on_bench(
    search: Search,
    theta: np.ndarray,
    free: Sequence[int],
    effects: Sequence[str],
    apart: Collection[str],
) -> _OnBench | None:
    """Return a set of effects fitted beside faults of the bench; None where it cannot be.

    Faults that are effects of `apart` are none.
    """
    problem, model = search.problem, search.model
    modulus = float(np.sum(np.asarray(model.declared.modulus, dtype=float)))
    places = {} if _TIMES_AT in free else {_TIMES_AT: (_TIMES, 1.0)}
    # in the order of the model: that of a set is another in every process
    for name in (
        one.name for one in model.effects if one.name in _FAULTS and one.name not in apart
    ):
        at = model.positions(name)[0]
        if at not in free:
            places[at] = _FAULTS[name], modulus if name == _TOOL else 1.0
    samples = problem.independent_samples(search.fit)
    noise = problem.cost(search.fit) / samples  # of a residual, as the fit weighs them
    if not places or noise <= 0.0:
        return None
    units = np.array([unit for _, unit in places.values()])
    known = problem.prior
    prior = Prior(
        (*known.positions, *places),
        (*known.mean, *(0.0 for _ in places)),
        (*known.weight, *map(float, np.sqrt(noise) / _WIDTH * units)),
    )
    fit = replace(problem, prior=prior).fit(theta, (*free, *places))
    if not fit.usable:
        return None
    sizes = fit.theta[[*places]] * units
    cost = problem.criterion(problem.cost(fit), free, effects, samples)
    cost += float(np.sum((sizes / _WIDTH) ** 2)) + _occam(fit, len(free), noise, units)
    names = [what for what, _ in places.values()]
    faults = dict(zip(names, map(float, sizes), strict=True))
    return _OnBench(fit, cost, faults, _left_open(fit, free, noise, units))


def _left_open(
    fit: Fit, free: Sequence[int], noise: float, units: Float[np.ndarray, " k"]
) -> dict[int, float]:
    """Return the standard deviation of constants that faults leave open, by their position."""
    columns = fit.jacobian.reshape(len(fit.free), -1)
    own, faults = columns[: len(free)], columns[len(free) :] / units[:, None]
    size = np.maximum(np.linalg.norm(own, axis=1), 1e-300)
    moves = np.linalg.lstsq((own / size[:, None]).T, faults.T, rcond=1e-9)[0] / size[:, None]
    beside = faults - moves.T @ own  # what the constants do not do as well
    spread = np.linalg.inv(np.eye(len(faults)) / _WIDTH**2 + beside @ beside.T / noise)
    variance = np.einsum("ik,kl,il->i", moves, spread, moves)
    return dict(zip(free, map(float, np.sqrt(np.maximum(variance, 0.0))), strict=True))


def _occam(fit: Fit, constants: int, noise: float, units: Float[np.ndarray, " k"]) -> float:
    """Return twice the log of how much more is known of the faults after the data than before."""
    columns = fit.jacobian.reshape(len(fit.free), -1)
    own, faults = columns[:constants], columns[constants:] / units[:, None]
    norm = np.linalg.norm(own, axis=1)
    if np.any(norm > 0.0):
        basis = np.linalg.qr((own[norm > 0.0] / norm[norm > 0.0, None]).T)[0]
        faults = faults - (faults @ basis) @ basis.T
    told = np.eye(len(faults)) + _WIDTH**2 / noise * faults @ faults.T
    return float(np.linalg.slogdet(told)[1])
