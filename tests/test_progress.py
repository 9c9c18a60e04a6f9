"""Progress is that of the time a task takes, as far as it is known."""

import pytest

from discover.progress import by_shares, by_stages


def test_each_part_of_a_task_moves_on_by_its_share():
    told = []
    part = by_shares(lambda text, fraction: told.append(fraction), {"a": 1.0, "b": 3.0})
    part("a")("", 0.0), part("a")("", 1.0), part("b")("", 0.5), part("b")("", 1.0)
    assert told == pytest.approx([0.0, 0.25, 0.625, 1.0])


@pytest.mark.parametrize("rounds", [1, 3])
def test_searches_of_unknown_length_never_go_back_and_never_end_before_they_do(rounds):
    told = []
    say = by_stages(lambda text, fraction: told.append(fraction), rounds)
    for search in ("all runs", "without a", "without b")[:rounds]:
        for _ in range(8):
            say(f"{search}: a line")
    assert told == sorted(told)
    assert told[-1] == 0.95
    assert told[0] == pytest.approx(0.25 / rounds)


# (share of the time that had passed, line) of two closed loops, as recorded; the first is the
# demonstration's, the other one with all candidates
RECORDED = {
    "demo": [(0.323, "declared"), (0.580, "stage"), (0.667, "drawing")],
    "all candidates": [(0.154, "declared"), (0.594, "stage"), (0.648, "end"), (0.742, "drawing")],
}


@pytest.mark.parametrize("name", RECORDED)
def test_the_time_left_of_recorded_loops_is_right_within_a_factor_of_1_7(name):
    from discover.batch.run import _LOOP_SHARES

    told = []
    part = by_shares(lambda text, fraction: told.append(fraction), _LOOP_SHARES)
    say = by_stages(part("search"))
    for passed, line in RECORDED[name]:
        part("drawing")(line, 0.0) if line == "drawing" else say(line)
        left = passed * (1.0 - told[-1]) / told[-1]
        assert 1.0 / 1.7 < left / (1.0 - passed) < 1.7, line
