"""Parts of a comparison side by side: what they return, what is told of them, how they end."""

import threading

import pytest

from discover.comparison.hypotheses import at_once
from discover.progress import Stopped, require_wanted, silent


def test_each_part_returns_under_its_name_though_another_ends_first():
    first_may_end = threading.Event()

    def first(say):
        assert first_may_end.wait(30)
        return 1

    def second(say):
        first_may_end.set()
        return 2

    found = at_once({"first": first, "second": second}, silent)
    assert list(found.items()) == [("first", 1), ("second", 2)]


def test_progress_is_told_in_the_thread_of_the_caller_and_never_falls():
    heard = []

    def part(say):
        for fraction in (0.5, 0.2, 1.0):
            say("at work", fraction)

    def hear(text, fraction):
        heard.append((threading.current_thread(), text, fraction))

    at_once({"one": part, "other": part}, hear)
    assert {thread for thread, _, _ in heard} == {threading.current_thread()}
    fractions = [fraction for _, _, fraction in heard]
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0
    assert {text for _, text, _ in heard} == {"one: at work", "other: at work"}


@pytest.mark.parametrize("says", [True, False])
def test_when_one_part_fails_the_others_end_where_they_say_or_ask_something(says):
    ended = []

    def fails(say):
        raise ValueError("no law")

    def goes_on(say):
        try:
            for _ in range(100_000):
                threading.Event().wait(0.001)
                say("at work", 0.0) if says else require_wanted()
        except Stopped:
            ended.append(True)
            raise

    with pytest.raises(ValueError, match="no law"):
        at_once({"goes on": goes_on, "fails": fails}, silent)
    assert ended == [True]


def test_an_interrupt_of_the_caller_ends_all_parts():
    def goes_on(say):
        while True:
            threading.Event().wait(0.001)
            say("at work", 0.0)

    def interrupted(text, fraction):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        at_once({"one": goes_on, "other": goes_on}, interrupted)


def test_a_part_alone_runs_where_it_is_asked_for():
    assert at_once({"one": lambda say: threading.current_thread()}, silent) == {
        "one": threading.current_thread()
    }
    require_wanted()  # nobody asked this thread to stop
