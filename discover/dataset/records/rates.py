"""Rates derived from strain, and rates read in too few samples to be known between them."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from discover.dataset.run_table import wave_of
from discover.errors import InputError
from discover.words import listed, percent_of

DEFAULT_WINDOW = 15
"""Samples in the moving window; over them the strain is taken to be a cubic in time."""

_DEGREE = 3

_CHUNK = 50_000


def differentiate(
    times: Float[np.ndarray, " n"], values: Float[np.ndarray, " n"], window: int = DEFAULT_WINDOW
) -> Float[np.ndarray, " n"]:
    """Return the time derivative of a noisy record, from a moving cubic fit.

    A cubic is fitted by least squares to the `window` samples nearest in order to each sample, and
    its slope taken there   [Savitzky & Golay 1964, Anal. Chem. 36, 1627, for any spacing].

    `times`: sampling times in s, increasing. `window`: number of samples in the window, 5 or more;
    fewer if the record is shorter. Raises InputError if the window is too short, or the record has
    fewer than 5 samples.
    """
    if window < _DEGREE + 2:
        raise InputError(f"The smoothing window must hold at least 5 samples; got {window}.")
    n = len(times)
    if n < _DEGREE + 2:
        raise InputError(
            f"A rate cannot be derived from {n} samples of strain; give at least 5, or a "
            "column shear_rate_1_s."
        )
    window = min(window, n)
    if n > _CHUNK:
        # a window of its own for each sample: in parts, so that a million samples fit in memory
        parts = [
            _slopes(times, values, window, np.arange(i, min(i + _CHUNK, n)))
            for i in range(0, n, _CHUNK)
        ]
        return np.concatenate(parts)
    return _slopes(times, values, window, np.arange(n))


def _slopes(
    times: np.ndarray, values: np.ndarray, window: int, samples: np.ndarray
) -> Float[np.ndarray, " m"]:
    first = np.clip(samples - window // 2, 0, len(times) - window)
    index = first[:, None] + np.arange(window)
    offset = times[index] - times[samples, None]
    # scaled to the window's width: the normal equations stay well conditioned
    width = np.max(np.abs(offset), axis=1, keepdims=True)
    powers = (offset / width)[:, :, None] ** np.arange(_DEGREE + 1)
    basis, triangle = np.linalg.qr(powers)
    projected = np.einsum("nwk,nw->nk", basis, values[index])
    coefficients = np.linalg.solve(triangle, projected[:, :, None])[:, :, 0]
    return coefficients[:, 1] / width[:, 0]


SMALL = 0.5
"""Share of what a law leaves, or of a half-width, up to which what a rate did between its samples
changes nothing that is said."""

MORE_SAMPLES = (
    "Record the rate at least twice as often: what it did between its samples then matters a tenth "
    "as much."
)

_ARITHMETIC = 5e-3
"""Change of the stress up to which it counts with steps and rounding, as in either command."""

_MOST_NAMES = 3

_NEGLIGIBLE = 0.05
"""Share of what a law leaves that another curve has to change in the rate itself to be looked at:
the stress follows the rate less than in proportion."""


@dataclass(frozen=True)
class CoarseRates:
    """What another curve through the samples of rates would change.

    `change` in the predicted stress: root mean square over that of the record, mean over fitted
        runs, after the fitted constants have taken up what they can.
    `left`: what the law leaves of the runs, likewise.
    `shifts`: of each fitted constant, over the half-width of its 95 % interval without it.
    `runs`: the runs it is largest in, each with its samples a cycle; None where it does not
        alternate.
    """

    change: float
    left: float
    shifts: Mapping[str, float]
    runs: Mapping[str, float | None]

    @property
    def is_coarse(self) -> bool:
        """Whether it is too large to be passed over."""
        return self.shows or any(s > SMALL for s in self.shifts.values())

    @property
    def shows(self) -> bool:
        """Whether it is too large beside what the law leaves; of constants nothing is asked."""
        return self.change > SMALL * self.left

    @property
    def hides(self) -> bool:
        """Whether it is as large as all that the law leaves, so that no law can be told.

        What changes less than arithmetic does is allowed for, and hides no law.
        """
        return self.change >= max(self.left, _ARITHMETIC)

    @property
    def sentence(self) -> str:
        """What is said of it."""
        cycles = [n for n in self.runs.values() if n is not None]
        how = ""
        if cycles:
            low, high = significant_samples(min(cycles)), significant_samples(max(cycles))
            how = f": {low if low == high else f'{low} to {high}'} samples a cycle"
        text = (
            f"The rate of {listed([*self.runs])} is sampled too coarsely{how}. Another curve "
            f"through the same samples changes the stress by {percent_of(self.change)}, where "
            f"{percent_of(self.left)} is left"
        )
        moved = [key.replace("_", " ") for key, s in self.shifts.items() if s > SMALL]
        if moved:
            its = "its interval is" if len(moved) == 1 else "their intervals are"
            which = listed(moved) if len(moved) <= _MOST_NAMES else f"{len(moved)} constants"
            text += f", and moves {which}; {its} wider by that"
        return f"{text}."

    def to_json(self) -> dict[str, Any]:
        """Return it as JSON-able values."""
        said = self.sentence if self.is_coarse else ""
        told = {"too_coarse": self.is_coarse, "hides_the_law": self.hides, "said": said}
        return {**asdict(self), **told}


def significant_samples(count: float) -> str:
    """Return samples a cycle in words' digits: whole from ten on, else one decimal at most."""
    return f"{count:.0f}" if count >= 10.0 else f"{count:.2g}"


def coarse_in(found: Mapping[str, Any] | None) -> CoarseRates | None:
    """Return what `CoarseRates.to_json` wrote; None where that is nothing, or too small to tell."""
    if not found:
        return None
    coarse = CoarseRates(found["change"], found["left"], found["shifts"], found["runs"])
    return coarse if coarse.is_coarse else None


def samples_a_cycle(time: Float[np.ndarray, " n"], rate: Float[np.ndarray, " n"]) -> float | None:
    """Return how many samples a cycle has; None where the rate does not alternate.

    `time`, `rate` in s and 1/s.
    """
    wave = wave_of(time, rate) if len(time) > 3 else None
    if wave is None:
        return None
    return float(2.0 * np.pi / wave[0] / np.median(np.diff(time)))


def worth_a_look(unknown: Sequence[float], left: float) -> bool:
    """Return whether what is unknown of rates may matter beside what a law leaves."""
    return max(unknown, default=0.0) > _NEGLIGIBLE * left
