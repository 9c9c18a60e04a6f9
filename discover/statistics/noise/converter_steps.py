"""Records in steps of a converter: a stress that is read in coarse units of torque."""

import numpy as np
from jaxtyping import Float

_FEWEST_VALUES = 5  # that all of fewer are multiples of something may be chance


def step_of_converter(values: Float[np.ndarray, " n"]) -> float:
    """Return the step of which all numbers are multiples, of which most occur again; 0 if none.

    `values`: of a record, in any unit.
    """
    levels = np.unique(values)
    if not _FEWEST_VALUES <= len(levels) <= len(values) // 2:
        return 0.0
    gaps = np.diff(levels) / np.min(np.diff(levels))
    return float(np.min(np.diff(levels))) if np.allclose(gaps, np.round(gaps), atol=1e-3) else 0.0
