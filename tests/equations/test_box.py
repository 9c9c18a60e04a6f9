"""The box of Wi and De: from protocols or from records."""

import numpy as np
import pytest

from discover.equations.equation import box_of, flow_numbers


@pytest.mark.parametrize("frequency", [0.25, 1.0, 3.0])
def test_the_frequency_of_a_record_is_found_from_its_changes_of_sign(frequency):
    times = np.linspace(0.0, 20.0, 401)
    weissenberg, deborah = flow_numbers(times, 2.0 * np.cos(frequency * times), 0.5)
    assert weissenberg == 1.0
    assert deborah == pytest.approx(0.5 * frequency, rel=0.02)


def test_a_flow_that_does_not_oscillate_is_as_fast_as_it_is_long():
    times = np.linspace(0.0, 20.0, 401)
    assert flow_numbers(times, np.full(401, 3.0), 2.0) == (6.0, 0.1)
    reversed_once = np.where(times < 10.0, 3.0, -3.0)
    assert flow_numbers(times, reversed_once, 2.0) == (6.0, 0.1)
    assert flow_numbers(times, np.zeros(401), 2.0) == (0.0, 0.1)


def test_the_box_holds_every_flow_and_there_is_none_without_flows():
    box = box_of([(1.0, 0.5), (2.0, 0.25)])
    assert (box.weissenberg, box.deborah) == ((1.0, 2.0), (0.25, 0.5))
    assert box.text == "Wi 1 to 2, De 0.25 to 0.5"
    assert box_of([]) is None
