"""Physical soundness of a law: checks that need no data, with where it fails."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from discover.identify import physics_flows
from discover.laws import Fluid
from discover.laws.each_mode import differs_by_mode, law_of_mode
from discover.laws.expansion import in_shared_form
from discover.protocols.protocol import FlowProtocol
from discover.words import percent_of, plainly

_ROUNDING = 1e-6
"""Size below zero that integration error alone may give."""

_LINEAR_TOLERANCE = 1e-3
"""Relative difference of moduli from Maxwell's that counts as the same."""

SMALL_STRAIN = "small-strain limit"
"""Name of the check that a law keeps the declared modes."""

SHEAR_RATES = np.geomspace(1e-2, 1e2, 241)
"""Weissenberg numbers of the flow curve."""

EXTENSION_RATES = np.geomspace(0.02, 20.0, 241)
"""Extension rates times relaxation time."""

_REFINED = 61
_BOX_FACTORS = (1.0, 1.5, 2.0, 3.0, 5.0)
_DEBORAH_FACTORS = (0.5, 1.0, 2.0)
_PER_RATE = len(_DEBORAH_FACTORS)


@dataclass(frozen=True)
class PhysicsCheck:
    """One check of a law."""

    name: str
    passed: bool | None  # whether the law passes; None where the check could not be made
    value: float | None  # the number that decides
    where: str  # where it is taken, or where the law fails, in words
    text: str  # one sentence for a reader


@dataclass(frozen=True)
class PhysicsReport:
    """All checks of a law."""

    checks: tuple[PhysicsCheck, ...]  # in a fixed order

    def __getitem__(self, name: str) -> PhysicsCheck:
        return next(check for check in self.checks if check.name == name)

    @property
    def text(self) -> str:
        """One sentence for a reader."""
        failed = [check.name for check in self.checks if check.passed is False]
        if not failed:
            return "The law passes every check of physical soundness that could be made."
        return "The law fails: " + ", ".join(failed) + "."

    def to_json(self) -> dict[str, Any]:
        """Return the report as ``comparison.json`` holds it."""
        return {"text": self.text, "checks": [asdict(check) for check in self.checks]}


@dataclass(frozen=True)
class Seen:
    """A fluid along flows, and in oscillations up to beyond the box of training.

    `weissenberg`, `deborah`: largest rate and frequency of training, times the mean relaxation
    time: the box beyond which the law extrapolates.
    """

    fluid: Fluid
    weissenberg: float
    deborah: float
    along: physics_flows.Trajectories  # the flows asked for
    beyond: physics_flows.Cycles
    in_cycles: physics_flows.Trajectories  # these
    work: Float[np.ndarray, " cycles"]  # of each of these cycles


def see(
    fluid: Fluid, protocols: Sequence[FlowProtocol], times: Sequence[Float[np.ndarray, " _"]],
    weissenberg: float, deborah: float,
) -> Seen:  # fmt: skip
    """Return what a fluid does along flows, and what its checks need beside.

    `times`: of samples in s. `weissenberg`, `deborah`: as of `Seen`.
    """
    beyond = physics_flows.cycles(
        physics_flows.time_scale(fluid),
        [weissenberg * factor for factor in _BOX_FACTORS],
        [deborah * factor for factor in _DEBORAH_FACTORS],
    )
    found = physics_flows.trajectories(
        fluid, [*protocols, *beyond.protocols], [*times, *beyond.times]
    )
    count = len(protocols)
    along = found.some(range(count))
    in_cycles = found.some(range(count, len(found.observed)))
    work = beyond.work([observed[:, 0] for observed in in_cycles.observed])
    return Seen(fluid, weissenberg, deborah, along, beyond, in_cycles, work)


def check_physics(seen: Seen, names: Mapping[int, str]) -> PhysicsReport:
    """Return the checks of a fluid. `names`: of the flows along which stresses are looked at."""
    fluid = replace(seen.fluid, law=in_shared_form(seen.fluid.law))
    along, titles = seen.along.some(list(names)), list(names.values())
    if not np.any(np.isfinite(along.smallest_conformation)):
        # creep and sweeps tell of no mode: cycles at the rate of training do
        titles = list(seen.beyond.names[:_PER_RATE])
        along = seen.in_cycles.some(range(_PER_RATE))
    times = np.asarray(fluid.relaxation_time)
    rates = SHEAR_RATES / physics_flows.time_scale(fluid)
    shear = [
        physics_flows.steady_branch(law_of_mode(fluid.law, number), physics_flows.SHEAR, own)
        for number, own in enumerate(np.outer(times, rates))
    ]
    found = {
        "conformation tensor positive definite": _conformation(along, titles),
        "dissipation non-negative": _free_energy(along, titles),
        "work over a cycle non-negative": _work(seen),
        "flow curve monotonic": _flow_curve(fluid, shear, rates, seen.weissenberg),
        "steady extension bounded": _extension(fluid),
        SMALL_STRAIN: _small_strain(shear),
        "integrates beyond training": _reach(seen),
    }
    return PhysicsReport(tuple(PhysicsCheck(name, *one) for name, one in found.items()))


_Found = tuple[bool | None, float | None, str, str]
"""The fields of a `PhysicsCheck` behind its name."""


def _conformation(along: physics_flows.Trajectories, names: Sequence[str]) -> _Found:
    run, value = along.lowest(along.smallest_conformation)
    if run is None:
        return None, None, "", "The law diverges in every flow looked at."
    passed, where = value > -_ROUNDING, names[run]
    verb = "stays positive definite" if passed else "loses positive definiteness"
    text = f"The conformation tensor I + σ/G {verb}: its smallest eigenvalue is {plainly(value)}"
    return passed, value, where, f"{text}, in {where}."


def _free_energy(along: physics_flows.Trajectories, names: Sequence[str]) -> _Found:
    run, value = along.lowest(along.dissipation)
    if run is None:
        return None, None, "", "No flow in which the stored energy is defined throughout."
    passed, where = value > -_ROUNDING, names[run]
    verb = "is nowhere negative" if passed else "becomes negative"
    text = (
        "With the stored energy of Hookean dumbbells, (G/2)(tr A − ln det A − 3) with A = I + "
        f"σ/G, the dissipation {verb}: at least {plainly(value)} G/λ, in {where}."
    )
    return passed, value, where, text


def _work(seen: Seen) -> _Found:
    # at the Weissenberg number of training, which is the first
    usable = [(i, w) for i, w in enumerate(seen.work[:_PER_RATE]) if np.isfinite(w)]
    if not usable:
        return None, None, "", "The law diverges in the oscillations tried."
    run, value = min(usable, key=lambda pair: pair[1])
    where = seen.beyond.names[run]
    text = (
        f"The work σ:d over the last cycle is at least {plainly(value)} of the product of the "
        f"largest stress and strain rate, in {where}."
    )
    return bool(value >= -_ROUNDING), float(value), where, text


def _flow_curve(
    fluid: Fluid,
    shear: Sequence[physics_flows.Branch],
    rates: Float[np.ndarray, " n"],
    weissenberg: float,
) -> _Found:
    slowest = physics_flows.time_scale(fluid)
    modes = zip(np.asarray(fluid.modulus), shear, strict=True)
    stress = sum(modulus * branch.stress[:, 3] for modulus, branch in modes)
    stress = stress + np.asarray(fluid.solvent_viscosity) * rates
    steady = np.all([branch.is_steady for branch in shear], axis=0)
    last = rates.size if steady.all() else int(np.argmin(steady))
    falling = np.flatnonzero(np.diff(stress[:last]) <= 0.0)
    if falling.size:
        low, high = float(rates[falling[0]]), float(rates[falling[-1] + 1])
        beyond = low * slowest > weissenberg
        where = f"shear rates from {plainly(low)} to {plainly(high)} 1/s"
        note = "beyond the rates of training" if beyond else "within the rates of training"
        text = (
            f"The steady shear stress falls with the rate at {where}: homogeneous flow is unstable "
            f"there and would band (it starts {note})."
        )
        return False, low, where, text
    if last < 2:
        return None, None, "", "No steady shear flow was found."
    where = f"shear rates from {plainly(rates[0])} to {plainly(rates[last - 1])} 1/s"
    text = f"The steady shear stress rises with the rate throughout {where}."
    if last < rates.size:
        text += " Beyond, no steady state follows on."
    return True if last == rates.size else None, float(rates[last - 1]), where, text


def _extension(fluid: Fluid) -> _Found:
    longest = float(np.max(np.asarray(fluid.relaxation_time)))
    reached = _last_stable(fluid, EXTENSION_RATES)
    if reached == EXTENSION_RATES.size:
        where = f"extension rates up to {plainly(EXTENSION_RATES[-1] / longest)} 1/s"
        text = f"The stress in uniaxial extension settles at all {where}."
        return True, float(EXTENSION_RATES[-1] / longest), where, text
    low = EXTENSION_RATES[max(reached - 1, 0)]
    high = EXTENSION_RATES[reached]
    # from rest again, but finely across the last step
    fine = np.concatenate(
        [EXTENSION_RATES[: max(reached - 1, 0)], np.linspace(low, high, _REFINED)]
    )
    limit = float(fine[max(_last_stable(fluid, fine) - 1, 0)] / longest)
    text = (
        f"In uniaxial extension at rates beyond {limit:.4g} 1/s ({limit * longest:.3g} over the "
        "longest relaxation time) no steady state is stable: the stress grows without bound."
    )
    return False, limit, f"extension rates beyond {limit:.4g} 1/s", text


def _last_stable(fluid: Fluid, rates: np.ndarray) -> int:
    times = np.asarray(fluid.relaxation_time)
    slowest = int(np.argmax(times))
    # of one law for all modes the slowest gives way first
    numbers = range(len(times)) if differs_by_mode(fluid.law) else [slowest]
    good = np.ones(rates.size, dtype=bool)
    for number in numbers:
        scaled = rates * (times[number] / times[slowest])
        law = law_of_mode(fluid.law, number)
        branch = physics_flows.steady_branch(law, physics_flows.UNIAXIAL, scaled)
        good &= branch.is_steady & branch.is_stable
    return rates.size if good.all() else int(np.argmin(good))


def _off_at_rest(branch: physics_flows.Branch) -> tuple[float, float]:
    """Return dσ/dt at rest, and by how much G′ + iG″ is off that of a Maxwell mode."""
    frequency, one = np.geomspace(0.01, 100.0, 41), np.eye(len(branch.source))
    source = branch.source.astype(complex)
    response = np.array(
        [1j * w * np.linalg.solve(1j * w * one - branch.relaxation, source)[3] for w in frequency]
    )
    maxwell = 1j * frequency / (1.0 + 1j * frequency)
    off = float(np.max(np.abs(response - maxwell) / np.abs(maxwell)))
    return float(np.max(np.abs(branch.drift))), off


def _small_strain(shear: Sequence[physics_flows.Branch]) -> _Found:
    offset, value = (max(column) for column in zip(*map(_off_at_rest, shear), strict=True))
    text = (
        f"G′ and G″ at vanishing strain differ from those of the Maxwell modes by at most "
        f"{percent_of(max(value, 1e-5))} (the law linearised at rest, frequencies times "
        "relaxation time from 0.01 to 100)"
    )
    if offset > _LINEAR_TOLERANCE:
        text += f", and the law does not rest: dσ/dt = {offset:.2g} G/λ without flow or stress"
    worst = max(value, offset)
    return worst <= _LINEAR_TOLERANCE, worst, "at rest", text + "."


def _reach(seen: Seen) -> _Found:
    weissenberg, deborah = seen.weissenberg, seen.deborah
    finite = np.isfinite(seen.work).reshape(len(_BOX_FACTORS), _PER_RATE)
    whole = np.all(finite, axis=1)
    reached = len(_BOX_FACTORS) if whole.all() else int(np.argmin(whole))
    least, most = (plainly(factor * deborah) for factor in _DEBORAH_FACTORS[:: _PER_RATE - 1])
    box = f"De from {least} to {most}"
    if reached == len(_BOX_FACTORS):
        limit = weissenberg * _BOX_FACTORS[-1]
        where = f"Wi up to {plainly(limit)}, {box}"
        text = f"Oscillations stay finite in the whole grid tried, {where}."
        return True, limit, where, text
    failed = [seen.beyond.names[_PER_RATE * i + j] for i, j in np.argwhere(~finite)]
    limit = weissenberg * _BOX_FACTORS[reached - 1] if reached else 0.0
    text = (
        f"Oscillations stay finite up to Wi = {plainly(limit)} for {box}; the stress diverges "
        f"first in {failed[0]} (training reached Wi = {plainly(weissenberg)}, "
        f"De = {plainly(deborah)})."
    )
    return False, limit, failed[0], text
