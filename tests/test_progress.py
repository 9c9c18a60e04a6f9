"""Progress is that of the time a task takes, as far as it is known; what a stop still does."""

import pytest

from discover.batch.run import _DRAWING
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


SLOW = 2.5
"""Time that the machine of these records took for its pictures, over that of the reference."""

# (seconds of the processor, line) of closed loops, as recorded on 2 cores, up to the drawing and to
# the end; without lines that hold no number, and of the likeliest effects with some alone
RECORDED = {
    "gel, at most 5 effects": [
        (2.88, "search among 24 effects"),
        (3.62, "sets of 1: 20 fitted, likeliest: thixotropy"),
        (4.62, "sets of 2: 22 fitted, likeliest: instrument_inertia, thixotropy"),
        (5.69, "sets of 3: 23 fitted, likeliest: bearing_friction, thixotropy"),
        (6.96, "sets of 4: 21 fitted, likeliest: thixotropy, transducer_lag"),
        (8.17, "sets of 5: 21 fitted, likeliest: thixotropy, wall_slip"),
        (13.61, "exchanged: 167 sets"),
        (18.16, "curves of one variable"),
        (21.61, "bands, intervals and the next test"),
        (27.34, "drawing"),
        (29.52, "end"),
    ],
    "polyisoprene melt, at most 5 effects": [
        (1.13, "search among 32 effects"),
        (6.24, "sets of 1: 26 fitted, likeliest: ptt_linear"),
        (14.47, "sets of 2: 23 fitted, likeliest: ptt_linear"),
        (21.68, "sets of 3: 24 fitted, likeliest: ptt_linear"),
        (28.36, "sets of 4: 24 fitted, likeliest: ptt_linear"),
        (34.99, "sets of 5: 23 fitted, likeliest: ptt_linear"),
        (56.42, "exchanged: 172 sets, likeliest: ptt_linear"),
        (81.33, "constants that may differ from mode to mode"),
        (85.45, "search among 32 effects"),
        (91.32, "sets of 1: 26 fitted, likeliest: ptt_linear"),
        (96.67, "sets of 2: 23 fitted, likeliest: ptt_linear"),
        (103.20, "sets of 3: 23 fitted, likeliest: ptt_linear"),
        (110.05, "sets of 4: 24 fitted, likeliest: ptt_linear"),
        (117.03, "sets of 5: 23 fitted, likeliest: ptt_linear"),
        (131.22, "exchanged: 152 sets, likeliest: ptt_linear"),
        (186.99, "curves of one variable"),
        (197.75, "bands, intervals and the next test"),
        (212.88, "drawing"),
        (216.59, "end"),
    ],
    "two-mode PTT, at most 3 effects": [
        (2.77, "search among 86 effects"),
        (4.78, "sets of 1: 83 fitted, likeliest: ptt_linear"),
        (5.62, "sets of 2: 22 fitted, likeliest: ptt_linear"),
        (6.19, "exchanged: 106 sets"),
        (10.87, "constants that may differ from mode to mode"),
        (13.12, "search among 86 effects"),
        (15.12, "sets of 1: 83 fitted, likeliest: ptt_linear"),
        (16.08, "sets of 2: 22 fitted, likeliest: ptt_linear"),
        (16.68, "exchanged: 106 sets"),
        (21.82, "curves of one variable"),
        (27.29, "bands, intervals and the next test"),
        (38.14, "drawing"),
        (40.99, "end"),
    ],
    "LDPE, at most 3 effects": [
        (3.11, "search among 86 effects"),
        (12.51, "sets of 1: 70 fitted, likeliest: ptt_linear"),
        (18.14, "sets of 2: 23 fitted, likeliest: ptt_linear, strain_damping"),
        (23.46, "sets of 3: 24 fitted, likeliest: edge_fracture, ptt_linear"),
        (29.42, "exchanged: 132 sets, likeliest: edge_fracture, ptt_linear"),
        (64.57, "constants that may differ from mode to mode"),
        (68.76, "search among 86 effects"),
        (76.45, "sets of 1: 70 fitted, likeliest: strain_damping"),
        (80.84, "sets of 2: 22 fitted, likeliest: convective_constraint_release, strain_damping"),
        (86.42, "sets of 3: 23 fitted, likeliest: convective_constraint_release, strain_damping"),
        (94.00, "exchanged: 129 sets, likeliest: convective_constraint_release, thixotropy"),
        (149.94, "curves of one variable"),
        (170.24, "bands, intervals and the next test"),
        (178.84, "drawing"),
        (182.52, "end"),
    ],
    "blood, one mode and none held out, at most 3 effects": [
        (8.39, "search among 10 effects"),
        (13.66, "sets of 1: 10 fitted"),
        (20.34, "sets of 2: 22 fitted"),
        (30.15, "sets of 3: 19 fitted"),
        (42.78, "exchanged: 68 sets"),
        (48.25, "curves of one variable"),
        (48.25, "bands, intervals and the next test"),
        (59.34, "drawing"),
        (62.56, "end"),
    ],
}  # fmt: skip


@pytest.mark.parametrize("crowding", [1.0, 8.0])
@pytest.mark.parametrize("name", RECORDED)
def test_the_time_left_of_recorded_loops_is_right_within_a_factor_of_1_5_from_a_tenth_on(
    name, crowding
):
    now, told = 0.0, []

    def clock():
        return now

    def slow():
        return SLOW * crowding

    whole = FollowedBy(lambda text, fraction: told.append(fraction), 1.1, clock, slow)
    say = by_time(whole, clock)
    without = "none held out" in name
    search = SearchTime(
        int(name[-9]), "one mode" not in name, 1, not without, "gel" not in name and not without,
        clock=clock, crowding=slow, compiled=lambda: 1.0,
    )  # fmt: skip
    record = [(crowding * at, line) for at, line in RECORDED[name]]
    end, checked = record[-1][0], 0
    for now, line in record[:-1]:  # the clock reads it
        whole(line, 1.0) if line == "drawing" else say(line, search.heard(line))
        if told[-1] and now > 0.1 * end:
            left = now * (1.0 - told[-1]) / told[-1]
            assert 1.0 / 1.5 < left / (end - now) < 1.5, line
            checked += 1
    assert told == sorted(told)
    assert checked >= len(RECORDED[name]) // 2


# the same of the demonstration's comparison, with programs that were kept and that were compiled
DEMO = {
    0.0: [(0.4, "searching", "search among 31 effects"),
          (0.8, "searching", "sets of 1: 24 fitted, likeliest: giesekus_mobility"),
          (1.1, "searching", "sets of 2: 24 fitted, likeliest: giesekus_mobility"),
          (1.3, "searching", "exchanged: 50 sets, likeliest: giesekus_mobility"),
          (2.4, "learning"), (2.6, "learned", "starting", 0.0),
          (6.3, "weighing", "weighing what was found"), (11.0, "drawing"), (19.2, "end")],
    1.0: [(8.1, "searching", "search among 31 effects"),
          (8.4, "searching", "sets of 1: 24 fitted, likeliest: giesekus_mobility"),
          (8.6, "searching", "sets of 2: 24 fitted, likeliest: giesekus_mobility"),
          (8.8, "searching", "exchanged: 50 sets, likeliest: giesekus_mobility"),
          (9.6, "learning"), (9.9, "learned", "starting", 0.0),
          (33.7, "weighing", "weighing what was found"), (52.5, "drawing"), (61.7, "end")],
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
        lambda: SLOW * crowding,
    )
    times = ComparisonTime(whole, 3, False, False, clock, lambda: SLOW * crowding, lambda: compiled)
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
    # 8 fits a second, of one effect 10, none exchanged; then 140 fits, 20 and 1.5 s, 15 and 3 s
    round_ = [(0.0, "search among 400 effects"), (40.0, "sets of 1: 400 fitted"),
              (40.0, "exchanged: 400 sets"), (57.5, "curves of one variable"),
              (61.5, "bands, intervals and the next test")]  # fmt: skip
    for begins in (0.0, 66.4, 132.8):
        for after, line in round_:
            now = begins + after
            left = search.heard(f"without a: {line}")
            if after:
                assert left == pytest.approx(199.2 - now, rel=0.2), (begins, line)


def test_programs_that_have_to_be_compiled_take_further_seconds_besides_fits():
    def left(compiled):
        now = 0.0
        search = SearchTime(
            1, False, clock=lambda: now, crowding=lambda: 1.0, compiled=lambda: compiled
        )
        search.heard("search among 400 effects")
        now = 40.0
        return search.heard("sets of 1: 400 fitted")

    assert left(1.0) - left(0.0) == pytest.approx(3.7)  # 1.2 of curves and 2.5 of bands


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
