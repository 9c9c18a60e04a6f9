"""Double precision, strict types and shapes for every test."""

import gc
import importlib
import importlib.metadata
import os
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import jaxtyping
import pytest
from threadpoolctl import threadpool_limits

# Where bytecode may not lie beside its source, each of some hundred processes that tests start
# compiles JAX and all else anew, three quarters of its time.
if sys.dont_write_bytecode:
    sys.dont_write_bytecode = False
    sys.pycache_prefix = str(Path(__file__).parents[1] / ".pytest_cache" / "bytecode")
    del os.environ["PYTHONDONTWRITEBYTECODE"]
    os.environ["PYTHONPYCACHEPREFIX"] = sys.pycache_prefix

# OpenBLAS lets a thread for each core spin while it waits for the next of many small products: with
# a worker on each core that takes ten times the work itself. The variable is for processes begun
# from here, and for SciPy's library; NumPy's is there already, brought by a plugin of pytest.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
threadpool_limits(1, "blas")

# Tracing makes millions of small objects, and each full collection walks all that JAX remembers.
gc.set_threshold(100_000, 50, 100)

# helper modules, for tests are imported by path and not as packages; the mutations of files are the
# benchmark's
_HERE = Path(__file__).parent
sys.path += [str(folder) for folder in (_HERE, *_HERE.iterdir()) if folder.is_dir()]
sys.path.append(str(_HERE.parent / "benchmarks"))

first_calls = importlib.import_module("first_calls")
fewer_hypotheses = importlib.import_module("fewer_hypotheses")

# What is first imported inside a module under the hook below is compiled anew, in every worker.
_LARGE = ("jax", "pandas", "scipy.stats", "sklearn.base", "matplotlib.figure", "pydantic")


def _import_what_tests_need() -> None:
    for large in _LARGE:
        importlib.import_module(large)
    # Shapes written on public functions are checked while the tests run. The hook must come before
    # the packages are imported.
    first_calls.install()
    jaxtyping.install_import_hook(["tensor_library", "discover"], "beartype.beartype")
    importlib.import_module("discover.first_use").enable_x64()
    # shared by the workers of one test run, and by the next run
    folder = Path(__file__).parents[1] / ".pytest_cache" / "compiled"
    importlib.import_module("discover.compilation_cache").enable_compilation_cache(folder)


@pytest.fixture(autouse=True, scope="module")
def _shapes() -> None:
    """Check shapes on the first calls of every function in each file."""
    first_calls.begin_file()


@pytest.fixture(autouse=True, scope="module")
def panels(request: pytest.FixtureRequest) -> Iterator[None]:
    """Draw sooner where pictures are not looked at; a file that looks at them overrides this."""
    with pytest.MonkeyPatch.context() as patch:
        if _compiles_soon(request.config):
            fewer_hypotheses.panels_in_a_grid(patch)
        yield


@pytest.fixture
def as_users_run_it() -> Iterator[None]:
    """Leave annotations unchecked: with the check a wrong type ends before the code under test."""
    before = jaxtyping.config.jaxtyping_disable
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", before)


# files of a quarter of a minute and more, with slow tests or without, the longest first; what
# shares programs stands apart, so that one worker finds what the other compiled
_LONG = (
    "test_notebooks.py", "test_simple_material.py", "test_engine_worlds.py", "test_many_vectors.py",
    "test_import.py", "test_reports.py", "test_kills_and_clusters.py", "test_transducers.py",
    "test_posterior.py", "test_commands.py", "test_hostile_rules.py", "test_contract_script.py",
    "test_named_law.py", "test_pages_of_the_guide.py", "test_constants_by_mode.py", "test_loop.py",
    "test_pages.py", "test_structure.py", "test_tbnn_training.py", "test_tensor_sindy_estimator.py",
    "test_estimators.py", "test_rolie_poly_blend.py", "test_modulus_errors.py",
    "test_flows_of_fluids.py", "test_law_choice.py", "test_controls_side_by_side.py",
    "test_malformed_inputs.py",
)  # fmt: skip


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the choice of running everything."""
    parser.addoption("--whole", action="store_true", help="run the tests marked slow too")


# no optimising, one piece of code a program instead of as many as there are threads, and the older
# emitters, which are sooner done; XLA ends a process that names a flag that its version lacks
_COMPILED_SOON = (
    "--xla_backend_optimization_level=0 --xla_cpu_parallel_codegen_split_count=1 "
    "--xla_cpu_use_fusion_emitters=false"
)
_KNOWN_TO = ("0.10",)


def pytest_configure(config: pytest.Config) -> None:
    """Import what tests need where they run; compile sooner if slow ones are left out.

    Most programs of the others run for milliseconds, and LLVM takes longer over them than they do.
    So nothing is optimised, and code holds the effects that a model asks for and not all that
    another may ask for, which takes a tenth of the time (`code_of_every_effect` for what is said of
    that). A release runs the slow ones too, compiled as users have them.
    """
    if _compiles_soon(config):
        os.environ["XLA_FLAGS"] = f"{_COMPILED_SOON} {os.environ.get('XLA_FLAGS', '')}".strip()
    if not _leaves_tests_to_workers(config):
        _import_what_tests_need()
        if _compiles_soon(config):
            # of a law in three modes the code runs as fast, and takes half of the time to make
            importlib.import_module("discover.programs.lanes.machine_code")._LEVELS = 0, 1
            fewer_hypotheses.code_of_what_is_asked()


def _leaves_tests_to_workers(config: pytest.Config) -> bool:
    """Return whether this is the process of pytest-xdist that neither collects nor runs a test."""
    shared_out = config.getoption("numprocesses", None) and not config.option.collectonly
    return bool(shared_out) and not hasattr(config, "workerinput")


class _InTurn(ThreadPoolExecutor):
    """What stands for a pool of threads where each core has a worker: there is none to spare."""

    map = staticmethod(map)  # pyright: ignore[reportAssignmentType]


def pytest_collection_finish(session: pytest.Session) -> None:
    """Call programs in turn; all tests are imported, in a worker, by now."""
    if hasattr(session.config, "workerinput"):
        # to start threads for every call of a program takes a tenth of a fit's processor
        importlib.import_module("discover.programs.compiler").ThreadPoolExecutor = _InTurn


def pytest_unconfigure() -> None:
    """Spare pytest's last search for garbage what JAX remembers: it ends with the process."""
    gc.freeze()


def _compiles_soon(config: pytest.Config) -> bool:
    version = importlib.metadata.version("jax").rpartition(".")[0]
    return _leaves_slow_out(config) and version in _KNOWN_TO


def _leaves_slow_out(config: pytest.Config) -> bool:
    """Return whether nobody asks for slow tests, by --whole, -m or a file's name."""
    asked = config.getoption("--whole") or config.getoption("-m")
    return not asked and all(Path(name.split("::")[0]).is_dir() for name in config.args)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave what is slow out unless it is asked for.

    Let long files begin first, so that no worker waits for another at the end.
    """
    if _leaves_slow_out(config):
        left = [item for item in items if item.get_closest_marker("slow")]
        config.hook.pytest_deselected(items=left)
        items[:] = [item for item in items if not item.get_closest_marker("slow")]
    place = {name: i for i, name in enumerate(_LONG)}
    items.sort(key=lambda item: place.get(item.path.name, len(_LONG)))


@pytest.fixture(scope="module")
def without_curves() -> Iterator[None]:
    """Let loops of a module try no free curves, which are half of their time.

    Where candidates explain the records none is found; `tests/inference/test_engine_worlds.py` has
    records in which there are some.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("discover.loop.loop.free_functions", lambda posterior: [])
        yield


@pytest.fixture
def code_of_every_effect(monkeypatch) -> None:
    """Let code hold every effect, as users have it, whatever a model asks for."""
    every = importlib.import_module("discover.effects").built_in_effects()
    monkeypatch.setattr(fewer_hypotheses, "ALSO", set(every))


@pytest.fixture(scope="module")
def verdict_alone() -> Iterator[None]:
    """Let loops and comparisons of a module neither design a test nor say what laws have in common.

    Both have tests of their own and stand on the pages of `tests/report`.
    """
    with pytest.MonkeyPatch.context() as patch:
        fewer_hypotheses.verdict_alone(patch)
        yield


@pytest.fixture(scope="session")
def measured_data() -> Path:
    """Return the folder of measured data sets, or skip and say why."""
    folder = os.environ.get("DISCOVER_DATA")
    if not folder or not Path(folder).is_dir():
        pytest.skip(
            "measured data are not part of the project: set DISCOVER_DATA to the folder that "
            "holds pi95k-startup, gel-laos and blood-steps"
        )
    return Path(folder)
