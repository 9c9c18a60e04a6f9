"""A process that makes ever more programs does not fill what the system lets it map."""

import jax.numpy as jnp
import pytest

from discover.programs import compiled, compiler

PIECES = compiler._PIECES
pytestmark = pytest.mark.skipif(not PIECES.is_file(), reason="only Linux limits the pieces")


def pieces():
    return len(PIECES.read_bytes().splitlines())


def make_programs(n):
    @compiled
    def power(x, exponent):
        return jnp.sin(x) ** exponent

    return [float(power(jnp.asarray(0.5), exponent)) for exponent in range(n)]


@pytest.fixture
def limit(tmp_path, monkeypatch):
    file = tmp_path / "max_map_count"
    monkeypatch.setattr(compiler, "_LIMIT", file)
    monkeypatch.setattr(compiler, "_LOOK_EVERY", 10)
    return file


@pytest.mark.slow
def test_programs_make_room_for_others_and_answers_stay(limit):
    limit.write_text(str(10**9))
    before = pieces()
    expected = make_programs(45)
    with_all = pieces()
    assert with_all > before + 30  # or there is nothing to make room for

    limit.write_text(str(before + with_all))  # crowded half way
    assert make_programs(45) == expected
    assert pieces() < with_all


def test_a_process_with_room_keeps_its_programs(limit):
    limit.write_text(str(10**9))
    assert not compiler._is_crowded()
    make_programs(30)
    held = pieces()
    make_programs(5)  # of a function made anew, so programs of its own
    assert pieces() >= held


@pytest.mark.parametrize("text", ["", "many"])
def test_a_limit_that_cannot_be_read_is_none(limit, text):
    limit.write_text(text)
    assert not compiler._is_crowded()
    limit.unlink()
    assert not compiler._is_crowded()
