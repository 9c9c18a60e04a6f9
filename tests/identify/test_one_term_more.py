"""What one term more would leave open: held against fits to noise drawn by lot."""

import numpy as np
import pytest

from discover.dataset import Run
from discover.identify.structure import analyse_structure
from discover.identify.twins import one_term_more
from discover.protocols import start_up
from tensor_library import LawTerms, build_library

ROWS = 200
X = np.linspace(0.0, 1.0, ROWS)
SEEN = np.stack([np.exp(-X), np.cos(3.0 * X), 1e-3 * X**2, np.exp(-X)], axis=1) / np.sqrt(ROWS)
HIDDEN = np.stack([np.exp(X), 0.2 + 0 * X, 4e-3 * X, np.exp(X)], axis=1) / np.sqrt(ROWS)
NAMES = ("law", "seen well", "hardly seen", "never seen beside the law")


def test_the_term_that_leaves_most_open_leaves_as_much_as_fits_to_noise_scatter():
    found = one_term_more(NAMES, [0], SEEN, HIDDEN, ROWS)
    lot, scatter = np.random.default_rng(0), {}
    for extra in (1, 2):
        pair = [0, extra]
        # a sample errs by the noise, over the root of their number in these units
        noise = lot.standard_normal((4000, ROWS)) / np.sqrt(ROWS)
        constants = noise @ np.linalg.pinv(SEEN[:, pair]).T
        moved = np.sum((constants @ HIDDEN[:, pair].T) ** 2, axis=1)
        scatter[NAMES[extra]] = 1.96 * np.sqrt(np.mean(moved))
    assert found.term == max(scatter, key=scatter.get) == "hardly seen"
    # 4000 draws tell a deviation to two per cent
    assert found.per_noise == pytest.approx(scatter["hardly seen"], rel=0.05)


def test_a_term_that_cannot_be_seen_beside_the_law_is_judged_elsewhere():
    alone = one_term_more(NAMES[:1] + NAMES[3:], [0], SEEN[:, [0, 3]], HIDDEN[:, [0, 3]], ROWS)
    assert alone is None


TIMES = np.linspace(0.1, 8.0, 80)
RUNS = [Run(str(r), TIMES, start_up(r), np.full(80, r), np.ones(80)) for r in (0.5, 2.0)]


@pytest.mark.slow
def test_a_law_that_stands_for_another_is_left_more_open_than_a_simple_one():
    # two terms that fitted a stretching Rolie–Poly fluid at 6 % noise, N1 off by 22 %
    laws = {
        "mobility": LawTerms({"sigma.sigma": 0.3}),
        "in its place": LawTerms({"tr(sigma)*sigma.sigma": 1.37, "tr(sigma.gammadot)*sigma": 0.52}),
    }
    structure = analyse_structure(RUNS, build_library(degree=0), nominal=laws)
    per_noise = {one.name: one.one_more["N1"].per_noise for one in structure.laws}
    assert per_noise["in its place"] > 1.5 * per_noise["mobility"] > 0.0
