"""Runs held out refute a degree of constants by mode, and the next is held against them too."""

import pytest
from discover.inference.by_mode.degrees import lowest_not_refuted

from discover.inference.by_mode.constants import ConstantByMode, ModeConstant
from discover.report.plots.by_mode import by_mode_sentence


@pytest.mark.parametrize(
    ("refuted", "taken", "fitted"),
    [
        ([False, True], 1, 1),
        ([True, False, False], 2, 2),
        ([True, True, False], 3, 3),
        # where all are refuted the first is told
        ([True, True, True], 1, 3),
    ],
)
def test_the_lowest_degree_that_is_not_refuted_is_taken(refuted, taken, fitted):
    made = [1]

    def more(degree):
        if degree == len(refuted):
            return None
        made.append(degree + 1)
        return degree + 1

    assert lowest_not_refuted(1, more, lambda degree: refuted[degree - 1]) == taken
    assert len(made) == fitted


def test_the_page_says_why_it_is_not_the_degree_that_evidence_asked_for():
    modes = (ModeConstant(1.0, 0.3, (0.2, 0.4), False), ModeConstant(0.1, 0.1, (0.0, 0.2), False))

    def said(raised):
        evidence = (0.0, 9.0, 10.0, 10.5)
        one = ConstantByMode(0.2, (0.1, 0.3), "", 1.0, 3, evidence, modes, own=1, is_raised=raised)
        return by_mode_sentence("alpha", one)

    assert "free in each mode that the runs tell" in said(True)
    assert "linear, quadratic and free: 9, 10 and 10" in said(True)
    assert "runs held out refute less" in said(True)
    assert "refute" not in said(False)
