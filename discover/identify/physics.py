"""Physical soundness of a law: checks that need no data, with where it fails."""

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from discover.equations.equation import mean_relaxation_time
from discover.forward.of_fluids import observed_in
from discover.laws import Fluid
from discover.laws.expansion import in_shared_form
from discover.protocols import in_flow, steady_rates
from discover.protocols.kinematics import FlowKind
from discover.simulate.synthetic import at_rest, modulus_at_rest
from discover.words import percent_of, plainly

_LINEAR_TOLERANCE = 1e-3
"""Relative difference of moduli from Maxwell's that counts as the same."""

SMALL_STRAIN = "small-strain limit"
"""Name of the check that a law keeps the declared modes."""

SHEAR_RATES = np.geomspace(1e-2, 1e2, 241)
"""Weissenberg numbers of the flow curve."""

EXTENSION_RATES = np.geomspace(0.02, 20.0, 241)
"""Extension rates times relaxation time."""

_REFINED = 61


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


def check_physics(fluid: Fluid, fastest: float) -> PhysicsReport:
    """Return the checks of a fluid. `fastest`: the largest rate that was fitted, in 1/s."""
    fluid = replace(fluid, law=in_shared_form(fluid.law))
    found = {
        "flow curve monotonic": _flow_curve(fluid, fastest),
        "steady extension bounded": _extension(fluid),
        SMALL_STRAIN: _small_strain(fluid),
    }
    return PhysicsReport(tuple(PhysicsCheck(name, *one) for name, one in found.items()))


_Found = tuple[bool | None, float | None, str, str]
"""The fields of a `PhysicsCheck` behind its name."""


def _steady(fluid: Fluid, kind: FlowKind, rates: Float[np.ndarray, " n"]) -> tuple[np.ndarray, int]:
    """Return the stress of steady flow in Pa, and up to which rate in 1/s there is such a state."""
    flow = in_flow(steady_rates(rates), kind)
    stress = observed_in(fluid, flow, np.arange(1.0, rates.size + 1.0))[:, 0]
    steady = np.isfinite(stress)
    return stress, rates.size if steady.all() else int(np.argmin(steady))


def _flow_curve(fluid: Fluid, fastest: float) -> _Found:
    rates = SHEAR_RATES / mean_relaxation_time(fluid.modulus, fluid.relaxation_time)
    stress, last = _steady(fluid, "shear", rates)
    falling = np.flatnonzero(np.diff(stress[:last]) <= 0.0)
    if falling.size:
        low, high = float(rates[falling[0]]), float(rates[falling[-1] + 1])
        where = f"shear rates from {plainly(low)} to {plainly(high)} 1/s"
        note = "beyond the rates of training" if low > fastest else "within the rates of training"
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
