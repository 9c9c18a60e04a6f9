"""What is compiled is kept, solvers included."""

import subprocess
import sys
import zlib
from collections import Counter

import pytest

from discover import compilation_cache
from discover.compilation_cache import remove_cut_short
from discover.programs.store import load_program, save_program

SIMULATE = """
import sys
from discover.compilation_cache import enable_compilation_cache
enable_compilation_cache(sys.argv[1])
import jax, numpy as np
from discover.forward.flow_batch import lay_out
from discover.forward.fluids import observed_on_grid
from discover.laws import Fluid, Giesekus
from discover.protocols import start_up
flows = lay_out([start_up(2.0)], [np.linspace(0.1, 3.0, 7)])
def followed(fluid):
    return flows.over(lambda *flow: observed_on_grid(fluid, *flow))
jax.jit(followed)(Fluid(Giesekus(0.3), np.ones(1), np.ones(1)))
"""


def start(folder):
    """What a process says that follows a fluid by JAX, with a cache folder."""
    command = [sys.executable, "-c", SIMULATE, str(folder)]
    return subprocess.run(command, check=True, timeout=300, capture_output=True, text=True).stderr


@pytest.mark.slow
def test_a_program_with_a_solver_in_it_is_kept_and_one_cut_short_is_made_again(tmp_path):
    # a check that calls back to Python would make it one that cannot be kept
    start(tmp_path)
    (kept,) = (path for path in tmp_path.iterdir() if "jit_followed" in path.name)
    whole = kept.read_bytes()
    kept.write_bytes(whole[: len(whole) // 2])  # as a full disk does, or a kill
    assert start(tmp_path) == ""
    assert kept.stat().st_size > 0.9 * len(whole)


def test_whole_programs_are_left_and_broken_ones_go(tmp_path):
    whole = zlib.compress(b"program " * 1000)
    contents = {"jit_a": whole, "jit_b": whole[:-3], "jit_c": b"", "jit_d": b"nonsense"}
    for name, content in contents.items():
        (tmp_path / f"{name}-{'0f' * 32}-cache").write_bytes(content)
    (tmp_path / "web-cache").write_bytes(b"no program, and somebody else's")
    remove_cut_short(tmp_path)
    left = sorted(path.name.partition("-")[0] for path in tmp_path.glob("*-cache"))
    assert left == ["jit_a", "web"]


def test_programs_to_compile_are_counted_among_those_that_were_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(compilation_cache, "_found", Counter())
    assert compilation_cache.compiled_share() == 0.0
    assert load_program(tmp_path / "one") is None
    assert compilation_cache.compiled_share() == 1.0
    save_program(tmp_path / "one", None, b"code")
    assert load_program(tmp_path / "one") == (None, b"code")
    assert compilation_cache.compiled_share() == 0.5
