"""First harmonics of oscillations that scipy integrates until they are periodic."""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.integrate import solve_ivp

from independent.laws import Giesekus
from independent.material import RateLaw

SAMPLES = 128
"""Of one cycle."""


def oscillating(
    change: Callable, start: Sequence[float], frequency: float, cycles: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return times and states over the cycle that follows a number of them."""
    period = 2.0 * np.pi / frequency
    times = (cycles + np.arange(SAMPLES) / SAMPLES) * period
    found = solve_ivp(
        change, (0.0, times[-1]), start, method="LSODA", t_eval=times, rtol=1e-9, atol=1e-9
    )
    return times, found.y


def first_harmonic(times: np.ndarray, stress: np.ndarray, frequency: float) -> complex:
    """Return G′ + iG″ times the strain of a stress over one cycle, for the strain sin ωt."""
    turn = np.exp(-1j * frequency * times)
    return complex(2j * np.mean(stress * turn))


def modulus_of(
    law: RateLaw, strain: float, frequency: float, cycles: int, slip: float = 0.0
) -> complex:
    """Return G′ + iG″ in Pa of a law after so many cycles of a strain γ₀ sin ωt of the tool.

    `law`: of the modes. `strain`, `frequency`, `cycles`: γ₀, ω in rad/s, and how many cycles are
    waited for. `slip` in 1/(Pa s): the fluid feels the rate less this times its stress.
    """
    scale = law.scale()

    def rate(t, state):
        imposed = strain * frequency * np.cos(frequency * t)
        return imposed - slip * law.stress(state, 0.0)[0, 1] if slip else imposed

    def change(t, scaled):
        state = scale * scaled
        return law.change(state, rate(t, state)) / scale

    times, values = oscillating(change, law.rest() / scale, frequency, cycles)
    pairs = zip(times, (scale[:, None] * values).T, strict=True)
    stress = np.array([law.stress(state, rate(t, state))[0, 1] for t, state in pairs])
    # least squares by sine and cosine, evenly sampled over whole cycles
    return first_harmonic(times, stress, frequency) / strain


def giesekus_modulus(
    mobility: float, modulus: float, relaxation_time: float, strain: float, frequency: float,
    slip: float = 0.0,
) -> complex:  # fmt: skip
    """Return that of a Giesekus fluid of α, G in Pa and λ in s, once it is periodic."""
    cycles = int(np.ceil(25.0 * relaxation_time * frequency / (2.0 * np.pi))) + 2
    law = Giesekus(mobility, modulus, relaxation_time)
    return modulus_of(law, strain, frequency, cycles, slip)


def strain_at(
    law: RateLaw,
    levels: Sequence[tuple[float, float | Callable[[float], float]]],
    solvent_viscosity: float,
    times: np.ndarray,
) -> np.ndarray:
    """Return the strain at times in s, of levels of stress that begin at times of their own.

    `law`: of the modes. `levels`: pairs of the time in s from which, and of the stress in Pa, a
    number or a function of time; the first from 0. `solvent_viscosity` in Pa s, positive: by it the
    rate follows from what of the stress the modes do not carry. `times`: increasing, in s.
    """
    scale = np.append(law.scale(), 1.0)
    state = np.append(law.rest(), 0.0)
    ends = [begin for begin, _ in levels[1:]] + [float(times[-1])]
    found = []
    for (begin, stress), end in zip(levels, ends, strict=True):

        def change(t, scaled, stress=stress):
            values = (scale * scaled)[:-1]
            imposed = stress(t) if callable(stress) else stress
            rate = (imposed - law.stress(values, 0.0)[0, 1]) / solvent_viscosity
            return np.append(law.change(values, rate), rate) / scale

        here = times[(times > begin) & (times <= end)]
        solved = solve_ivp(
            change, (begin, end), state / scale, method="LSODA", t_eval=np.union1d(here, [end]),
            rtol=1e-9, atol=1e-10,
        )  # fmt: skip
        found.append(solved.y[-1, : len(here)])
        state = scale * solved.y[:, -1]
    return np.concatenate(found)
