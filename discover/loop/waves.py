"""A residual of an oscillation as waves: in phase with strain and with rate, harmonics, drift."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.optimize import minimize_scalar

from discover.loop.run_record import RunRecord

HARMONICS = 5
"""Highest multiple of the frequency at which a residual is read."""
_FEWEST_CYCLES = 2.0
_REGULAR = 0.15  # relative spread of half periods, up to which a rate oscillates
_PURE = 0.97  # share of the rate that odd harmonics must explain


@dataclass(frozen=True)
class Wave:
    """What the residual of an oscillation is made of, each relative to the stress's fundamental.

    `run`: the run. `frequency`: in rad/s. `elastic`, `viscous`: fundamental in phase with the
    strain and with the shear rate; positive where the model predicts too much. `odd`, `even`:
    higher odd harmonics, and even ones; root of the sum of squares. `drift`: change from the first
    to the last sample that does not oscillate. `noise`: what noise, as large as what is left
    between the harmonics, would put into two of them.
    """

    run: str
    frequency: float
    elastic: float
    viscous: float
    odd: float
    even: float
    drift: float
    noise: float


def oscillation(record: RunRecord) -> float | None:
    """Return the frequency in rad/s at which the shear rate of a run oscillates, if it does."""
    rate, time = record.rate, record.time
    signs = np.sign(rate)
    turns = np.flatnonzero(signs[1:] * signs[:-1] < 0)
    if len(turns) < 2 * _FEWEST_CYCLES:
        return None
    share = rate[turns] / (rate[turns] - rate[turns + 1])
    crossings = time[turns] + share * (time[turns + 1] - time[turns])
    halves = np.diff(crossings)
    if np.std(halves) > _REGULAR * np.mean(halves):
        return None
    first = np.pi / float(np.mean(halves))

    def missed(frequency: float) -> float:
        basis = _harmonics(time, frequency, (1, 3, 5))
        left = rate - basis @ np.linalg.lstsq(basis, rate, rcond=None)[0]
        return float(left @ left)

    best: Any = minimize_scalar(missed, bounds=(0.95 * first, 1.05 * first), method="bounded")
    explained = 1.0 - missed(float(best.x)) / float(rate @ rate)
    return float(best.x) if explained > _PURE else None


def _harmonics(time, frequency: float, multiples) -> Float[np.ndarray, "n columns"]:
    return np.column_stack([f(m * frequency * time) for m in multiples for f in (np.cos, np.sin)])


def read_wave(record: RunRecord, model: int = -1) -> Wave | None:
    """Return what the residual of one run is made of, or nothing where it does not oscillate.

    Least squares on the harmonics of the rate's frequency, a constant and a slope, over the last
    half of the run, where what started with it has mostly died away.
    """
    frequency = oscillation(record)
    if frequency is None:
        return None
    late = record.time >= 0.5 * record.time[-1]
    if np.ptp(record.time[late]) * frequency < 2.0 * np.pi:
        late = np.ones_like(late)
    time = record.time[late]
    multiples = tuple(range(1, HARMONICS + 1))
    middle = (time - time.mean()) / max(float(np.ptp(time)), 1e-300)
    basis = np.column_stack([_harmonics(time, frequency, multiples), np.ones_like(time), middle])

    def coefficients(values):
        found = np.linalg.lstsq(basis, values[late], rcond=None)[0]
        return found[: 2 * HARMONICS : 2] - 1j * found[1 : 2 * HARMONICS : 2], float(found[-1])

    rate, _ = coefficients(record.rate)
    stress, _ = coefficients(record.measured)
    left, drift = coefficients(record.residual[model])
    rest = record.residual[model][late]
    rest = rest - basis @ np.linalg.lstsq(basis, rest, rcond=None)[0]
    free = max(len(time) - basis.shape[1], 1)
    # cosine and sine of a harmonic each have a variance of 2 s²/n, and two harmonics four of them
    noise = float(np.sqrt(8.0 * np.sum(rest**2) / free / len(time)))
    scale = abs(stress[0])
    if scale == 0.0 or rate[0] == 0.0:
        return None
    # strain lags the rate by a quarter of a cycle
    along_rate = rate[0] / abs(rate[0])
    along_strain = -1j * along_rate
    return Wave(
        run=record.name,
        frequency=frequency,
        elastic=float((left[0] * np.conj(along_strain)).real / scale),
        viscous=float((left[0] * np.conj(along_rate)).real / scale),
        odd=float(np.linalg.norm(left[2::2]) / scale),
        even=float(np.linalg.norm(left[1::2]) / scale),
        drift=drift / scale,
        noise=noise / scale,
    )
