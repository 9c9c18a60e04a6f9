"""Every named law against its independent solution: errors in four flows, and order of the steps.

scipy (Radau, 1e-10) follows each law on full tensors in start-up of shear at a Weissenberg number
of 3, in an oscillation of the rate of amplitude 2 and frequency 1, in uniaxial extension at a
Hencky rate of 0.8, and under a shear stress that rises to 0.6 G beside a solvent of a tenth of the
viscosity. An error is the largest over the largest value; the order of the steps follows from steps
four times and twice as long (at a given stress, half and a quarter as long).
"""

import numpy as np
from independent.homogeneous import UNIT
from independent.named import CONSTANTS, material
from scipy.integrate import solve_ivp

from discover.forward.grid import STRAIN_STEP
from discover.forward.of_fluids import observed_in
from discover.laws import Fluid, make_law
from discover.protocols import FlowProtocol, imposed_stress, in_flow, oscillatory_shear, start_up

SHEAR_RATE, AMPLITUDE, FREQUENCY, HENCKY_RATE = 3.0, 2.0, 1.0, 0.8
STRESS, RISE, SOLVENT = 0.6, 1.0, 0.1
TIMES = {
    # no closer than the coarsest steps, for every sample is a step
    "start-up": np.linspace(0.2, 6.0, 30),
    "oscillation": np.linspace(0.4, 9.2, 23),
    "extension": np.linspace(0.3, 3.0, 10),
    "imposed stress": np.linspace(0.02, 4.0, 200),
}
FLOWS: dict[str, FlowProtocol] = {
    "start-up": start_up(SHEAR_RATE),
    "oscillation": oscillatory_shear(AMPLITUDE, FREQUENCY),
    "extension": in_flow(start_up(HENCKY_RATE), "uniaxial"),
    "imposed stress": imposed_stress(
        TIMES["imposed stress"], STRESS * np.minimum(TIMES["imposed stress"] / RISE, 1.0)
    ),
}
FLOOR = 3e-8
"""Relative error of scipy here, with tolerances of 1e-10."""


def exact(law: str, flow: str) -> np.ndarray:
    """Return what scipy says is observed: three columns, or one."""
    made, times = material(law, CONSTANTS[law]), TIMES[flow]
    if flow == "imposed stress":
        return _crept(made, times)
    kind = "uniaxial" if flow == "extension" else "shear"

    def gradient(t):
        if flow == "oscillation":
            return AMPLITUDE * np.cos(FREQUENCY * t) * UNIT[kind]
        return (HENCKY_RATE if flow == "extension" else SHEAR_RATE) * UNIT[kind]

    states = _solved(lambda t, y: made.change(y, gradient(t)), made.rest(), times)
    s = np.array([made.stress(y, gradient(t)) for t, y in zip(times, states, strict=True)])
    first = s[:, 0, 0] - s[:, 1, 1]
    if flow == "extension":
        return first[:, None]
    return np.stack([s[:, 0, 1], first, s[:, 1, 1] - s[:, 2, 2]], axis=1)


def _crept(made, times: np.ndarray) -> np.ndarray:
    size = len(made.rest())

    def change(t, y):
        # none of these materials has a stress that depends on the rate itself
        left = STRESS * min(t / RISE, 1.0) - made.stress(y[:size], 0.0)[0, 1]
        rate = left / SOLVENT
        return np.append(made.change(y[:size], rate * UNIT["shear"]), rate)

    start = np.append(made.rest(), 0.0)
    rising = _solved(change, start, times[times <= RISE])
    level = times[times > RISE]
    after = _solved(change, rising[-1], level, begins=float(times[times <= RISE][-1]))
    return np.concatenate([rising, after])[:, -1:]


def _solved(change, start, times, begins: float = 0.0) -> np.ndarray:
    found = solve_ivp(change, (begins, times[-1]), start, "Radau", times, rtol=1e-10, atol=1e-12)
    if not found.success:
        raise ValueError(found.message)
    return found.y.T


def observed(law: str, flow: str, pieces: int = 1, coarser: float = 1.0) -> np.ndarray:
    """Return what the software says is observed, with steps cut in pieces, or longer ones."""
    made = make_law(law, CONSTANTS[law])
    solvent = SOLVENT if flow == "imposed stress" else 0.0
    how = {"pieces": pieces, "phase": 0.15 * coarser}
    fluid = Fluid(made, 1.0, 1.0, solvent)
    found = observed_in(fluid, FLOWS[flow], TIMES[flow], STRAIN_STEP * coarser, **how)
    return found if flow in ("start-up", "oscillation") else found[:, :1]


def measured(law: str, flow: str) -> dict[str, float | None]:
    """Return the error with the steps of a fit, and the order of the steps."""
    truth = exact(law, flow)
    size = np.max(np.abs(truth[:, :2]))  # N2 is measured by N1, for it is zero in some laws

    def error(*steps) -> float:
        return float(np.max(np.abs(observed(law, flow, *steps) - truth)) / size)

    pair = ((2, 1.0), (4, 1.0)) if flow == "imposed stress" else ((1, 4.0), (2, 4.0))
    coarse, fine = (error(*steps) for steps in pair)
    above = fine > FLOOR and coarse > FLOOR
    return {"error": error(), "order": float(np.log2(coarse / fine)) if above else None}
