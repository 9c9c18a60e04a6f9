"""The last cycle of an oscillation, as Lissajous curves show it."""

import numpy as np
from jaxtyping import Bool, Float
from matplotlib.patches import PathPatch
from matplotlib.path import Path


def in_last_cycle(times: Float[np.ndarray, " n"], frequency: float) -> Bool[np.ndarray, " n"]:
    """Return which samples lie in the last cycle, a little more so that it closes.

    `times` in s, increasing, shape (n,). `frequency`: angular, in 1/s.
    """
    return times >= times[-1] - 2.0 * np.pi / frequency * 1.02


def about_middle(
    strain: Float[np.ndarray, " n"], cycle: Bool[np.ndarray, " n"]
) -> Float[np.ndarray, " n"]:
    """Return the strain about the middle of the range that it has in a cycle."""
    return strain - 0.5 * (strain[cycle].max() + strain[cycle].min())


def shade_between(
    panel,
    along: Float[np.ndarray, " n"],
    low: Float[np.ndarray, " n"],
    high: Float[np.ndarray, " n"],
    **style,
) -> None:
    """Shade what lies between two curves, also where `along` goes back and forth.

    There a fill between the curves as a whole would shade the inside of a loop and a bar where it
    begins and ends, and not what the band sweeps.

    `panel`: axes of matplotlib. `along`, `low`, `high`: where the curves stand, and the curves,
    shape (n,). `style`: of the shade, as for `matplotlib.axes.Axes.fill_between`.
    """
    if np.all(np.diff(along) >= 0.0):
        panel.fill_between(along, low, high, **style)
        return
    before, after = np.stack([along, low], axis=-1), np.stack([along, high], axis=-1)
    forth = np.stack([before[:-1], before[1:], after[1:], after[:-1], before[:-1]], axis=1)
    forth = forth[np.all(np.isfinite(forth), axis=(1, 2))]
    # all in one sense, for pieces of opposite senses that overlap would take each other out
    back = forth[:, 1, 0] < forth[:, 0, 0]
    forth[back] = forth[back, ::-1]
    codes = [Path.MOVETO, Path.LINETO, Path.LINETO, Path.LINETO, Path.CLOSEPOLY]
    path = Path(forth.reshape(-1, 2), codes * len(forth))
    panel.add_patch(PathPatch(path, **style))
