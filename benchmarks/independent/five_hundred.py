"""The five hundred fluids of Sunol et al., arXiv 2510.24673, by `scipy.integrate.solve_ivp`.

σ12 from rest under γ̇ = γ̇0 sin ωt, 0 to 12 s, 100 samples; five laws, of which each fluid draws its
constants. Carreau & Yasuda 1972 is σ12 = (η∞ + (η0 − η∞)(1 + (k|γ̇|)^a)^((n−1)/a)) γ̇.
"""

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp

TIMES = np.linspace(0.0, 12.0, 100)
FLOWS = {
    f"rate_{rate:g}_frequency_{name}.csv": (rate, frequency)
    for rate in (0.01, 0.1, 1.0, 10.0)
    for name, frequency in (("1_3", 1.0 / 3.0), ("1", 1.0), ("2", 2.0))
}
"""Amplitude of the rate in 1/s, and frequency in rad/s, by the name of the file."""

_GIESEKUS = {"viscosity": ("log", 0.1, 10.0), "time": ("log", 1.0, 10.0),
             "solvent": ("log", 0.1, 10.0)}  # fmt: skip
RANGES = {
    "Newtonian": {"solvent": ("log", 0.1, 10.0)},
    "Carreau-Yasuda": {"zero": ("log", 1.0, 100.0), "infinite": ("log", 0.01, 0.1),
                       "k": ("log", 0.1, 10.0), "n": ("even", 0.2, 0.7), "a": ("even", 0.5, 3.0)},
    "Oldroyd-B": {"viscosity": ("even", 1.0, 10.0), "time": ("even", 1.0, 10.0),
                  "solvent": ("even", 0.1, 10.0)},
    "Giesekus": {**_GIESEKUS, "alpha": ("even", 0.01, 0.5)},
    "linear PTT": {**_GIESEKUS, "zeta": ("even", 0.01, 0.2), "epsilon": ("even", 0.01, 0.5)},
}  # fmt: skip


def drawn(law: str, seed: int, number: int) -> dict[str, float]:
    """Return the constants of one fluid, in Pa and s."""
    lot = np.random.default_rng([seed, list(RANGES).index(law), number])
    return {
        name: float(low * (high / low) ** share if how == "log" else low + (high - low) * share)
        for name, (how, low, high) in RANGES[law].items()
        for share in [lot.random()]
    }


def respond(constants: dict[str, float], rate: Callable, times: np.ndarray = TIMES) -> np.ndarray:
    """Return σ12 in Pa from rest: of a mode by σ11, σ22, σ33 and σ12, or of a rate alone."""
    c, now = constants, np.asarray(rate(times), float)
    if "k" in c:
        thinned = (1.0 + (c["k"] * np.abs(now)) ** c["a"]) ** ((c["n"] - 1.0) / c["a"])
        return (c["infinite"] + (c["zero"] - c["infinite"]) * thinned) * now
    if "time" not in c:
        return c["solvent"] * now
    time, modulus = c["time"], c["viscosity"] / c["time"]
    alpha, zeta, epsilon = (c.get(name, 0.0) for name in ("alpha", "zeta", "epsilon"))

    def change(t, state):  # of σ/G, with σ▽ + ζ (D·σ + σ·D)
        s11, s22, s33, s12 = state
        g = float(rate(t))
        relaxes = (1.0 + epsilon * (s11 + s22 + s33)) / time
        return [
            (2.0 - zeta) * g * s12 - relaxes * s11 - alpha / time * (s11**2 + s12**2),
            -zeta * g * s12 - relaxes * s22 - alpha / time * (s22**2 + s12**2),
            -relaxes * s33 - alpha / time * s33**2,
            g + (1.0 - zeta / 2.0) * g * s22 - zeta / 2.0 * g * s11 - relaxes * s12
            - alpha / time * s12 * (s11 + s22),
        ]  # fmt: skip

    found = solve_ivp(
        change, (0.0, times[-1]), np.zeros(4), "DOP853", times, rtol=1e-10, atol=1e-13
    )
    return modulus * found.y[3] + c["solvent"] * now


def records(law: str, seed: int, number: int) -> dict[str, dict[str, np.ndarray]]:
    """Return the columns of the twelve oscillations by file, without noise."""
    constants, made = drawn(law, seed, number), {}
    for name, (size, frequency) in FLOWS.items():

        def rate(t, size=size, frequency=frequency):
            return size * np.sin(frequency * np.asarray(t))

        columns = {"time_s": TIMES, "shear_rate_1_s": rate(TIMES)}
        made[name] = {**columns, "stress_Pa": respond(constants, rate)}
    return made
