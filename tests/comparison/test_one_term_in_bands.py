"""A band of N1 holds one term more of the library, as large as the noise lets it be."""

from dataclasses import replace

import numpy as np
import pytest
from discover.comparison.judging.bands.one_term_in_bands import holding_one_term_more
from discover.comparison.judging.identifiability import FOUND
from discover.comparison.outcomes.flows import Flow
from discover.identify.rivals.bands import PredictionBand

from discover.identify import HiddenStresses
from discover.identify.structure.one_term_more import OneTermMore
from discover.identify.structure.structure import LawStructure, Structure
from discover.protocols import start_up
from discover.statistics.lack_of_fit import LackOfFit
from tensor_library.law_terms import LawTerms

TIMES = np.linspace(0.1, 8.0, 40)
N1 = 100.0 * TIMES
CHOSEN = np.stack([TIMES, N1, 0.0 * TIMES], axis=1)
FLOWS = [
    Flow(name, kind, start_up(1.0), TIMES, np.ones(40), {}, TIMES)
    for name, kind in (("fitted", "training"), ("faster", "held_out"))
]


def of_width(half):
    edge = half * CHOSEN
    return PredictionBand(TIMES, CHOSEN, CHOSEN - edge, CHOSEN + edge, CHOSEN - edge,
                          CHOSEN + edge, 0.0)  # fmt: skip


BANDS = {FLOWS[0].key: of_width(0.03), FLOWS[1].key: of_width(0.06)}


def widened(one_more, noise=0.02, correlation=0.0):
    hidden = HiddenStresses(np.zeros((0, 3)), {"N1": True, "N2": True})
    law = LawStructure(FOUND, LawTerms({}), hidden, (), (), (), 0, "undetermined", one_more)
    left = LackOfFit("explained", noise, noise, correlation, 0.5)
    return holding_one_term_more(BANDS, Structure((law,), (), 8), left, FLOWS)


MORE = {"N1": OneTermMore("tr(sigma)*I", 2.0), "N2": OneTermMore("gammadot.gammadot", 1.0)}


def test_a_band_of_n1_grows_by_what_one_term_more_leaves_open():
    fitted, faster = (widened(MORE)[flow.key] for flow in FLOWS)
    # 3 % of the band and 2 × 2 % of the term; twice both where the band is twice as wide
    assert fitted.widths()["N1"] == pytest.approx(2 * 0.05)
    assert faster.widths()["N1"] == pytest.approx(2 * 0.10)
    # a law without N2 is not sure of it
    assert fitted.widths()["N2"] == pytest.approx(2 * 0.02)
    # σ12 was recorded, and the band of the constants alone stays
    assert fitted.widths()["sigma12"] == pytest.approx(2 * 0.03)
    assert fitted.widths(with_rivals=False)["N1"] == pytest.approx(2 * 0.03)


def test_noise_of_fewer_independent_samples_leaves_more_open():
    white, correlated = widened(MORE), widened(MORE, correlation=0.6)
    for flow in FLOWS:
        assert correlated[flow.key].widths()["N1"] > 1.3 * white[flow.key].widths()["N1"]


def test_without_noise_or_without_such_a_term_bands_stay():
    for found in (widened({}), widened(MORE, noise=0.0)):
        for flow in FLOWS:
            np.testing.assert_allclose(found[flow.key].rivals_low, BANDS[flow.key].rivals_low)


def test_a_flow_without_a_band_gets_none():
    nothing = np.full_like(CHOSEN, np.nan)
    none = replace(of_width(0.03), rivals_low=nothing, rivals_high=nothing)
    law = widened(MORE)
    assert np.isfinite(law[FLOWS[1].key].rivals_low).all()
    hidden = HiddenStresses(np.zeros((0, 3)), {"N1": True, "N2": True})
    at = LawStructure(FOUND, LawTerms({}), hidden, (), (), (), 0, "undetermined", MORE)
    left = LackOfFit("explained", 0.02, 0.02, 0.0, 0.5)
    found = holding_one_term_more({FLOWS[1].key: none}, Structure((at,), (), 8), left, FLOWS)
    assert np.isnan(found[FLOWS[1].key].rivals_low).all()
