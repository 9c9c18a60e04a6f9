"""What is still done when a program is told to stop."""

from discover.last_words import last_words, say_last_words


def test_last_words_are_said_backwards_and_one_that_fails_stops_none():
    said = []

    def fail():
        raise OSError("the disk is full")

    with (
        last_words(lambda: said.append("first")),
        last_words(fail),
        last_words(lambda: said.append("last")),
    ):
        say_last_words()
    assert said == ["last", "first"]


def test_what_ended_by_itself_has_no_last_words():
    said = []
    with last_words(lambda: said.append("too late")):
        pass
    say_last_words()
    assert said == []
