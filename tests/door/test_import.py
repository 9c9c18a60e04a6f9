"""``import discover`` is light, and what processes that use it first find and say."""

import ast
import importlib
import inspect
import os
import subprocess
import sys

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import discover as dc
from discover import processor
from discover.processor import (
    in_one_thread,
    use_one_thread_from_the_start,
    use_the_processor_from_the_start,
)

HEAVY = ("jax", "numpy", "scipy", "sympy", "pandas", "matplotlib", "pydantic", "equinox")


def python(code, *arguments, **environment):
    left = ("COMPILATION_CACHE", "TF_CPP", "JAX_PLATFORM")
    kept = {k: v for k, v in os.environ.items() if not any(name in k for name in left)}
    command = [sys.executable, "-c", code, *arguments]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=300, env={**kept, **environment}
    )
    assert done.returncode == 0, done.stderr
    return done.stdout, done.stderr


# equinox reads once, when it is imported, what becomes of an error inside a program, and diffrax
# imports it
FIRST_USE = f"""
import sys, time
begin = time.process_time()
import discover as dc
ours = time.process_time() - begin
loaded = lambda: [m for m in {HEAVY} if m in sys.modules]
print(loaded())
begin = time.process_time()
import numpy
print(ours, time.process_time() - begin)
dc.synthetic_dataset
print(loaded())
import equinox
print(equinox._config.EQX_ON_ERROR)
import discover.cli, discover.report
print(*dir(dc))
"""


@pytest.fixture(scope="module")
def first_use(tmp_path_factory):
    """Lines that a process prints which imports the door, then uses it; and its cache folder."""
    folder = tmp_path_factory.mktemp("cache")
    return python(FIRST_USE, XDG_CACHE_HOME=str(folder))[0].splitlines(), folder


def test_importing_loads_nothing_heavy_and_takes_less_time_than_importing_numpy(first_use):
    (loaded, seconds, *_), _ = first_use
    assert loaded == "[]"
    ours, theirs = map(float, seconds.split())
    assert ours < max(theirs, 0.3)


def test_what_is_used_first_loads_what_it_needs_and_the_door_lists_public_names_alone(first_use):
    # the negative control of the test above
    (_, _, loaded, on_error, _), folder = first_use
    assert "jax" in loaded
    assert on_error == "nan"
    assert (folder / "discover" / "compiled").is_dir()
    assert first_use[0][-1].split() == sorted([*dc.__all__, "__version__"])


def test_everything_named_is_there_and_listed():
    for name in dc.__all__:
        assert getattr(dc, name) is not None, name
        assert name in dir(dc)
    assert dc.load_dataset.__module__ == "discover.dataset.load"
    with pytest.raises(AttributeError, match="no attribute 'gremlins'"):
        dc.gremlins  # noqa: B018
    assert not hasattr(dc, "gremlins")


def test_type_checkers_see_what_runs():
    tree = ast.parse(inspect.getsource(dc))
    block = next(node for node in tree.body if isinstance(node, ast.If))
    seen = {
        alias.asname: (node.module, alias.name)
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert sorted(seen) == sorted(dc.__all__)
    for name, (module, inner) in seen.items():
        there = getattr(importlib.import_module(module), inner)
        # a package that answers calls stands for its function, with the same signature
        own = getattr(dc, name)
        assert own is there or inspect.signature(own) == inspect.signature(there), name


# JAX ran before, and left an array in single precision, then none; what is said goes to one stream
FIRST_CALL = """
import sys, jax, jax.numpy as jnp
first = jnp.ones(3)
jnp.ones(3).sum().block_until_ready(); jnp.arange(3)
jax.config.update("jax_compilation_cache_dir", sys.argv[1])
import discover as dc
try:
    dc.Fluid
except dc.InputError as error:
    print("refused:", error)
del first
data = dc.synthetic_dataset(
    "giesekus", {"alpha": 0.2}, {"a": dc.start_up(1.0)}, noise=0.01, n_samples=31
)
print(dc.Fluid(dc.make_law("ucm"), 1.0, 1.0).modulus.dtype, jax.config.jax_compilation_cache_dir)
print(jax.config.jax_logging_level)
with jax.enable_x64(False) if hasattr(jax, "enable_x64") else jax.experimental.disable_x64():
    try:
        dc.TensorSINDy().fit([])
    except dc.InputError as error:
        print("refused:", error)
"""


def test_single_precision_is_an_error_and_else_a_first_call_writes_nothing(tmp_path):
    said, error = python(FIRST_CALL, str(tmp_path))
    first, taken, level, second = said.strip().splitlines()
    assert "1 array of single precision" in first
    assert "jax.config.update('jax_enable_x64', True)" in first
    # the negative control: JAX may be started before, and a cache chosen before stays
    assert taken.split() == ["float64", str(tmp_path)]
    assert "single precision here" in second
    # nor is XLA to write anything
    assert (level, error) == ("CRITICAL", "")


COMMAND = f"""
import atexit, os, runpy, sys
sys.argv = ["discover", "--help"]
names = "discover.dataset.importing.names"  # of quantities, read only where something is imported
loaded = lambda: [m for m in (*{HEAVY}, "dask", "pysindy", names) if m in sys.modules]
atexit.register(lambda: print(os.environ["JAX_PLATFORMS"], *loaded()))
runpy.run_module("discover", run_name="__main__", alter_sys=True)
"""


def test_python_m_discover_is_the_command_on_the_processor_and_its_help_loads_nothing_heavy():
    said, _ = python(COMMAND)
    assert "discover [OPTIONS] COMMAND" in said
    assert "__main__" not in said
    # half a second on an idle machine; what takes longer is numbers, and shells
    assert said.splitlines()[-1] == "cpu"
    for shown in ("--show-completion", "demo", "compare", "close-loop", "batch", "data", "export"):
        assert shown in said


@pytest.mark.parametrize("name", ["JAX_PLATFORMS", "JAX_PLATFORM_NAME"])
def test_what_the_user_chose_stays(monkeypatch, name):
    for one in ("JAX_PLATFORMS", "JAX_PLATFORM_NAME"):
        monkeypatch.delenv(one, raising=False)
    monkeypatch.setenv(name, "cuda")
    use_the_processor_from_the_start()
    assert os.environ[name] == "cuda"
    assert os.environ.get("JAX_PLATFORMS", "cuda") == "cuda"


TWO = pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="a library takes no more than cores")


def threads() -> set[int]:
    return {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"}


@pytest.fixture
def two_threads(monkeypatch):
    for name in processor._CHOSEN:
        monkeypatch.delenv(name, raising=False)
    with threadpool_limits(2, "blas"):
        yield


@TWO
@pytest.mark.usefixtures("two_threads")
def test_a_product_and_a_fit_take_one_thread_or_what_the_user_chose_and_give_it_back(monkeypatch):
    assert threads() == {2}
    assert in_one_thread(threads)() == {1}
    assert threads() == {2}
    with pytest.raises(ZeroDivisionError):
        in_one_thread(lambda: 1 / 0)()
    assert threads() == {2}
    seen = []
    monkeypatch.setattr(dc.TensorSINDy, "_learn", lambda self, runs, known: seen.append(threads()))
    run = dc.synthetic_dataset("ucm", noise=0.01)[0]
    dc.TensorSINDy(base=dc.Fluid(dc.make_law("ucm"), 1.0, 1.0)).fit([run])
    assert seen == [{1}]
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "2")
    assert in_one_thread(threads)() == {2}
    use_one_thread_from_the_start()
    assert os.environ["OPENBLAS_NUM_THREADS"] == "2"
    monkeypatch.delenv("OPENBLAS_NUM_THREADS")
    use_one_thread_from_the_start()
    assert os.environ["OPENBLAS_NUM_THREADS"] == "1"


def test_simulate_is_a_function_and_a_package():
    times = np.linspace(0.0, 3.0, 7)
    fluid = dc.Fluid(modulus=2.0, relaxation_time=1.5)
    stress = dc.simulate(fluid, dc.start_up(0.1), times).shear_stress
    # closed form of upper-convected Maxwell; 1e-8 is the tolerance of the integration
    np.testing.assert_allclose(stress, 0.3 * (1.0 - np.exp(-times / 1.5)), atol=1e-7)
    assert dc.simulate.SimulationError
