"""How far one term more of the library, as large as the noise lets it be, would move N1 and N2.

A band holds the constants of the law that was found, and laws that were met beside it. But noise
may hide a term that nobody chose, and the law with it is in the library too. To first order each
such law has its own covariance, and its N1 the width that follows   [Bevington & Robinson 2003,
Data Reduction and Error Analysis, ch. 7, for the propagation].
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from discover.statistics import HALF_BAND

_UNSEEN = 1e-7
"""Share of a combination that is seen, below which it is an exact direction: those are judged by
themselves, in exact arithmetic."""


@dataclass(frozen=True)
class OneTermMore:
    """The term that leaves a quantity most open if it is fitted along.

    `per_noise`: half of the 95 % interval of the quantity, root-mean-square over N1's, over the
        relative noise of the records, white and of one size.
    """

    term: str  # its name
    per_noise: float

    def to_json(self) -> dict[str, Any]:
        """Return it as JSON-able values."""
        return asdict(self)


def one_term_more(
    names: Sequence[str],
    support: Sequence[int],
    observed: Float[np.ndarray, "rows terms"],
    quantity: Float[np.ndarray, "others terms"],
    samples: int,
) -> OneTermMore | None:
    """Return the term that leaves a quantity most open; None where none can be seen.

    `names`: of all terms of the library. `support`: positions of those that the law has.
    `observed`, `quantity`: changes of what is observed and of the quantity per unit of each
    coefficient, so scaled that the norm of a column is a root-mean-square over that of the records.
    `samples`: how many samples of what is observed there are.
    """
    worst = None
    for extra, name in enumerate(names):
        columns = [*support, extra]
        sizes = np.linalg.norm(observed[:, columns], axis=0)
        if extra in support or np.any(sizes == 0.0):
            continue
        _, seen, turned = np.linalg.svd(observed[:, columns] / sizes, full_matrices=False)
        if len(seen) < len(columns) or seen[-1] < _UNSEEN * seen[0]:
            continue
        # a column of the root is a combination of the constants that varies by one deviation
        root = (turned.T / seen) / sizes[:, None]
        width = HALF_BAND * float(np.linalg.norm(quantity[:, columns] @ root)) / np.sqrt(samples)
        if worst is None or width > worst.per_noise:
            worst = OneTermMore(name, width)
    return worst


def each_moved(
    names: Sequence[str],
    support: Sequence[int],
    blocks: Mapping[str, Float[np.ndarray, "rows terms"]],
    observed: Sequence[str],
    samples: int,
) -> dict[str, OneTermMore]:
    """Return the same of every quantity that is not observed, by its name.

    `blocks`: changes of each quantity, observed or not. `observed`: which are.
    """
    stacked = np.concatenate([blocks[q] for q in observed])
    found = {
        q: one_term_more(names, support, stacked, block, samples)
        for q, block in blocks.items()
        if q not in observed
    }
    return {q: one for q, one in found.items() if one is not None}
