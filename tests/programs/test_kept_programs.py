"""Programs that a later start finds: the same answers, and never another program's."""

import os
import pickle
import subprocess
import sys
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from discover.compilation_cache import enable_compilation_cache, is_ours_alone
from discover.dataset import Run
from discover.effects import make_effect
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.forward.program import program_of
from discover.identify.structure import with_sensitivities
from discover.laws import Fluid, make_law
from discover.programs import compiled, forget_programs
from discover.programs.store import (
    FOLDER,
    STAMP_FILE,
    NotDescribable,
    _folder,
    fingerprint,
    load_program,
    program_folder,
    save_program,
)
from discover.protocols.protocol import oscillatory_shear, start_up
from discover.simulate.solve import simulate
from tensor_library.library import build_library

GIESEKUS = Fluid.dimensionless(make_law("giesekus", {"alpha": 0.3}))
ONE_START = """
import logging, sys, numpy as np
from discover.compilation_cache import enable_compilation_cache
from discover.first_use import enable_x64
enable_x64(); enable_compilation_cache(sys.argv[1])
import jax
traced = []
jax.monitoring.register_event_duration_secs_listener(
    lambda name, seconds, **_: traced.append(seconds) if "jaxpr_trace" in name else None)
from discover.laws import Fluid, make_law
from discover.protocols.protocol import oscillatory_shear
from discover.simulate.solve import simulate
fluid = Fluid.dimensionless(make_law("giesekus", {"alpha": 0.3}))
t = np.linspace(0.0, 2.0, 21)
print(simulate(fluid, oscillatory_shear(2.0, 1.0), t).components.tobytes().hex(), sum(traced))
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A store of this test's own."""
    before = jax.config.jax_compilation_cache_dir  # pyright: ignore[reportAttributeAccessIssue]
    jax.config.update("jax_compilation_cache_dir", str(tmp_path))
    yield tmp_path
    jax.config.update("jax_compilation_cache_dir", before)


def programs(folder):
    return sorted(path for path in folder.glob(f"{FOLDER}/*/*") if not path.name.startswith("."))


@pytest.mark.slow
def test_a_second_start_gives_the_same_bits_without_tracing_the_solver(tmp_path):
    command = [sys.executable, "-c", ONE_START, str(tmp_path)]
    first, second = (
        subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
        for _ in range(2)
    )
    assert first[0] == second[0]
    # to trace an adaptive solver takes seconds, to call an exported program milliseconds
    assert float(second[1]) < 0.3 * float(first[1])


def test_without_a_cache_folder_the_answer_is_the_same(folder):
    t, flow = np.linspace(0.0, 2.0, 21), oscillatory_shear(2.0, 1.0)
    kept = simulate(GIESEKUS, flow, t).components
    assert programs(folder)
    jax.config.update("jax_compilation_cache_dir", None)
    assert program_folder() is None
    np.testing.assert_array_equal(simulate(GIESEKUS, flow, t).components, kept)


def test_a_program_that_was_cut_short_or_altered_is_made_anew(folder):
    double = compiled(_double, made_from="this test")
    np.testing.assert_array_equal(double(np.arange(3.0)), [0.0, 2.0, 4.0])
    (file,) = programs(folder)
    whole = file.read_bytes()
    for damaged in (whole[:-7], whole[:40], b"", whole[:-1] + bytes([whole[-1] ^ 1])):
        file.write_bytes(damaged)
        assert load_program(file) is None
        double.forget()
        np.testing.assert_array_equal(double(np.arange(3.0)), [0.0, 2.0, 4.0])
        assert load_program(file) is not None


def test_a_folder_that_cannot_be_written_to_costs_nothing_but_time(folder):
    save_program(folder / "absent" / "file", ["array"], b"")
    assert not (folder / "absent").exists()


def test_programs_of_other_code_are_removed_but_for_the_latest(folder):
    for age in range(6):
        old = folder / FOLDER / f"stamp{age}"
        old.mkdir(parents=True)
        (old / STAMP_FILE).touch()
        os.utime(old, (age, age))
    assert program_folder() is not None
    assert len(list((folder / FOLDER).iterdir())) == 3


def test_folders_without_our_stamp_are_somebody_elses_and_stay(folder):
    elsewhere = folder / "elsewhere"
    for name in ("programs", FOLDER):  # an earlier name of ours, and theirs under the present one
        for i in range(6):
            theirs = folder / name / f"work{i}"
            theirs.mkdir(parents=True)
            (theirs / "thesis.txt").write_text("years")
    elsewhere.mkdir()
    (elsewhere / STAMP_FILE).touch()
    (folder / FOLDER / "link").symlink_to(elsewhere)
    assert program_folder() is not None
    assert len(list(folder.glob("*/work*/thesis.txt"))) == 12
    assert (elsewhere / STAMP_FILE).exists()


@pytest.mark.parametrize("mode", [0o770, 0o707, 0o1777])
@pytest.mark.parametrize("within", ["", FOLDER])
def test_a_cache_that_others_can_write_to_is_not_opened(folder, mode, within):
    place = folder / within
    place.mkdir(exist_ok=True)
    place.chmod(mode)
    with pytest.warns(UserWarning, match="can be written to by other users"):
        assert program_folder() is None
    place.chmod(0o700)
    _folder.cache_clear(), is_ours_alone.cache_clear()
    assert program_folder() is not None  # the control


def test_a_cache_of_another_user_is_not_opened(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "geteuid", lambda: tmp_path.stat().st_uid + 1)
    with pytest.warns(UserWarning, match="belongs to another user"):
        assert enable_compilation_cache(tmp_path) is None


def test_a_new_cache_is_its_users_alone_whatever_the_umask(tmp_path):
    command = [sys.executable, "-c", "import os, sys; os.umask(0)\n" + ENABLE, str(tmp_path / "x")]
    subprocess.run(command, check=True)
    for place in (tmp_path / "x", tmp_path / "x" / FOLDER, *(tmp_path / "x" / FOLDER).iterdir()):
        assert place.stat().st_mode & 0o777 == 0o700


ENABLE = """
from discover.compilation_cache import enable_compilation_cache
assert enable_compilation_cache(sys.argv[1]) is not None
from discover.programs.store import program_folder
assert program_folder() is not None
"""


def _double(x):
    return 2.0 * x


def test_a_program_may_be_called_with_numbers_while_another_function_is_traced(folder):
    double = compiled(_double, made_from="a third test")
    three = np.arange(3.0)
    traced = jax.jit(lambda x: x + double(three))(jnp.ones(3))
    np.testing.assert_array_equal(traced, [1.0, 3.0, 5.0])


def _times(factor):
    return lambda x: factor * x


def test_what_a_function_encloses_is_part_of_its_program():
    two, three = _times(2.0), _times(3.0)
    two.__module__ = three.__module__ = "discover.tested"
    assert fingerprint(two, True) == fingerprint(_named(_times(2.0)), True)
    assert fingerprint(two, True) != fingerprint(three, True)
    array = _named(_times(np.arange(1000.0)))
    other = np.arange(1000.0)
    other[500] += 1e-12  # repr would not show it
    assert fingerprint(array, True) != fingerprint(_named(_times(other)), True)


def _named(function):
    function.__module__ = "discover.tested"
    return function


def test_models_that_share_every_shape_have_results_of_their_own(folder):
    forget_programs()  # what a test before had made would write nothing here
    program_of.cache_clear()
    # jax.vmap of a method bears the method's name, whatever its object holds
    declared = DeclaredModel.maxwell(100.0, 1.0)
    times = np.linspace(0.1, 2.0, 30)
    run = Run("a", times, start_up(2.0), np.full(30, 2.0), 100.0 * (1.0 - np.exp(-times)))
    sizes = {}
    for name in ("giesekus_mobility", "tr(sigma)*sigma"):
        model = AugmentedModel(declared, [make_effect(name)])
        theta = model.zero()
        theta[model.positions(name)] = 1e-3
        sizes[name] = float(np.sum(model.predict(theta, make_batch([run])) ** 2))
    assert len(set(sizes.values())) == len(sizes)
    assert any(path.stat().st_size for path in programs(folder))  # kept, and told apart


def test_arguments_are_told_by_kind_and_static_fields_by_value():
    first, second = (Fluid.dimensionless(make_law("giesekus", {"alpha": a})) for a in (0.1, 0.2))
    assert fingerprint(first, False) == fingerprint(second, False)
    assert fingerprint(first, True) != fingerprint(second, True)
    other = Fluid.dimensionless(make_law("ptt_linear", {"epsilon": 0.1}))
    assert fingerprint(first, False) != fingerprint(other, False)
    small, large = build_library(degree=0), build_library(degree=1)
    assert fingerprint(small, False) != fingerprint(large, False)
    assert fingerprint({"a": 1, "b": 2}, False) == fingerprint({"b": 2, "a": 1}, False)
    assert fingerprint(0.0, False) != fingerprint(-0.0, False)
    assert fingerprint(1, False) != fingerprint(1.0, False) != fingerprint(True, False)
    assert fingerprint((jnp.tanh,), False) != fingerprint((jnp.sin,), False)


def test_code_that_no_version_names_is_refused_and_still_computed(folder):
    class Own(eqx.Module):
        size: float

        def __call__(self, x):
            return self.size * x

    itself = []
    itself.append(itself)
    for unknown in (Own(2.0), lambda x: x, partial(_double), itself, object(), jax.random.key(0)):
        with pytest.raises(NotDescribable):
            fingerprint(unknown, False)
    apply = compiled(lambda law, x: law(x))
    np.testing.assert_array_equal(apply(Own(2.0), np.arange(3.0)), [0.0, 2.0, 4.0])
    np.testing.assert_array_equal(apply(Own(3.0), np.arange(3.0)), [0.0, 3.0, 6.0])
    assert not programs(folder)


def test_a_program_inside_of_a_transformation_is_differentiated():
    square = compiled(_square)
    assert float(jax.grad(square)(3.0 * jnp.ones(()))) == 6.0
    np.testing.assert_array_equal(jax.vmap(square)(jnp.arange(3.0)), [0.0, 1.0, 4.0])


def _square(x):
    return x * x


def test_it_is_pickled_by_its_name_as_a_function_is():
    assert pickle.loads(pickle.dumps(with_sensitivities)) is with_sensitivities


@pytest.mark.slow
def test_shapes_and_types_have_programs_of_their_own(folder):
    double = compiled(_double, made_from="this test")
    for x in (np.arange(2.0), np.arange(3.0), np.arange(3), np.float64(1.0)):
        result = double(x)
        np.testing.assert_array_equal(result, 2.0 * x)
        assert result.dtype == (2.0 * jnp.asarray(x)).dtype
    assert len(programs(folder)) == 4
    forget_programs()
    np.testing.assert_array_equal(double(np.arange(3.0)), [0.0, 2.0, 4.0])
