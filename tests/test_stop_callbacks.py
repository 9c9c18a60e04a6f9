"""What is still done when a program is told to stop."""

from discover.progress import on_stop, run_stop_callbacks


def test_last_words_are_said_backwards_and_one_that_fails_stops_none():
    said = []

    def fail():
        raise OSError("the disk is full")

    with (
        on_stop(lambda: said.append("first")),
        on_stop(fail),
        on_stop(lambda: said.append("last")),
    ):
        run_stop_callbacks()
    assert said == ["last", "first"]


def test_what_ended_by_itself_has_no_last_words():
    said = []
    with on_stop(lambda: said.append("too late")):
        pass
    run_stop_callbacks()
    assert said == []
