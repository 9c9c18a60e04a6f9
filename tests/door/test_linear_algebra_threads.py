"""How many threads a product of matrices takes while something is fitted, and afterwards."""

import os

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import discover as dc
from discover import linear_algebra_threads
from discover.comparison import run_comparison
from discover.learners import distillation
from discover.learners.run_prediction import RunPrediction
from discover.linear_algebra_threads import in_one_thread, use_one_thread_from_the_start
from discover.loop import loop

TWO = pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="a library takes no more than cores")


def threads() -> set[int]:
    return {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"}


@pytest.fixture
def two_threads(monkeypatch):
    for name in linear_algebra_threads._CHOSEN:
        monkeypatch.delenv(name, raising=False)
    with threadpool_limits(2, "blas"):
        yield


@TWO
@pytest.mark.usefixtures("two_threads")
def test_a_product_takes_one_thread_inside_and_what_it_took_before_afterwards():
    assert threads() == {2}
    assert in_one_thread(threads)() == {1}
    assert threads() == {2}
    with pytest.raises(ZeroDivisionError):
        in_one_thread(lambda: 1 / 0)()
    assert threads() == {2}


@TWO
@pytest.mark.usefixtures("two_threads")
def test_a_number_that_the_user_chose_stays(monkeypatch):
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "2")
    assert in_one_thread(threads)() == {2}
    use_one_thread_from_the_start()
    assert os.environ["OPENBLAS_NUM_THREADS"] == "2"
    monkeypatch.delenv("OPENBLAS_NUM_THREADS")
    use_one_thread_from_the_start()
    assert os.environ["OPENBLAS_NUM_THREADS"] == "1"


@TWO
@pytest.mark.usefixtures("two_threads")
def test_a_fit_runs_in_one_thread(monkeypatch):
    seen = []
    monkeypatch.setattr(dc.TensorSINDy, "_learn", lambda self, runs, known: seen.append(threads()))
    run = dc.synthetic_dataset("ucm", noise=0.01)[0]
    dc.TensorSINDy(base=dc.Fluid(dc.make_law("ucm"), 1.0, 1.0)).fit([run])
    assert seen == [{1}]


@pytest.mark.parametrize(
    "function", [loop.run_loop, run_comparison.compare, distillation.distil, RunPrediction.fit]
)
def test_what_fits_many_times_is_limited(function):
    assert hasattr(function, "__wrapped__")
