"""Of a few kinds the 95 % interval of one more holds it; what is known of them alone does not."""

import numpy as np
import pytest
from discover.statistics.one_more import one_more

DRAWN = 4000


@pytest.mark.parametrize("known", [2, 5, 15])
@pytest.mark.parametrize("scatter", [0.0, 0.3])
def test_one_more_of_normal_kinds_lies_in_the_interval(known, scatter):
    rng = np.random.default_rng([known, int(10 * scatter)])
    means = 3.0 + rng.normal(size=(known + 1, DRAWN))
    kinds = np.repeat(np.arange(known), 8)
    values = means[kinds] + scatter * rng.normal(size=(len(kinds), DRAWN))
    new = means[-1] + scatter * rng.normal(size=DRAWN)
    low, high = one_more(values, kinds)
    held = np.mean((low <= new) & (new <= high))
    # 4,000 draws scatter by 0.3 %; t is too wide for the scatter within, which is known better
    assert held > 0.94
    assert held < 0.96 or scatter > 0.0
    # the range of all that is known holds one more less often
    range_holds = np.mean((values.min(axis=0) <= new) & (new <= values.max(axis=0)))
    assert range_holds < held or known == 15


def test_kinds_that_agree_leave_what_scatters_within():
    rng = np.random.default_rng(1)
    kinds = np.repeat(np.arange(10), 50)
    low, high = one_more(rng.normal(size=(500, 1)), kinds)
    # t of nine degrees of freedom, and a variance of one
    assert float(high[0] - low[0]) == pytest.approx(2 * 2.26, rel=0.1)
