"""Nothing that XLA, JAX or LLVM write for their own developers reaches the user."""

import os
import subprocess
import sys

FIRST_CALL = """
import discover as dc
flows = {"a": dc.start_up(1.0), "b": dc.oscillatory_shear(2.0, 1.0)}
data = dc.synthetic_dataset("giesekus", {"alpha": 0.2}, flows, noise=0.01, n_samples=31)
dc.close_loop(data, max_effects=1, effects=["giesekus_mobility"])
"""

# XLA raises an alarm where it takes more than a second to compute a constant
SLOW = """
import discover as dc
dc.Fluid
import jax, jax.numpy as jnp
def constant():
    ones = jnp.ones((60, 60))
    return jax.lax.reduce_window(ones, 0.0, jax.lax.add, (25, 25), (1, 1), "SAME")
jax.jit(constant)().block_until_ready()
"""


def errors_of(code, **environment):
    """What a fresh process without kept programs writes to standard error."""
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("TF_CPP", "JAX_COMPILATION"))}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=300,
        env={**kept, "DISCOVER_NO_CACHE": "1", **environment},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stderr


def test_a_first_call_and_an_alarm_of_xla_write_nothing_but_for_those_who_ask_for_it():
    assert errors_of(FIRST_CALL + SLOW) == ""
    # negative control: XLA had something to say
    assert "Constant folding" in errors_of(SLOW, TF_CPP_MIN_LOG_LEVEL="0")
