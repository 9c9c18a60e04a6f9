"""Most programs are compiled in haste, and those that run long are not."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from discover.programs import compiled
from discover.programs.program_cache import _compiled_soon, _whole_loops


@pytest.fixture
def asked(monkeypatch):
    """What the compiler was asked for, program by program."""
    seen, jit = [], jax.jit

    def listening(function, **kwargs):
        seen.append(kwargs.get("compiler_options"))
        return jit(function, **kwargs)

    monkeypatch.setattr(jax, "jit", listening)
    return seen


@pytest.mark.parametrize("runs_long", [False, True])
def test_only_what_does_not_run_long_is_compiled_in_haste(asked, runs_long):
    double = compiled(lambda x: 2.0 * x, runs_long=runs_long)
    assert double(jnp.ones(3)).tolist() == [2.0, 2.0, 2.0]
    assert asked[-1] == {**({} if runs_long else _compiled_soon()), **_whole_loops()}


def test_what_is_asked_for_is_known_to_the_versions_of_xla_that_have_it():
    if jax.__version_info__ < (0, 11):  # from then on there are no other emitters to choose
        assert _compiled_soon()
    assert _whole_loops()


def _compiled(**options):
    def steps(state):
        def step(y, _):
            longer = jnp.sum(jnp.cos(y[:, :, None] * y[:, None, :]), axis=2)
            return 0.9 * y + 1e-3 * longer, None

        return jax.lax.scan(step, state, None, 100)[0]

    return jax.jit(steps, **options).lower(jnp.ones((40, 40))).compile().as_text()


def test_a_loop_with_a_long_sum_is_one_piece_and_would_not_be_without_being_asked_for():
    assert "xla_cpu_small_call" in _compiled(compiler_options=_whole_loops())
    # with the version of XLA that these tests run on
    assert "xla_cpu_small_call" not in _compiled()


def test_a_program_may_be_called_with_numbers_while_another_is_traced():
    double = compiled(lambda x: 2.0 * x)
    both = jax.jit(lambda x: x + double(jnp.ones(3)) + double(x))
    np.testing.assert_array_equal(both(jnp.arange(3.0)), [2.0, 5.0, 8.0])


def test_an_option_that_the_compiler_does_not_know_is_left_out(monkeypatch):
    def refuse(function, **kwargs):
        raise jax.errors.JaxRuntimeError("No such compile option")

    monkeypatch.setattr(jax, "jit", refuse)
    assert _compiled_soon.__wrapped__() == {}
    assert _whole_loops.__wrapped__() == {}
