"""Records of chains that stretch, made on full tensors by scipy, with a term beside their law."""

import numpy as np
from independent import PomPom, RoliePoly
from independent.homogeneous import UNIT
from scipy.integrate import solve_ivp

import discover as dc
from discover.dataset import Run

TIMES = np.linspace(0.0, 8.0, 61)
FLOWS = {
    "slow start": (dc.start_up(1.0), lambda t: 1.0),
    "fast start": (dc.start_up(4.0), lambda t: 4.0),
    "oscillation": (dc.oscillatory_shear(2.0, 1.0), lambda t: 2.0 * np.cos(t)),
    "large oscillation": (dc.oscillatory_shear(5.0, 1.0), lambda t: 5.0 * np.cos(t)),
    "unseen start": (dc.start_up(2.0), lambda t: 2.0),
}


def with_mobility(law, mobility, state, rate):
    """Return the change of a law's state with −α σ·σ added to dσ/dt, G = λ = 1."""
    change = law.change(state, rate)
    extra = -mobility * np.linalg.matrix_power(law.stress(state, rate), 2)
    if isinstance(law, RoliePoly):  # σ = A − I
        return change + extra.ravel()
    # σ + I = 3 Λ² S, S = A/tr A; tr A, which only says how fast S turns, is left as it is
    a, stretch = state[:9].reshape(3, 3), state[9]
    squared = np.trace(extra) / 3.0
    turned = (extra / 3.0 - a / np.trace(a) * squared) / stretch**2
    return change + np.append(np.trace(a) * turned, 0.5 * squared / stretch)


def records(law, mobility, noise=0.01, seed=1):
    """Return the flows as runs of σ12 with noise, and N1 and N2 to judge."""
    generator, runs = np.random.default_rng(seed), []
    for name, (protocol, rate) in FLOWS.items():
        found = solve_ivp(
            lambda t, y, rate=rate: with_mobility(law, mobility, y, UNIT["shear"] * rate(t)),
            (0.0, TIMES[-1]), law.rest(), "Radau", TIMES, rtol=1e-8, atol=1e-10,
        )  # fmt: skip
        stress = np.array([law.stress(state, 0.0) for state in found.y.T])
        exact = stress[:, 0, 1]
        size = noise * np.sqrt(np.mean(exact**2))
        runs.append(
            Run(
                name, TIMES, protocol, np.array([rate(t) for t in TIMES]),
                exact + size * generator.standard_normal(len(TIMES)),
                first_normal_stress_difference=stress[:, 0, 0] - stress[:, 1, 1],
                second_normal_stress_difference=stress[:, 1, 1] - stress[:, 2, 2],
            )
        )  # fmt: skip
    return dc.Dataset("chains", tuple(runs))


ROLIE_POLY = RoliePoly(release=0.5, stretch_time=0.2)
POM_POM = PomPom(4.0, 0.3, fade=0.05)


def known(name):
    """Return the law that made the records, without the term beside it, as a fluid."""
    constants = {
        "rolie_poly": {"stretch_time_ratio": 0.2, "beta": 0.5},
        "pom_pom_drag_strain": {"q": 4.0, "stretch_time_ratio": 0.3},
        "ucm": {},
    }
    return dc.Fluid(dc.make_law(name, constants[name]), 1.0, 1.0)
