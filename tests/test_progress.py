"""Progress is that of the time a task takes, as far as it is known; what a stop still does."""

import pytest

from discover.batch.run import _DRAWING
from discover.loop.search_progress import ComparisonProgress, SearchProgress
from discover.progress import FollowedBy, on_stop, rising, run_stop_callbacks, slowness

ABOUT_TWO = 2.2
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
def test_the_time_left_of_recorded_loops_is_told_within_a_factor_of_two_from_a_tenth_on(
    name, crowding
):
    now, told = 0.0, []
    whole = FollowedBy(
        lambda text, fraction: told.append(fraction), 1.1, lambda: now, lambda: SLOW * crowding
    )
    say = rising(whole)
    search = SearchProgress(int(name[-9]), "one mode" not in name)
    record = [(crowding * at, line) for at, line in RECORDED[name]]
    end, checked = record[-1][0], 0
    for now, line in record[:-1]:  # the clock reads it
        whole(line, 1.0) if line == "drawing" else say(line, search.heard(line))
        if now > 0.1 * end:
            left = now * (1.0 - told[-1]) / told[-1]
            assert 1.0 / ABOUT_TWO < left / (end - now) < ABOUT_TWO, line
            checked += 1
    assert told == sorted(told)
    assert checked >= len(RECORDED[name]) // 2


# the same of the demonstration's comparison, with programs that were kept and that were compiled
DEMO = {
    0.0: [(0.4, "searching", "search among 31 effects"),
          (0.8, "searching", "sets of 1: 24 fitted, likeliest: giesekus_mobility"),
          (1.1, "searching", "sets of 2: 24 fitted, likeliest: giesekus_mobility"),
          (1.3, "searching", "exchanged: 50 sets, likeliest: giesekus_mobility"),
          (2.6, "learned", "starting", 0.0),
          (6.3, "weighing", "weighing what was found"), (11.0, "drawing"), (19.2, "end")],
    1.0: [(8.1, "searching", "search among 31 effects"),
          (8.4, "searching", "sets of 1: 24 fitted, likeliest: giesekus_mobility"),
          (8.6, "searching", "sets of 2: 24 fitted, likeliest: giesekus_mobility"),
          (8.8, "searching", "exchanged: 50 sets, likeliest: giesekus_mobility"),
          (9.9, "learned", "starting", 0.0),
          (33.7, "weighing", "weighing what was found"), (52.5, "drawing"), (61.7, "end")],
}  # fmt: skip


@pytest.mark.parametrize("crowding", [1.0, 8.0])
@pytest.mark.parametrize("compiled", DEMO)
def test_the_time_left_of_a_comparison_is_about_right_whether_it_compiles_or_not(
    compiled, crowding
):
    now, told = 0.0, []
    whole = FollowedBy(
        lambda text, fraction: told.append(fraction), _DRAWING["compare"], lambda: now,
        lambda: SLOW * crowding,
    )  # fmt: skip
    done = ComparisonProgress(whole, 3, False)
    end = crowding * DEMO[compiled][-1][0]
    for at, what, *said in DEMO[compiled][:-1]:
        now = crowding * at  # the clock reads it
        if what == "drawing":
            whole("", 1.0)
        else:
            getattr(done, what)(*said)
        if now > 0.1 * end:
            left = now * (1.0 - told[-1]) / told[-1]
            assert 1.0 / ABOUT_TWO < left / (end - now) < ABOUT_TWO, (what, said)


def test_a_part_that_follows_counts_on_from_what_was_done_and_never_goes_back():
    now, told = 0.0, []
    whole = FollowedBy(lambda text, fraction: told.append(fraction), 10.0, lambda: now, lambda: 1.0)
    now = 30.0
    whole("done", 1.0)
    assert told[-1] == pytest.approx(0.75)
    whole.expect(0.0)
    say = FollowedBy(whole, 2.0, lambda: now, lambda: 1.0)
    say("loading", 0.0)
    assert told[-1] == pytest.approx(0.75)
    now = 36.0
    say("half", 0.5)  # of 12 s, after which others take 2 s
    assert told[-1] == pytest.approx(0.75 + 0.25 * 6.0 / 14.0)
    say("less", 0.4)
    assert told == sorted(told)


@pytest.mark.parametrize("laws", [[], ["law 1 of 2: ucm", "sets of 1: 4 fitted", "law 2 of 2: x"]])
def test_rounds_that_leave_a_run_out_are_equal_parts(laws):
    search = SearchProgress(1, False, rounds=2)
    lines = [*laws, "search among 4 effects", "sets of 1: 4 fitted", "exchanged: 4 sets", "bands"]
    assert search.heard("yield stress, viscous fluid or solid") == 0.0
    first, second = ([search.heard(f"without a: {line}") for line in lines] for _ in range(2))
    assert first == sorted(first)
    assert 0.0 == sum(first[: len(laws)]) < first[len(laws)] < first[-1] < 0.5
    assert second == pytest.approx([0.5 + share for share in first])


def test_a_slow_machine_takes_longer_for_what_was_measured_on_another():
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
