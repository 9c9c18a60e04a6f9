"""Progress is that of the time a task takes, as far as it is known; what a stop still does."""

import math
import re

import pytest

from discover.batch.run import _DRAWING, _DRAWING_RUN
from discover.loop.search_time import ComparisonTime, SearchTime
from discover.progress import (
    Crowding,
    FollowedBy,
    by_time,
    on_stop,
    run_stop_callbacks,
    slowness,
)


def test_a_search_of_unknown_length_never_goes_back_and_never_ends_before_it_does():
    told, now = [], iter(range(1000))
    say = by_time(lambda text, fraction: told.append(fraction), lambda: next(now))
    for left in (None, 50.0, 90.0, 10.0, None, 30.0):
        say("a line", left)
    assert told == sorted(told)
    assert 0.0 == told[0] < told[-1] < 1.0


# (seconds, line) of closed loops, as recorded on 2 cores, over how crowded they were, up to the
# drawing and to the end; of the likeliest effects with one alone
RECORDED = {
    "gel, 4 runs, at most 5 effects": [
        (2.27, "search among 25 effects"),
        (2.48, "sets of 1: 20 fitted, likeliest: thixotropy"),
        (2.69, "sets of 2: 23 fitted, likeliest: softening_by_work"),
        (2.98, "sets of 3: 22 fitted, likeliest: softening_by_work"),
        (3.87, "sets of 4: 22 fitted, likeliest: softening_by_work"),
        (4.57, "sets of 5: 21 fitted, likeliest: parallel_plates"),
        (5.92, "exchanged: 132 sets, likeliest: parallel_plates"),
        (8.17, "curves of one variable"),
        (8.67, "bands, intervals and the next test"),
        (10.11, "drawing"),
        (11.27, "end"),
    ],
    "polyisoprene melt, 11 runs, at most 5 effects": [
        (0.98, "search among 33 effects"),
        (2.08, "sets of 1: 27 fitted, likeliest: tr(sigma)*sigma.sigma"),
        (2.97, "sets of 2: 16 fitted, likeliest: ptt_linear"),
        (4.27, "sets of 3: 23 fitted, likeliest: ptt_linear"),
        (6.81, "sets of 4: 24 fitted, likeliest: ptt_linear"),
        (8.59, "sets of 5: 23 fitted, likeliest: ptt_linear"),
        (11.29, "exchanged: 146 sets, likeliest: ptt_linear"),
        (18.22, "constants that may differ from mode to mode"),
        (18.29, "search among 33 effects"),
        (18.36, "sets of 1: 2 fitted, likeliest: tr(sigma)*sigma.sigma"),
        (18.77, "sets of 2: 3 fitted, likeliest: ptt_linear"),
        (19.91, "sets of 3: 16 fitted, likeliest: ptt_linear"),
        (22.86, "sets of 4: 22 fitted, likeliest: ptt_linear"),
        (25.58, "sets of 5: 23 fitted, likeliest: ptt_linear"),
        (32.24, "exchanged: 103 sets, likeliest: ptt_linear"),
        (43.27, "curves of one variable"),
        (44.85, "bands, intervals and the next test"),
        (49.12, "drawing"),
        (50.67, "end"),
    ],
    "two-mode PTT, 5 runs, at most 3 effects": [
        (2.20, "search among 87 effects"),
        (2.52, "sets of 1: 79 fitted, likeliest: ptt_linear"),
        (2.67, "sets of 2: 22 fitted, likeliest: ptt_linear"),
        (2.73, "exchanged: 102 sets, likeliest: ptt_linear"),
        (3.23, "constants that may differ from mode to mode"),
        (4.67, "search among 87 effects"),
        (4.71, "sets of 1: 1 fitted, likeliest: ptt_linear"),
        (4.85, "sets of 2: 9 fitted, likeliest: ptt_linear"),
        (4.90, "exchanged: 10 sets, likeliest: ptt_linear"),
        (4.97, "curves of one variable"),
        (5.17, "bands, intervals and the next test"),
        (6.74, "drawing"),
        (8.39, "end"),
    ],
    "LDPE, 13 runs, at most 3 effects": [
        (0.80, "search among 87 effects"),
        (1.74, "sets of 1: 72 fitted, likeliest: ptt_linear"),
        (2.43, "sets of 2: 24 fitted, likeliest: ptt_linear"),
        (3.10, "sets of 3: 24 fitted, likeliest: ptt_linear"),
        (3.87, "exchanged: 131 sets, likeliest: ptt_linear"),
        (7.29, "constants that may differ from mode to mode"),
        (7.37, "search among 87 effects"),
        (7.52, "sets of 1: 2 fitted, likeliest: strain_damping"),
        (8.13, "sets of 2: 16 fitted, likeliest: strain_damping"),
        (9.38, "sets of 3: 24 fitted, likeliest: edge_fracture"),
        (11.25, "exchanged: 62 sets, likeliest: convective_constraint_release"),
        (11.40, "curves of one variable"),
        (11.98, "bands, intervals and the next test"),
        (13.88, "drawing"),
        (15.56, "end"),
    ],
    "blood, 6 runs, one mode and none held out, at most 3 effects": [
        (3.36, "search among 10 effects"),
        (5.46, "sets of 1: 10 fitted"),
        (8.14, "sets of 2: 22 fitted"),
        (12.06, "sets of 3: 19 fitted"),
        (17.11, "exchanged: 68 sets"),
        (19.30, "curves of one variable"),
        (19.30, "bands, intervals and the next test"),
        (23.74, "drawing"),
        (25.02, "end"),
    ],
}  # fmt: skip


@pytest.mark.parametrize("crowding", [1.0, 8.0])
@pytest.mark.parametrize("name", RECORDED)
def test_the_bar_of_recorded_loops_is_off_by_an_eighth_at_most_and_the_time_left_by_1_65(
    name, crowding
):
    now, told, checked = 0.0, [], 0
    runs = int(re.search(r"(\d+) runs", name)[1])
    without = "none held out" in name
    measured = {"clock": lambda: now, "crowding": lambda: crowding}
    drawing = _DRAWING["close-loop"] + _DRAWING_RUN * runs
    whole = FollowedBy(lambda text, fraction: told.append(fraction), drawing, *measured.values())
    say = by_time(whole, measured["clock"])
    search = SearchTime(
        int(name[-9]), "one mode" not in name, 1, not without, "gel" not in name and not without,
        compiled=lambda: 1.0, **measured,
    )  # fmt: skip
    record = [(crowding * at, line) for at, line in RECORDED[name]]
    end = record[-1][0]
    for now, line in record[:-1]:  # the clock reads it
        whole(line, 1.0) if line == "drawing" else say(line, search.heard(line))
        if told[-1]:
            passed = now / end
            assert abs(told[-1] - passed) < 0.12, line
            # what is left follows from little while little has passed
            left = passed * (1.0 - told[-1]) / told[-1]
            assert passed < 0.1 or abs(math.log(left / (1.0 - passed))) < math.log(1.65), line
            checked += passed > 0.1
    assert told == sorted(told)
    assert checked >= len(RECORDED[name]) // 2


# the same of the demonstration's comparison, with programs that were kept and that were compiled
DEMO = {
    0.0: [(0.2, "searching", "search among 32 effects"),
          (0.3, "searching", "sets of 1: 25 fitted, likeliest: giesekus_mobility"),
          (0.4, "searching", "sets of 2: 24 fitted, likeliest: giesekus_mobility"),
          (0.5, "searching", "exchanged: 51 sets, likeliest: giesekus_mobility"),
          (1.2, "learning"),
          (1.2, "learned", "starting", 0.0),
          (2.5, "weighing", "weighing what was found"),
          (3.4, "drawing"),
          (4.8, "end")],
    1.0: [(2.2, "searching", "search among 32 effects"),
          (2.3, "searching", "sets of 1: 25 fitted, likeliest: giesekus_mobility"),
          (2.5, "searching", "sets of 2: 24 fitted, likeliest: giesekus_mobility"),
          (2.6, "searching", "exchanged: 51 sets, likeliest: giesekus_mobility"),
          (3.9, "learning"),
          (3.9, "learned", "starting", 0.0),
          (14.3, "weighing", "weighing what was found"),
          (17.2, "drawing"),
          (19.5, "end")],
}  # fmt: skip


@pytest.mark.parametrize("crowding", [1.0, 8.0])
@pytest.mark.parametrize("compiled", DEMO)
def test_the_time_left_of_a_comparison_is_right_whether_it_compiles_or_not(compiled, crowding):
    now, told = 0.0, []

    def clock():
        return now

    whole = FollowedBy(
        lambda text, fraction: told.append(fraction),
        _DRAWING["compare"],
        clock,
        lambda: crowding,
    )
    times = ComparisonTime(whole, 3, False, False, clock, lambda: crowding, lambda: compiled)
    end = crowding * DEMO[compiled][-1][0]
    for at, what, *said in DEMO[compiled][:-1]:
        now = crowding * at  # the clock reads it
        if what == "drawing":
            whole("", 1.0)
        else:
            getattr(times, what)(*said)
        if now > 0.1 * end and told[-1] and what != "learning":
            left = now * (1.0 - told[-1]) / told[-1]
            assert 1.0 / 1.5 < left / (end - now) < 1.5, (what, said)


def test_a_part_that_follows_counts_from_the_beginning_and_never_goes_back():
    now, told = 0.0, []
    whole = FollowedBy(lambda text, fraction: told.append(fraction), 10.0, lambda: now, lambda: 1.0)
    now = 30.0
    whole("done", 1.0)
    assert told[-1] == pytest.approx(0.75)
    whole.expect(0.0)
    say = by_time(FollowedBy(whole, 2.0, lambda: now, lambda: 1.0), lambda: now)
    say("loading", None)
    assert told[-1] == pytest.approx(0.75)
    now = 36.0
    say("half", 2.0)
    assert told[-1] == pytest.approx(36.0 / 40.0)


def test_a_machine_is_as_crowded_as_its_processor_is_late():
    now, worked = 10.0, 3.0
    crowding = Crowding(lambda: now, lambda: worked, lambda: 1.0)
    now, worked = 11.0, 3.1
    assert crowding() == 1.0  # too early to tell
    now, worked = 30.0, 7.0
    assert crowding() == pytest.approx(5.0)
    worked = 43.0  # several cores
    assert crowding() == 1.0


def test_rounds_that_leave_a_run_out_each_take_as_long_as_the_first():
    now = 0.0
    search = SearchTime(
        1, False, rounds=3, clock=lambda: now, crowding=lambda: 1.0, compiled=lambda: 1.0
    )
    # 8 fits a second, of one effect 6.7, none exchanged; then 175 fits, 2 and 0.1 s, 70 and 1.3 s
    round_ = [(0.0, "search among 400 effects"), (60.0, "sets of 1: 400 fitted"),
              (60.0, "exchanged: 400 sets"), (81.9, "curves of one variable"),
              (82.2, "bands, intervals and the next test")]  # fmt: skip
    for begins in (0.0, 92.3, 184.6):
        for after, line in round_:
            now = begins + after
            left = search.heard(f"without a: {line}")
            if after:
                assert left == pytest.approx(276.9 - now, rel=0.2), (begins, line)


def test_programs_that_have_to_be_compiled_take_further_seconds_besides_fits():
    def left(compiled):
        now = 0.0
        search = SearchTime(
            1, False, clock=lambda: now, crowding=lambda: 1.0, compiled=lambda: compiled
        )
        search.heard("search among 400 effects")
        now = 40.0
        return search.heard("sets of 1: 400 fitted")

    assert left(1.0) - left(0.0) == pytest.approx(1.2)  # of bands


def test_a_slow_machine_takes_longer_for_what_was_measured_on_another():
    crowding = Crowding(lambda: 10.0, lambda: 3.0, lambda: 2.5)
    assert crowding() == 2.5
    assert 0.1 < slowness() < 100.0  # of this machine


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
