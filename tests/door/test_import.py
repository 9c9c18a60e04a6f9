"""``import discover`` is light, and everything it names is there."""

import ast
import importlib
import inspect
import os
import subprocess
import sys

import pytest

import discover as dc

HEAVY = ("jax", "numpy", "scipy", "sympy", "pandas", "matplotlib", "pydantic", "equinox")


def python(code, *arguments, **environment):
    """What a fresh process prints."""
    kept = {name: value for name, value in os.environ.items() if "COMPILATION_CACHE" not in name}
    command = [sys.executable, "-c", code, *arguments]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=300, env={**kept, **environment}
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_importing_loads_nothing_heavy():
    code = f"import discover, sys; print([m for m in {HEAVY} if m in sys.modules])"
    assert python(code).strip() == "[]"


def test_what_is_used_first_loads_what_it_needs_keeps_programs_and_lets_no_error_call_back(
    tmp_path,
):
    # the negative control of the test above; equinox reads once, when it is imported, what becomes
    # of an error inside a program, and diffrax imports it
    code = f"""
import sys
import discover as dc
dc.synthetic_dataset
print([m for m in {HEAVY} if m in sys.modules])
import equinox
print(equinox._config.EQX_ON_ERROR)
"""
    loaded, on_error = python(code, XDG_CACHE_HOME=str(tmp_path)).splitlines()
    assert "jax" in loaded
    assert on_error == "nan"
    assert (tmp_path / "discover" / "compiled").is_dir()


def test_importing_takes_less_time_than_importing_numpy():
    code = (
        "import time; a = time.perf_counter(); import discover; b = time.perf_counter(); "
        "import numpy; print(b - a, time.perf_counter() - b)"
    )
    ours, theirs = map(float, min(python(code) for _ in range(3)).split())
    assert ours < max(theirs, 0.3)


def test_everything_named_is_there_and_listed():
    for name in dc.__all__:
        assert getattr(dc, name) is not None, name
        assert name in dir(dc)
    assert dc.load_dataset.__module__ == "discover.dataset.load"
    with pytest.raises(AttributeError, match="no attribute 'gremlins'"):
        dc.gremlins  # noqa: B018
    assert not hasattr(dc, "gremlins")


def test_the_door_lists_public_names_alone_also_where_submodules_are_loaded():
    code = "import discover as dc, discover.cli, discover.report; print(*dir(dc))"
    assert python(code).split() == sorted([*dc.__all__, "__version__"])


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
        # the packages that answer calls are their own functions
        assert getattr(dc, name) is there or getattr(dc, name)().equals(there()), name


SINGLE = """
import jax, jax.numpy as jnp
first = jnp.ones(3)
import discover as dc
try:
    dc.Fluid
except dc.InputError as error:
    print("refused:", error)
jax.config.update("jax_enable_x64", True)
print(dc.Fluid(dc.make_law("ucm"), 1.0, 1.0).modulus.dtype)
with jax.enable_x64(False) if hasattr(jax, "enable_x64") else jax.experimental.disable_x64():
    try:
        dc.TensorSINDy().fit([])
    except dc.InputError as error:
        print("refused:", error)
"""


def test_arrays_of_single_precision_made_before_are_an_error_with_a_way_on():
    first, dtype, second = python(SINGLE).strip().splitlines()
    assert "1 array of single precision" in first
    assert "jax.config.update('jax_enable_x64', True)" in first
    assert dtype == "float64"
    assert "single precision here" in second


def test_the_user_may_start_jax_before_and_choose_another_cache(tmp_path):
    # negative control of the error: JAX that ran without leaving an array in single precision
    code = """
import sys, jax, jax.numpy as jnp
jnp.ones(3).sum().block_until_ready(); jnp.arange(3)
jax.config.update("jax_compilation_cache_dir", sys.argv[1])
import discover as dc
print(dc.Fluid(dc.make_law("ucm"), 1.0, 1.0).modulus.dtype, jax.config.jax_compilation_cache_dir)
"""
    assert python(code, str(tmp_path)).split() == ["float64", str(tmp_path)]


def test_python_m_discover_is_the_command():
    done = subprocess.run(
        [sys.executable, "-m", "discover", "--help"], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0
    assert "discover [OPTIONS] COMMAND" in done.stdout
    assert "__main__" not in done.stdout
