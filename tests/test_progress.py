"""Progress is that of the time a task takes, as far as it is known; what a stop still does."""

import csv
import math
import re
from pathlib import Path

import pytest

from discover.batch.run import _DRAWING, _DRAWING_RUN
from discover.loop.search_time import ComparisonTime, SearchTime
from discover.progress import Crowding, FollowedBy, by_time, on_stop, run_stop_callbacks


def test_a_search_of_unknown_length_never_goes_back_and_never_ends_before_it_does():
    told, now = [], iter(range(1000))
    say = by_time(lambda text, fraction: told.append(fraction), lambda: next(now))
    for left in (None, 50.0, 90.0, 10.0, None, 30.0):
        say("a line", left)
    assert told == sorted(told)
    assert 0.0 == told[0] < told[-1] < 1.0


# (seconds, line) of closed loops, as recorded on 2 cores, over how crowded they were, up to the
# drawing and to the end; of the likeliest effects with one alone
RECORDED: dict[str, list[tuple[float, str]]] = {}
with Path(__file__).with_name("recorded_loops.csv").open(encoding="utf-8", newline="") as _file:
    for _row in csv.DictReader(_file):
        RECORDED.setdefault(_row["loop"], []).append((float(_row["seconds"]), _row["line"]))


@pytest.mark.parametrize("crowding", [1.0, 8.0])
@pytest.mark.parametrize("name", RECORDED)
def test_the_bar_of_recorded_loops_is_off_by_an_eighth_and_time_left_by_1_65(name, crowding):
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


# the same of the demonstration's comparison: seconds with programs that were kept, and compiled
DEMO = [
    (0.2, 2.2, "searching", "search among 32 effects"),
    (0.3, 2.3, "searching", "sets of 1: 25 fitted, likeliest: giesekus_mobility"),
    (0.4, 2.5, "searching", "sets of 2: 24 fitted, likeliest: giesekus_mobility"),
    (0.5, 2.6, "searching", "exchanged: 51 sets, likeliest: giesekus_mobility"),
    (1.2, 3.9, "learning"),
    (1.2, 3.9, "learned", "starting", 0.0),
    (2.5, 14.3, "weighing", "weighing what was found"),
    (3.4, 17.2, "drawing"),
    (4.8, 19.5, "end"),
]


@pytest.mark.parametrize("crowding", [1.0, 8.0])
@pytest.mark.parametrize("compiled", [0, 1])
def test_the_time_left_of_a_comparison_is_right_whether_it_compiles_or_not(compiled, crowding):
    now, told = 0.0, []

    def clock():
        return now

    whole = FollowedBy(
        lambda text, fraction: told.append(fraction), _DRAWING["compare"], clock, lambda: crowding
    )
    searches = SearchTime(
        3, False, held_out=False, reported=False, clock=clock, crowding=lambda: crowding,
        compiled=lambda: float(compiled),
    )  # fmt: skip
    times = ComparisonTime(whole, searches)
    end = crowding * DEMO[-1][compiled]
    for kept, made, what, *said in DEMO[:-1]:
        now = crowding * (kept, made)[compiled]  # the clock reads it
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
    crowding = Crowding(lambda: now, lambda: worked)
    now, worked = 11.0, 3.1
    assert crowding() == 1.0  # too early to tell
    now, worked = 30.0, 7.0
    assert crowding() == pytest.approx(5.0)
    worked = 43.0  # several cores
    assert crowding() == 1.0


def test_rounds_take_as_long_as_the_first_and_programs_to_compile_further_seconds():
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

    def left(compiled):
        now = 0.0
        search = SearchTime(
            1, False, clock=lambda: now, crowding=lambda: 1.0, compiled=lambda: compiled
        )
        search.heard("search among 400 effects")
        now = 40.0
        return search.heard("sets of 1: 400 fitted")

    assert left(1.0) - left(0.0) == pytest.approx(1.2)  # of bands


def test_last_words_are_said_backwards_past_a_failure_and_none_after_an_end():
    said = []

    def fail():
        raise OSError("the disk is full")

    with on_stop(lambda: said.append("first")), on_stop(fail), on_stop(lambda: said.append("last")):
        run_stop_callbacks()
    assert said == ["last", "first"]
    said = []
    with on_stop(lambda: said.append("too late")):
        pass
    run_stop_callbacks()
    assert said == []
