"""Progress is that of the time a task takes, as far as it is known; what a stop still does."""

import pytest

from discover.loop.search_time import SearchTime
from discover.progress import FollowedBy, by_shares, by_time, on_stop, run_stop_callbacks


def test_each_part_of_a_task_moves_on_by_its_share():
    told = []
    part = by_shares(lambda text, fraction: told.append(fraction), {"a": 1.0, "b": 3.0})
    part("a")("", 0.0), part("a")("", 1.0), part("b")("", 0.5), part("b")("", 1.0)
    assert told == pytest.approx([0.0, 0.25, 0.625, 1.0])


def test_a_search_of_unknown_length_never_goes_back_and_never_ends_before_it_does():
    told, now = [], iter(range(1000))
    say = by_time(lambda text, fraction: told.append(fraction), lambda: next(now))
    for left in (None, 50.0, 90.0, 10.0, None, 30.0):
        say("a line", left)
    assert told == sorted(told)
    assert 0.0 == told[0] < told[-1] < 1.0


# (seconds of the processor, line) of closed loops, as recorded on 2 cores, up to the drawing and to
# the end; without lines that hold no number
RECORDED = {
    "gel, at most 5 effects": [
        (0.67, "search among 24 effects"), (1.21, "sets of 1: 20 fitted"),
        (2.13, "sets of 2: 22 fitted"), (3.01, "sets of 3: 23 fitted"),
        (3.91, "sets of 4: 21 fitted"), (5.03, "sets of 5: 21 fitted"),
        (8.28, "exchanged: 157 sets"), (10.93, "constants that may differ from mode to mode"),
        (14.52, "search among 24 effects"), (15.08, "sets of 1: 20 fitted"),
        (16.03, "sets of 2: 22 fitted"), (17.02, "sets of 3: 23 fitted"),
        (17.97, "sets of 4: 21 fitted"), (19.14, "sets of 5: 21 fitted"),
        (22.60, "exchanged: 157 sets"), (25.40, "curves of one variable"),
        (26.95, "bands, intervals and the next test"), (28.74, "drawing"), (31.05, "end"),
    ],
    "LDPE, at most 3 effects": [
        (2.61, "search among 86 effects"), (17.24, "sets of 1: 70 fitted"),
        (21.38, "sets of 2: 23 fitted"), (25.37, "sets of 3: 24 fitted"),
        (30.21, "exchanged: 133 sets"), (51.28, "constants that may differ from mode to mode"),
        (55.62, "search among 86 effects"), (72.12, "sets of 1: 70 fitted"),
        (79.55, "sets of 2: 24 fitted"), (88.35, "sets of 3: 24 fitted"),
        (96.07, "exchanged: 134 sets"), (127.87, "curves of one variable"),
        (136.27, "bands, intervals and the next test"), (141.83, "drawing"), (145.41, "end"),
    ],
    # wall-clock seconds of a busy machine, one mode
    "blood, one mode and seven effects, at most 2 effects": [
        (24.8, "search among 7 effects"), (67.8, "sets of 1: 7 fitted"),
        (154.4, "sets of 2: 15 fitted"), (228.5, "exchanged: 26 sets"),
        (405.4, "curves of one variable"), (513.9, "bands, intervals and the next test"),
        (665.3, "end"),
    ],
}  # fmt: skip


@pytest.mark.parametrize("name", RECORDED)
def test_the_time_left_of_recorded_loops_is_right_within_a_factor_of_1_5_from_a_tenth_on(name):
    now, told = 0.0, []

    def clock():
        return now

    whole = FollowedBy(lambda text, fraction: told.append(fraction), 2.5, clock)
    say = by_time(whole, clock)
    search = SearchTime(int(name[-9]), "one mode" not in name, clock=clock)
    end, checked = RECORDED[name][-1][0], 0
    for now, line in RECORDED[name][:-1]:  # the clock reads it
        whole(line, 1.0) if line == "drawing" else say(line, search.heard(line))
        if now > 0.1 * end:
            left = now * (1.0 - told[-1]) / told[-1]
            assert 1.0 / 1.5 < left / (end - now) < 1.5, line
            checked += 1
    assert told == sorted(told)
    assert checked > (10 if len(RECORDED[name]) > 10 else 4)


def test_rounds_that_leave_a_run_out_each_take_as_long_as_the_first():
    now = 0.0
    search = SearchTime(1, False, rounds=3, clock=lambda: now)
    # ten fits a second, none exchanged; 90, 38 and 40 fits follow
    round_ = [(0.0, "search among 400 effects"), (40.0, "sets of 1: 400 fitted"),
              (40.0, "exchanged: 400 sets"), (49.0, "curves of one variable"),
              (52.8, "bands, intervals and the next test")]  # fmt: skip
    for begins in (0.0, 56.8, 113.6):
        for after, line in round_:
            now = begins + after
            left = search.heard(f"without a: {line}")
            if after:
                assert left == pytest.approx(170.4 - now, rel=0.2), (begins, line)


def test_last_words_are_said_backwards_and_one_that_fails_stops_none():
    said = []

    def fail():
        raise OSError("the disk is full")

    with on_stop(lambda: said.append("first")), on_stop(fail), on_stop(lambda: said.append("last")):
        run_stop_callbacks()
    assert said == ["last", "first"]


def test_what_ended_by_itself_has_no_last_words():
    said = []
    with on_stop(lambda: said.append("too late")):
        pass
    run_stop_callbacks()
    assert said == []
