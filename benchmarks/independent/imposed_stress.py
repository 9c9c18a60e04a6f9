"""The strain with which a fluid and its solvent answer a stress, by scipy."""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.integrate import solve_ivp

from independent.material import RateLaw


def strain_at(
    law: RateLaw,
    levels: Sequence[tuple[float, float | Callable[[float], float]]],
    solvent_viscosity: float,
    times: np.ndarray,
) -> np.ndarray:
    """Return the strain at times in s, of levels of stress that begin at times of their own.

    Parameters
    ----------
    law
        Of the modes.
    levels
        Pairs of the time in s from which, and of the stress in Pa, a number or a function of
        time; the first from 0.
    solvent_viscosity
        In Pa s, positive: by it the rate follows from what of the stress the modes do not carry.
    times
        Increasing, in s.
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
