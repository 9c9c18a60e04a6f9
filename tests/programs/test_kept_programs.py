"""Machine code that a later start finds: the same answers, and never that of another program."""

import os
import subprocess
import sys
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from discover.compilation_cache import enable_compilation_cache, is_ours_alone
from discover.laws import Fluid, make_law
from discover.programs import compiled, store
from discover.programs.store import FOLDER, digest_of, kept, program_folder
from tensor_library.library import build_library

ONE_START = """
import sys, numpy as np
from discover.compilation_cache import compiled_share, enable_compilation_cache
from discover.first_use import enable_x64
enable_x64(); enable_compilation_cache(sys.argv[1])
from discover.laws import Fluid, make_law
from discover.protocols import oscillatory_shear
from discover.simulate import simulate
fluid = Fluid.dimensionless(make_law("giesekus", {"alpha": 0.3}))
t = np.linspace(0.0, 2.0, 21)
found = simulate(fluid, oscillatory_shear(2.0, 1.0), t).components
print(found.tobytes().hex(), compiled_share())
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A store of this test's own."""
    before = jax.config.jax_compilation_cache_dir  # pyright: ignore[reportAttributeAccessIssue]
    jax.config.update("jax_compilation_cache_dir", str(tmp_path))
    yield tmp_path
    jax.config.update("jax_compilation_cache_dir", before)


def files(folder):
    return sorted(folder.glob(f"{FOLDER}/*"))


@pytest.mark.slow
def test_a_second_start_gives_the_same_bits_and_writes_no_machine_code(tmp_path):
    command = [sys.executable, "-c", ONE_START, str(tmp_path)]
    first, second = (
        subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
        for _ in range(2)
    )
    assert first[0] == second[0]
    assert (first[1], second[1]) == ("1.0", "0.0")


def test_without_a_cache_folder_code_is_made_at_every_start(folder):
    made = []
    for place, count in ((str(folder), 1), (None, 2), (None, 3)):
        jax.config.update("jax_compilation_cache_dir", place)
        assert kept("this test", lambda: made.append(1) or (b"machine code", True))
        assert len(made) == count
    assert program_folder() is None


def test_code_that_was_cut_short_or_altered_is_made_anew(folder):
    made = []

    def write():
        made.append(1)
        return b"machine code", True

    for _ in range(2):
        assert kept("this test", write) == b"machine code"
    assert len(made) == 1
    (file,) = files(folder)
    whole = file.read_bytes()
    for damaged in (whole[:-7], whole[:40], b"", whole[:-1] + bytes([whole[-1] ^ 1])):
        file.write_bytes(damaged)
        made.clear()
        for _ in range(2):
            assert kept("this test", write) == b"machine code"
        assert len(made) == 1


def test_what_a_user_wrote_or_calls_functions_of_this_process_is_made_at_every_start(folder):
    made = []

    def write(stands_alone=True):
        made.append(1)
        return b"machine code", stands_alone

    for _ in range(2):  # what a function of this module does may change, and no version tells
        kept(("this test", files), write)
    for _ in range(2):  # nor is what calls functions of this process there at the next start
        kept(("this test", 2), lambda: write(False))
    assert len(made) == 4
    assert not files(folder)


def test_a_folder_that_cannot_be_written_to_costs_nothing_but_time(folder, monkeypatch):
    monkeypatch.setattr(store, "program_folder", lambda: folder / "absent")
    assert kept("this test", lambda: (b"machine code", True)) == b"machine code"
    assert not (folder / "absent").exists()


def test_the_earliest_files_go_and_those_of_others_stay(folder, monkeypatch):
    monkeypatch.setattr(store, "_FILES_KEPT", 3)
    (folder / FOLDER).mkdir(mode=0o700)
    (folder / FOLDER / "thesis.txt").write_text("years")
    for age in range(6):
        kept(("this test", age), lambda: (b"machine code", True))
        newest = max(files(folder), key=lambda path: path.stat().st_mtime_ns)
        os.utime(newest, (age, age))
    assert len(files(folder)) == 1 + 3
    assert (folder / FOLDER / "thesis.txt").read_text() == "years"
    assert kept(("this test", 5), lambda: (b"", True)) == b"machine code"
    assert kept(("this test", 0), lambda: (b"anew", True)) == b"anew"


@pytest.mark.parametrize("mode", [0o770, 0o707, 0o1777])
@pytest.mark.parametrize("within", ["", FOLDER])
def test_a_cache_that_others_can_write_to_is_not_opened(folder, mode, within):
    place = folder / within
    place.mkdir(exist_ok=True)
    place.chmod(mode)
    with pytest.warns(UserWarning, match="can be written to by other users"):
        assert program_folder() is None
    place.chmod(0o700)
    is_ours_alone.cache_clear()
    assert program_folder() is not None  # the control


def test_a_cache_of_another_user_is_not_opened(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "geteuid", lambda: tmp_path.stat().st_uid + 1)
    with pytest.warns(UserWarning, match="belongs to another user"):
        assert enable_compilation_cache(tmp_path) is None


def test_a_new_cache_is_its_users_alone_whatever_the_umask(tmp_path):
    command = [sys.executable, "-c", "import os, sys; os.umask(0)\n" + ENABLE, str(tmp_path / "x")]
    subprocess.run(command, check=True)
    for place in (tmp_path / "x", tmp_path / "x" / FOLDER):
        assert place.stat().st_mode & 0o777 == 0o700


ENABLE = """
from discover.compilation_cache import enable_compilation_cache
assert enable_compilation_cache(sys.argv[1]) is not None
from discover.programs.store import program_folder
assert program_folder() is not None
"""


def test_arrays_are_told_by_kind_and_all_else_by_value():
    first, second = (Fluid.dimensionless(make_law("giesekus", {"alpha": a})) for a in (0.1, 0.2))
    assert digest_of(first) == digest_of(second)
    other = Fluid.dimensionless(make_law("ptt_linear", {"epsilon": 0.1}))
    assert digest_of(first) != digest_of(other)
    assert digest_of((first, first)) == digest_of((first, second))  # one twice is as two alike
    assert digest_of(np.zeros(2)) != digest_of(np.zeros(3)) != digest_of(np.zeros(3, int))
    assert digest_of(build_library(degree=0)) != digest_of(build_library(degree=1))
    assert digest_of(0.0) != digest_of(-0.0)
    assert digest_of(1) != digest_of(1.0) != digest_of(True)
    assert digest_of(jnp.zeros) != digest_of(jnp.ones)


def test_code_that_no_version_names_has_no_digest():
    class Own(eqx.Module):
        size: float

    itself = []
    itself.append(itself)
    for unknown in (Own(2.0), lambda x: x, partial(files), itself):
        assert digest_of(unknown) is None
    assert digest_of(partial(jnp.sum, axis=0)) is not None  # the control


def test_a_program_inside_of_a_transformation_is_differentiated():
    square = compiled(lambda x: x * x)
    assert float(jax.grad(square)(3.0 * jnp.ones(()))) == 6.0
    np.testing.assert_array_equal(jax.vmap(square)(jnp.arange(3.0)), [0.0, 1.0, 4.0])
