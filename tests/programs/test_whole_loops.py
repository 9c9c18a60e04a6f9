"""Programs and the compiler: loops are one piece, whatever options a user or a version has."""

import os
import subprocess
import sys

import jax
import pytest

from discover.programs.compiler import _compiled_soon, _whole_loops

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
        [sys.executable, "-c", LOOP],
        env={**os.environ, "XLA_FLAGS": flags},
        capture_output=True,
        text=True,
        timeout=300,
        check=True,
    )
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
