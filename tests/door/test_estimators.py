"""Fitted estimators survive every way out of a process, and files of them run nothing."""

import copy
import gzip
import json
import os
import pickle
import resource
import subprocess
import sys
import zipfile

import jax
import numpy as np
import pytest
from independent_folder import MOBILITY, write_folder
from sklearn.base import clone
from sklearn.exceptions import NotFittedError
from sklearn.model_selection import cross_validate

import discover as dc
from discover.laws import TensorBasisNetwork
from discover.learners import LearnerResult, RecoveredTerm
from discover.learners.files import FORMAT, VERSION, provenance_of
from tensor_library import parse_term
from tensor_library.library import TermLibrary

LIBRARY = TermLibrary((parse_term("sigma.sigma"), parse_term("tr(sigma)*sigma")))


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    return dc.load_dataset(write_folder(tmp_path_factory.mktemp("door") / "melt"))


@pytest.fixture(scope="module")
def base(data):
    return dc.Fluid.from_sweep(data.linear_sweep)


@pytest.fixture(scope="module")
def sindy(data, base):
    made = dc.TensorSINDy(library=LIBRARY, max_terms=1, base=base)
    return made.fit(data.split(["fast.csv"])[0])


@pytest.fixture(scope="module")
def network(data, base):
    """As if trained: two members with random weights, one with a law beneath it."""
    train = data.split(["fast.csv"])[0]
    laws = [
        jax.tree.map(lambda leaf: 0.1 * leaf if eqx_array(leaf) else leaf,
                     TensorBasisNetwork.initialise(jax.random.key(seed), 6))
        for seed in (0, 1)
    ]  # fmt: skip
    made = dc.TBNNUDE(base=base, n_members=2, recipe="paper")
    made.n_features_in_, made.members_, made.ensemble_ = 1, laws, "made by a test"
    made.law_, made.fitting_ = laws[0], laws
    made.fluid_, *_ = made.ensemble_fluids_ = [
        dc.Fluid(law, base.modulus, base.relaxation_time) for law in laws
    ]
    made.terms_ = (RecoveredTerm("sigma.sigma", 0.3, ci95=(0.2, 0.4)),)
    made.runs_, made.provenance_ = train.runs, provenance_of(train, train.runs)
    details = {"recipe": "PaperRecipe", "misfit": np.float64(0.1), "members": [{"misfit": 1.0}]}
    made.result_ = LearnerResult("tbnn_ude", laws[0], made.terms_, 1.0, details, "done")
    return made


def eqx_array(leaf):
    return isinstance(leaf, jax.Array)


def test_a_base_is_modulus_time_and_law_at_once_and_the_covariance_says_an_interval(sindy):
    (term,), ((variance,),) = sindy.terms_, sindy.covariance_
    assert term.term == "sigma.sigma"
    assert term.coefficient == pytest.approx(MOBILITY, abs=0.03)  # planted by scipy
    half = 1.96 * np.sqrt(variance)
    np.testing.assert_allclose(term.ci95, [term.coefficient - half, term.coefficient + half], 1e-4)


def test_a_fit_has_an_equation_and_a_score_that_is_one_less_the_error(sindy, base, data):
    equation = sindy.equation_
    assert equation.modulus == tuple(map(float, base.modulus))
    assert r"\sigma" in equation.latex()
    with pytest.raises(NotFittedError):
        dc.TensorSINDy().save("nowhere")
    run = data["fast.csv"]
    missed = sindy.predict([run]) - run.stress
    error = np.linalg.norm(missed) / np.linalg.norm(run.stress)
    assert sindy.score([run]) == pytest.approx(1.0 - error)
    assert 0.98 < sindy.score([run]) < 1.0  # noise of half a per cent


@pytest.mark.parametrize("which", ["sindy", pytest.param("network", marks=pytest.mark.slow)])
def test_an_estimator_is_the_same_after_every_way(which, request, data, tmp_path):
    fitted = request.getfixturevalue(which)
    expected = fitted.predict(data)
    saved = dc.load(fitted.save(tmp_path / "law.discover"))
    for way in (pickle.loads(pickle.dumps(fitted)), copy.deepcopy(fitted), saved):
        np.testing.assert_allclose(way.predict(data), expected, rtol=1e-12, atol=0)
        assert way.terms_ == fitted.terms_
        assert way.provenance_ == fitted.provenance_
        assert way.equation_ == fitted.equation_
        assert set(way.result_.details) == set(fitted.result_.details)
        assert way.score(data) == pytest.approx(fitted.score(data), rel=1e-12)
    assert not hasattr(saved, "runs_")  # a file holds no data
    fresh = clone(saved)
    assert not hasattr(fresh, "fluid_")
    assert repr(fresh.get_params()) == repr(fitted.get_params())
    assert len(repr(fitted)) < 1000


def test_a_file_holds_plain_json_and_what_it_cannot_hold_leaves_the_old(sindy, network, tmp_path):
    for fitted in (sindy, network):
        content = json.loads(gzip.decompress(fitted.save(tmp_path / "law.discover").read_bytes()))
        assert content["version"] == 3
        assert content["fitted"]["provenance_"]["fields"]["data"] == "melt"
    path = sindy.save(tmp_path / "law.discover")
    before = path.read_bytes()
    other = copy.copy(sindy).set_params(optimizer=object())
    with pytest.raises(dc.InputError, match="'optimizer' is a object"):
        other.save(path)
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["law.discover"]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"version": 1}, "reads the form 3"),
        ({"format": "other"}, "not a complete estimator"),
        ({"learner": "magic"}, "of the kind 'magic'"),
        ({"fitted": {}}, "is damaged"),
        ({"parameters": {"gremlins": 1}}, "is damaged"),
        ({"parameters": {"base": {"kind": "os.system", "fields": {}}}}, "is damaged"),
    ],
)
def test_a_file_that_is_no_estimator_is_refused_with_a_reason(sindy, tmp_path, changes, message):
    path = sindy.save(tmp_path / "law.discover")
    content = json.loads(gzip.decompress(path.read_bytes())) | changes
    path.write_bytes(gzip.compress(json.dumps(content).encode()))
    with pytest.raises(dc.InputError, match=message):
        dc.load(path)


def test_files_of_other_kinds_folders_and_pipes_are_refused(sindy, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path, said in (
        (tmp_path / "gone.discover", "There is no file"), ("/dev/zero", "pipe or device"),
        (tmp_path, r"is a folder\. Give the file that estimator\.save"),
        (tmp_path / "pipe", "pipe or device"),
    ):  # fmt: skip
        with pytest.raises(dc.InputError, match=said):
            dc.load(path)
    for path in (tmp_path, ".", ""):
        with pytest.raises(dc.InputError, match=r"is a folder\. Name a file"):
            sindy.save(path)
    with pytest.raises(dc.InputError, match=r"There is no folder .*absent"):
        sindy.save(tmp_path / "absent" / "law.discover")
    assert [path.name for path in tmp_path.iterdir()] == ["pipe"]
    whole = sindy.save(tmp_path / "law.discover").read_bytes()
    flipped = bytearray(whole)
    flipped[200] ^= 0xFF
    packed = map(gzip.compress, (b"{", b"[1]", b"\xff"))
    others = b"", b"time_s\n", pickle.dumps({}), whole[: len(whole) // 2], bytes(flipped)
    for content in (*others, *packed):
        (tmp_path / "other").write_bytes(content)
        with pytest.raises(dc.InputError, match=r"not a complete estimator|is damaged"):
            dc.load(tmp_path / "other")
    with zipfile.ZipFile(tmp_path / "before", "w") as file:
        file.writestr("estimator.json", "{}")
    with pytest.raises(dc.InputError, match=r"an earlier version in the form 1 or 2.*fit again"):
        dc.load(tmp_path / "before")


FRESH = """
import pickle, sys
fitted = pickle.load(open(sys.argv[1], "rb"))  # names nothing of discover
import jax
last = float(fitted.predict(fitted.runs_)[-1])
print(jax.config.jax_enable_x64, fitted.fluid_.modulus.dtype, repr(last))
"""


@pytest.mark.slow
def test_a_process_that_only_unpickles_computes_in_double_precision(sindy, tmp_path, monkeypatch):
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", str(jax.config.jax_compilation_cache_dir))
    (tmp_path / "fitted.pickle").write_bytes(pickle.dumps(sindy))
    told = subprocess.run(
        [sys.executable, "-c", FRESH, str(tmp_path / "fitted.pickle")],
        capture_output=True, text=True, timeout=300, check=True,
    ).stdout.split()  # fmt: skip
    assert told[:2] == ["True", "float64"]
    # single precision would be off by 1e-7
    assert float(told[2]) == pytest.approx(sindy.predict(sindy.runs_)[-1], rel=1e-12)


@pytest.mark.slow
def test_cross_validation_in_two_processes_equals_that_in_one(data, base, monkeypatch):
    # workers find the programs that this process has compiled
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", str(jax.config.jax_compilation_cache_dir))
    folds = [([0, 1], [2]), ([1, 2], [0])]
    made = dc.TensorSINDy(library=LIBRARY, max_terms=1, base=base)
    serial, parallel = (
        cross_validate(made, data, cv=folds, n_jobs=jobs, return_estimator=True) for jobs in (1, 2)
    )
    np.testing.assert_allclose(parallel["test_score"], serial["test_score"], rtol=1e-12)
    for one, other in zip(serial["estimator"], parallel["estimator"], strict=True):
        assert other.fluid_.modulus.dtype == np.float64
        np.testing.assert_allclose(other.coefficients_, one.coefficients_, rtol=1e-12)


def holding(dtype, shape, numbers=(1.0,)):
    array = {"kind": "array", "dtype": dtype, "shape": shape, "numbers": list(numbers)}
    return json.dumps(
        {"format": FORMAT, "version": VERSION, "learner": "tensor_sindy",
         "parameters": {"modulus": array}, "fitted": {}}
    )  # fmt: skip


@pytest.mark.parametrize(
    "content",
    [
        " " * 300_000_000,  # 300 MB in a third of one
        "[" * 2_000_000,
        "[" + "{}," * 1_000_001,
        "[" * 100_000 + "]" * 100_000,
        holding("<f8", [10**12]),
        holding("<f8", [2**40, 2**40]),
        holding("|O", [1]),
        holding("<U999999999", [1]),
        holding("<i8", [1], [10**400]),
        holding("no type", [1]),
    ],
    ids=["swelling", "long", "many", "deep", "large", "overflowing", "objects", "text", "huge",
         "no type"],
)  # fmt: skip
def test_a_file_that_would_fill_the_memory_or_run_something_is_refused(content, tmp_path):
    path = tmp_path / "law.discover"
    path.write_bytes(gzip.compress(content.encode(), 1))
    del content
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(dc.InputError, match="is damaged"):
        dc.load(path)
    # kilobytes: no more than the limit of 2^28 bytes is unpacked
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 300_000
