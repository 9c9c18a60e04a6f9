"""Physical soundness of a law: checks that need no data, with where it fails."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from discover.forward.of_fluids import observed_in
from discover.identify import physics_flows
from discover.laws import Fluid
from discover.laws.expansion import in_shared_form
from discover.protocols import in_flow, steady_rates
from discover.protocols.kinematics import FlowKind
from discover.protocols.protocol import FlowProtocol
from discover.simulate.synthetic import at_rest, modulus_at_rest
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
    """A fluid along flows, and in oscillations up to beyond the box of training."""

    fluid: Fluid
    weissenberg: float  # largest rate of training times the mean relaxation time
    deborah: float  # largest frequency, likewise: the law extrapolates beyond the two
    along: physics_flows.Trajectories  # the flows asked for
    beyond: physics_flows.Cycles
    in_cycles: physics_flows.Trajectories  # these
    work: Float[np.ndarray, " cycles"]  # of each of these cycles


def see(
    fluid: Fluid, protocols: Sequence[FlowProtocol], times: Sequence[Float[np.ndarray, " _"]],
    weissenberg: float, deborah: float,
) -> Seen:  # fmt: skip
    """Return what a fluid does along flows at `times` in s, and what its checks need beside."""
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
    found = {
        "conformation tensor positive definite": _conformation(along, titles),
        "dissipation non-negative": _free_energy(along, titles),
        "work over a cycle non-negative": _work(seen),
        "flow curve monotonic": _flow_curve(fluid, seen.weissenberg),
        "steady extension bounded": _extension(fluid),
        SMALL_STRAIN: _small_strain(fluid),
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


def _steady(fluid: Fluid, kind: FlowKind, rates: Float[np.ndarray, " n"]) -> tuple[np.ndarray, int]:
    """Return the stress of steady flow in Pa, and up to which rate in 1/s there is such a state."""
    flow = in_flow(steady_rates(rates), kind)
    stress = observed_in(fluid, flow, np.arange(1.0, rates.size + 1.0))[:, 0]
    steady = np.isfinite(stress)
    return stress, rates.size if steady.all() else int(np.argmin(steady))


def _flow_curve(fluid: Fluid, weissenberg: float) -> _Found:
    slowest = physics_flows.time_scale(fluid)
    rates = SHEAR_RATES / slowest
    stress, last = _steady(fluid, "shear", rates)
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
    rates = EXTENSION_RATES / longest
    _, reached = _steady(fluid, "uniaxial", rates)
    if reached == rates.size:
        where = f"extension rates up to {plainly(rates[-1])} 1/s"
        text = f"The stress in uniaxial extension settles at all {where}."
        return True, float(rates[-1]), where, text
    fine = np.linspace(rates[max(reached - 1, 0)], rates[reached], _REFINED)
    limit = float(fine[max(_steady(fluid, "uniaxial", fine)[1] - 1, 0)])
    text = (
        f"In uniaxial extension at rates beyond {limit:.4g} 1/s ({limit * longest:.3g} over the "
        "longest relaxation time) no steady state is stable: the stress grows without bound."
    )
    return False, limit, f"extension rates beyond {limit:.4g} 1/s", text


def _small_strain(fluid: Fluid) -> _Found:
    drift, decays, drives = at_rest(fluid.law, fluid.n_modes)
    frequency = np.geomspace(0.01, 100.0, 41)
    maxwell = 1j * frequency / (1.0 + 1j * frequency)
    modes = zip(decays, drives, strict=True)
    moduli = np.array([modulus_at_rest(decay, drive, frequency) for decay, drive in modes])
    value = float(np.max(np.abs(moduli - maxwell) / np.abs(maxwell)))
    offset = float(np.max(np.abs(drift)))
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
