"""Calls side by side: in their order, in threads of their own, the first alone if need be."""

import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from discover.programs import compiler, in_threads


@pytest.fixture(autouse=True)
def in_threads_whoever_runs_the_tests(monkeypatch):
    monkeypatch.setattr(compiler, "ThreadPoolExecutor", ThreadPoolExecutor)
    monkeypatch.setattr(compiler, "_WORKERS", 2)
    compiler._pool.cache_clear()
    yield
    compiler._pool.cache_clear()


@pytest.mark.parametrize("is_compiled", [False, True])
def test_what_comes_back_is_in_the_order_of_the_jobs(is_compiled):
    assert in_threads(lambda job: 10 * job, range(7), is_compiled) == [*range(0, 70, 10)]
    assert in_threads(lambda job: job, [], is_compiled) == []


def test_two_calls_of_a_compiled_program_run_at_once():
    both = threading.Barrier(2)
    # each waits for the other; one after the other would end in an error
    assert in_threads(lambda job: both.wait(30.0) in (0, 1), range(2), True) == [True, True]


def test_what_numpy_is_told_of_overflows_holds_in_threads_and_nowhere_else(recwarn):
    jobs = [np.array([1e300])] * 3
    with np.errstate(over="ignore"):
        assert np.all(np.isinf(in_threads(lambda job: job * job, jobs, is_compiled=True)))
    assert not recwarn
    # control: where it is told nothing, threads warn
    in_threads(lambda job: job * job, jobs, is_compiled=True)
    assert any("overflow" in str(one.message) for one in recwarn)
