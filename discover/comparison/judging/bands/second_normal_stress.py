"""N2 of a fluid that no law explains: what fluids are known to have, for σ12 says nothing of it.

Laws with one σ12 and one N1 differ in N2, exactly. So the N2 of laws that fit σ12 is theirs and not
the data's, and where no law of the library is the fluid's the band holds what N2 may be at all.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from discover.comparison.judging.bands.dense_library import ANY_N2, DENSE
from discover.comparison.judging.explanation import Explanation
from discover.comparison.outcomes.flows import Flow
from discover.comparison.outcomes.outcome import LearnerOutcome, Limits

LARGEST_RATIO = 2.0 / 7.0
"""−N2/N1 of independently aligned tubes, at the upper end of what polymer melts and solutions have;
the lower end is zero   [Doi & Edwards 1978, J. Chem. Soc. Faraday Trans. 2 74, 1818; Maklad & Poole
2021, JNNFM 292, 104522]."""


def with_any_second_normal_stress(
    outcomes: Mapping[str, LearnerOutcome], flows: Sequence[Flow], explanation: Explanation
) -> dict[str, LearnerOutcome]:
    """Return the outcomes, the dense band of N2 in shear holding that of any polymeric fluid.

    That is all from zero to −2/7 of N1, wherever N1 lies in its own band. Where a law of the
    library explains the runs, bands stay: what is said there is said of that library.

    Parameters
    ----------
    outcomes
        By learner; without ``"tensor_dense"`` they stay as they are.
    flows
        All flows.
    explanation
        Whether a law explains the runs.
    """
    dense = outcomes.get(DENSE)
    if dense is None or explanation.in_library:
        return dict(outcomes)
    bands, widened = dict(dense.bands), []
    for flow in flows:
        limits = bands.get(flow.key)
        if limits is None or not flow.in_shear:
            continue
        bands[flow.key] = {**limits, "N2": _widened(limits)}
        widened.append(flow.key)
    if not widened:
        return dict(outcomes)
    details = {**dense.details, ANY_N2: widened}
    return {**outcomes, DENSE: replace(dense, bands=bands, details=details)}


def _widened(limits: Limits) -> tuple[np.ndarray, np.ndarray]:
    (low, high), (lowest, highest) = limits["N2"], limits["N1"]
    ends = [-LARGEST_RATIO * lowest, -LARGEST_RATIO * highest, np.zeros_like(low)]
    return np.minimum(low, np.min(ends, axis=0)), np.maximum(high, np.max(ends, axis=0))
