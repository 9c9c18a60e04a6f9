"""N2 of a fluid that no law explains is that of polymers in general; the fluids are scipy's."""

import numpy as np
import pytest
from discover.comparison.judging.bands.dense_library import ANY_N2, DENSE, open_where_dense_is_wide
from discover.comparison.judging.bands.second_normal_stress import with_any_second_normal_stress
from discover.comparison.judging.explanation import Explanation
from discover.comparison.judging.statements import Statement
from discover.comparison.outcomes.flows import Flow
from discover.comparison.outcomes.outcome import LearnerOutcome
from independent import KBKZ, JohnsonSegalman, PhanThienTanner
from independent import start_up as start_up_of_scipy

from discover.protocols import in_flow, start_up
from discover.statistics import LackOfFit

TIMES = np.linspace(0.0, 6.0, 61)
FLOW = Flow("startup", "test", start_up(2.0), TIMES, np.full(61, 2.0), {})
UNEXPLAINED = Explanation({"tensor_sindy": LackOfFit("unexplained", 0.02, 0.01, 0.5, 0.0)})
EXPLAINED = Explanation({"tensor_sindy": LackOfFit("explained", 0.01, 0.01, 0.0, 0.5)})


def about(curves, n2=0.0, flow=FLOW):
    """The dense library, whose laws are sure of N1 to a tenth and take it that N2 is this of N1."""
    n1 = curves.N1
    band = {
        "sigma12": (0.9 * curves.sigma12, 1.1 * curves.sigma12),
        "N1": (0.9 * n1, 1.1 * n1),
        "N2": ((n2 - 0.02) * n1, (n2 + 0.02) * n1),
    }
    predicted = {"sigma12": curves.sigma12, "N1": n1, "N2": n2 * n1}
    empty = np.zeros(0), np.zeros(0)
    return {
        DENSE: LearnerOutcome(
            DENSE, (), 1.0, empty, predictions={flow.key: predicted}, bands={flow.key: band}
        )
    }


def share_held(outcomes, curves):
    low, high = outcomes[DENSE].bands[FLOW.key]["N2"]
    gap = curves.N2 - np.clip(curves.N2, low, high)
    return np.mean(gap == 0.0)


@pytest.mark.parametrize(
    "fluid",
    [KBKZ(0.2, -0.15), KBKZ(0.2, -0.25), JohnsonSegalman(0.4), PhanThienTanner(0.3)],
    ids=["K-BKZ", "K-BKZ with more N2", "Johnson-Segalman", "PTT, without N2"],
)
@pytest.mark.parametrize("taken", [0.0, -0.2])
def test_where_nothing_explains_the_runs_any_n2_of_a_polymer_is_in_the_band(fluid, taken):
    curves = fluid.respond(start_up_of_scipy(2.0), TIMES)
    narrow = about(curves, taken)
    wide = with_any_second_normal_stress(narrow, [FLOW], UNEXPLAINED)
    assert share_held(wide, curves) == 1.0
    for quantity in ("sigma12", "N1"):
        assert wide[DENSE].bands[FLOW.key][quantity] == narrow[DENSE].bands[FLOW.key][quantity]
    # it still says something: half of it is less than a fifth of N1
    assert wide[DENSE].half_widths(FLOW)["N2"] < 0.2


def test_an_n2_that_no_polymer_has_stays_outside_of_the_band():
    curves = KBKZ(0.2, 0.2).respond(start_up_of_scipy(2.0), TIMES)
    wide = with_any_second_normal_stress(about(curves), [FLOW], UNEXPLAINED)
    assert share_held(wide, curves) < 0.1


def test_where_a_law_of_the_library_explains_the_runs_the_band_stays():
    curves = PhanThienTanner(0.3).respond(start_up_of_scipy(2.0), TIMES)
    narrow = about(curves)
    assert with_any_second_normal_stress(narrow, [FLOW], EXPLAINED) == narrow
    # nothing is said of a flow without a band, of extension, or without a dense library
    stretched = Flow("", "test", in_flow(start_up(1.0), "uniaxial"), TIMES, np.ones(61), {})
    in_extension = about(curves, flow=stretched)
    assert with_any_second_normal_stress(in_extension, [stretched], UNEXPLAINED) == in_extension
    assert with_any_second_normal_stress({}, [FLOW], UNEXPLAINED) == {}


def test_the_statement_says_where_an_n2_comes_from_that_no_law_gave():
    curves = KBKZ(0.2, -0.15).respond(start_up_of_scipy(2.0), TIMES)
    said = [Statement("N1", "no", "Open."), Statement("N2", "no", "Open.")]
    wide = with_any_second_normal_stress(about(curves), [FLOW], UNEXPLAINED)
    assert wide[DENSE].details[ANY_N2] == [FLOW.key]
    n1, n2 = (s.text for s in open_where_dense_is_wide(said, wide, [FLOW]))
    assert "from zero to −2/7 of N1" in n2
    assert "−2/7" not in n1
    _, narrow = open_where_dense_is_wide(said, about(curves), [FLOW])
    assert "−2/7" not in narrow.text
