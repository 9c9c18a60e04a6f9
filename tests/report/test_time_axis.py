"""When a picture's axis of time is logarithmic."""

import numpy as np

from discover.report.plots.style import runs_through_decades

DECADES = np.geomspace(1e-3, 60.0, 65)


def test_a_step_whose_measured_rate_rises_is_drawn_through_decades_as_a_start_up_is():
    assert runs_through_decades(DECADES, np.full(65, 10.0))
    assert runs_through_decades(DECADES, 10.0 * (1.0 - np.exp(-DECADES / 2e-3)))


def test_even_samples_of_a_rate_that_changes_are_drawn_in_plain_time():
    even = np.linspace(0.0, 60.0, 601)
    assert not runs_through_decades(even, np.cos(even))
    assert not runs_through_decades(even, 10.0 * (1.0 - np.exp(-even)))
    # and so is what lasts no decade and a half
    assert not runs_through_decades(np.geomspace(1.0, 20.0, 50), np.full(50, 1.0))
