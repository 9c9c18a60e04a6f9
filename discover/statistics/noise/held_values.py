"""Is each value of a record read several times? What a transducer leaves that is slow to update."""

import numpy as np
from jaxtyping import Float

_FEWEST = 10  # values, from which on their repeats are a rule
_ALIKE = 0.8  # share of them that is read equally often


def read_times(record: Float[np.ndarray, " n"]) -> int:
    """Return how often each value of a record is read; 1 where values are new, or repeat by chance.

    A coarse converter repeats values too, but not all of them equally often.
    """
    lengths = np.diff(np.flatnonzero(np.diff(record)))
    if len(lengths) < _FEWEST:
        return 1
    often = int(np.median(lengths))
    return often if np.mean(lengths == often) > _ALIKE else 1
