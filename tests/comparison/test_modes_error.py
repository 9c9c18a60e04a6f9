"""Intervals beside modes that a noisy sweep gave: what is said, on a path written by hand."""

from discover.comparison.judging.constants.modes_error import left_open_by_modes

PATH = [
    {"size": 0, "misfit": 1.0},
    {"size": 1, "misfit": 0.00284},
    {"size": 2, "misfit": 0.00276},
]


def test_a_term_that_changes_less_than_the_modes_err_is_said_not_to_be_told_from_them():
    said = left_open_by_modes(PATH, 2, 0.00276, 0.01)
    # √(0.284² − 0.276²) = 0.067
    assert "the best law of one term fits worse by 0.067 % of the data" in said
    assert said.endswith("these data cannot tell the two apart.")


def test_a_term_that_changes_more_stands_and_the_intervals_are_told_all_the_same():
    said = left_open_by_modes(PATH, 2, 0.00276, 0.0005)
    assert said == (
        "The modes miss the sweep by 0.05 %, which intervals and bands of the sparse law allow for."
    )
    beside = left_open_by_modes(PATH, 2, 0.00276, 0.0005, network=True)
    assert beside.endswith("allow for and those of the network do not.")
    # one term alone: no law is no explanation
    assert "cannot tell" not in left_open_by_modes(PATH, 1, 0.00284, 0.01)


def test_modes_that_are_declared_or_exact_beside_the_noise_need_no_word():
    assert left_open_by_modes(PATH, 2, 0.00276, 0.0) == ""
    assert left_open_by_modes(PATH, 2, 0.00276, 0.0001) == ""
    assert left_open_by_modes(PATH[:1], 0, 1.0, 0.01) == ""
