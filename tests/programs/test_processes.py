"""Programs in a process: the pieces that it may map, threads, and loops that are one piece."""

import os
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from discover.programs import compiled, compiler, in_threads
from discover.programs.compiler import _compiled_soon, _whole_loops

PIECES = compiler._PIECES
of_linux = pytest.mark.skipif(not PIECES.is_file(), reason="only Linux limits the pieces")


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


@of_linux
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


@of_linux
def test_a_process_with_room_keeps_its_programs(limit):
    limit.write_text(str(10**9))
    assert not compiler._is_crowded()
    make_programs(30)
    held = pieces()
    make_programs(5)  # of a function made anew, so programs of its own
    assert pieces() >= held


@of_linux
@pytest.mark.parametrize("text", ["", "many"])
def test_a_limit_that_cannot_be_read_is_none(limit, text):
    limit.write_text(text)
    assert not compiler._is_crowded()
    limit.unlink()
    assert not compiler._is_crowded()


@pytest.fixture
def with_threads(monkeypatch):
    monkeypatch.setattr(compiler, "ThreadPoolExecutor", ThreadPoolExecutor)
    monkeypatch.setattr(compiler, "_WORKERS", 2)
    compiler._pool.cache_clear()
    yield
    compiler._pool.cache_clear()


@pytest.mark.usefixtures("with_threads")
@pytest.mark.parametrize("is_compiled", [False, True])
def test_what_comes_back_is_in_the_order_of_the_jobs(is_compiled):
    assert in_threads(lambda job: 10 * job, range(7), is_compiled) == [*range(0, 70, 10)]
    assert in_threads(lambda job: job, [], is_compiled) == []


@pytest.mark.usefixtures("with_threads")
def test_two_calls_of_a_compiled_program_run_at_once():
    both = threading.Barrier(2)
    # each waits for the other; one after the other would end in an error
    assert in_threads(lambda job: both.wait(30.0) in (0, 1), range(2), True) == [True, True]


@pytest.mark.usefixtures("with_threads")
def test_what_numpy_is_told_of_overflows_holds_in_threads_and_nowhere_else(recwarn):
    jobs = [np.array([1e300])] * 3
    with np.errstate(over="ignore"):
        assert np.all(np.isinf(in_threads(lambda job: job * job, jobs, is_compiled=True)))
    assert not recwarn
    # control: where it is told nothing, threads warn
    in_threads(lambda job: job * job, jobs, is_compiled=True)
    assert any("overflow" in str(one.message) for one in recwarn)


LOOP = """
import discover.compilation_cache
import jax, jax.numpy as jnp, os
def steps(state):
    return jax.lax.scan(lambda y, _: (y - 0.1 * jnp.cos(y), None), state, None, 100)[0]
print("xla_cpu_small_call" in jax.jit(steps).lower(jnp.eye(60)).compile().as_text())
print(os.environ["XLA_FLAGS"])
"""


def compiled_with(flags):
    """Whether a loop is one piece, and the options of a process that is given some."""
    done = subprocess.run(
        [sys.executable, "-c", LOOP], env={**os.environ, "XLA_FLAGS": flags},
        capture_output=True, text=True, timeout=300, check=True,
    )  # fmt: skip
    whole, options = done.stdout.splitlines()
    return whole == "True", options


@pytest.mark.parametrize(
    "flags", [pytest.param("", marks=pytest.mark.slow), "--xla_cpu_enable_fast_math=false"]
)
def test_a_loop_is_one_piece_beside_what_the_user_chose(flags):
    whole, options = compiled_with(flags)
    assert whole
    assert options.startswith(flags)


def test_who_chose_the_same_kind_of_option_keeps_it():
    chosen = "--xla_backend_extra_options=xla_cpu_small_while_loop_byte_threshold=0"
    assert compiled_with(chosen) == (False, chosen)


def test_an_option_that_the_compiler_does_not_know_is_left_out(monkeypatch):
    def refuse(function, **kwargs):
        raise jax.errors.JaxRuntimeError("No such compile option")

    monkeypatch.setattr(jax, "jit", refuse)
    assert _compiled_soon.__wrapped__() == {}
    assert _whole_loops.__wrapped__() == {}
