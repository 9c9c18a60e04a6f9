"""Results of learners, and files of estimators that others made."""

import io
import json
import os
import resource
import zipfile

import jax.numpy as jnp
import numpy as np
import pytest
import sympy

import discover as dc
from discover.laws.expansion import law_of_terms
from discover.laws.textbook.giesekus import Giesekus
from discover.learners import LearnerResult, RecoveredTerm
from tensor_library.law_terms import LawTerms
from tensor_library.symbolic import STRESS, Trace

EXPONENTIAL = "(exp(epsilon*tr(sigma))-1)*sigma"


def result(base=None):
    terms = (
        RecoveredTerm("sigma.sigma", 0.25, coefficient_penalised=0.24, ci95=(0.2, 0.3)),
        RecoveredTerm(EXPONENTIAL, 1.0, inner={"epsilon": 0.5}),
    )
    law = law_of_terms(LawTerms.of(terms), True, base)
    history = (np.arange(1, 3), np.array([1.0, 0.1]))
    return LearnerResult("tensor_sindy", law, terms, 1.0, history, {}, "ended <b>well</b>")


def test_the_sympy_form_is_the_extra_term():
    wanted = 0.25 * STRESS**2 + (sympy.exp(0.5 * Trace(STRESS)) - 1) * STRESS
    assert sympy.expand(result().sympy() - wanted) == 0


def test_the_table_has_a_line_for_each_term_with_its_interval():
    table = result().table()
    assert table["term"].tolist() == ["sigma.sigma", EXPONENTIAL]
    assert table.loc[0, ["low", "high"]].tolist() == [0.2, 0.3]
    assert np.isnan(table.loc[1, "low"])
    assert table.loc[1, "inner"] == "epsilon = 0.5"


def test_a_notebook_shows_equation_and_table_and_escapes_text():
    shown = result()._repr_html_()
    assert "<math" in shown
    assert "<table" in shown
    assert "<b>well</b>" not in shown
    assert r"\epsilon = 0.5" in result().latex()


def test_the_equation_holds_the_known_law_below():
    equation = result(Giesekus(0.1)).equation()
    found = {t.term: t.coefficient for t in equation.terms}
    assert abs(found["sigma.sigma"] - 0.35) < 1e-12
    stress, rate = jnp.asarray([0.3, 0.1, -0.1, 0.5]), jnp.asarray([0.0, 0.0, 0.0, 1.0])
    np.testing.assert_allclose(
        equation.law().extra_term(stress, rate),
        result(Giesekus(0.1)).law.extra_term(stress, rate),
        rtol=1e-12,
    )


HEADER = {
    "format": "discover estimator", "version": 1, "learner": "tensor_sindy", "parameters": {},
    "fitted": {},
}  # fmt: skip


def array_file(shape, content=b""):
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        stream, {"descr": "<f8", "fortran_order": False, "shape": shape}
    )
    return stream.getvalue() + content


def write(path, members, compression=zipfile.ZIP_DEFLATED):
    with zipfile.ZipFile(path, "w", compression) as file:
        for name, content in members.items():
            file.writestr(name, content)
    return path


def swelling(path):
    # 400 MB of zeros in half a megabyte
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("estimator.json", json.dumps(HEADER))
        with file.open("array0.npy", "w", force_zip64=True) as stream:
            for _ in range(400):
                stream.write(bytes(1_000_000))


def many(path):
    write(path, {"estimator.json": json.dumps(HEADER)} | {f"a{i}": "" for i in range(10_001)})


def deep(path):
    write(path, {"estimator.json": "[" * 2_000_000})


def large_shape(path):
    write(path, {"estimator.json": json.dumps(HEADER), "array0.npy": array_file((10**12,))})


def overflowing_shape(path):
    write(path, {"estimator.json": json.dumps(HEADER), "a.npy": array_file((2**40, 2**40))})


def objects(path):
    stream = io.BytesIO()
    np.lib.format.write_array(stream, np.array([{}]), allow_pickle=True)
    write(path, {"estimator.json": json.dumps(HEADER), "a.npy": stream.getvalue()})


def no_head(path):
    raw = b"\x93NUMPY\1\0" + (9001).to_bytes(2, "little") + b"(" * 9000 + b"\n"
    write(path, {"estimator.json": json.dumps(HEADER), "a.npy": raw})


def otherwise_packed(path):
    write(path, {"estimator.json": json.dumps(HEADER)}, zipfile.ZIP_LZMA)


def encrypted(path):
    write(path, {"estimator.json": json.dumps(HEADER)}, zipfile.ZIP_STORED)
    raw = bytearray(path.read_bytes())
    for mark, offset in ((b"PK\3\4", 6), (b"PK\1\2", 8)):  # the flags of a member, twice
        raw[raw.index(mark) + offset] |= 1
    path.write_bytes(raw)


@pytest.mark.parametrize(
    "make",
    [
        swelling,
        many,
        deep,
        large_shape,
        overflowing_shape,
        objects,
        no_head,
        otherwise_packed,
        encrypted,
    ],
    ids=lambda make: make.__name__,
)
def test_a_file_that_would_fill_the_memory_or_run_something_is_refused(make, tmp_path):
    path = tmp_path / "law.discover"
    make(path)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(dc.InputError):
        dc.load(path)
    # kilobytes: the largest of these is refused for 256 MB, and is never unpacked
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 200_000


def test_a_pipe_or_a_device_is_no_file(tmp_path):
    pipe = tmp_path / "law.discover"
    os.mkfifo(pipe)
    for path in (pipe, "/dev/zero", tmp_path):
        with pytest.raises(dc.InputError, match=r"pipe or device|folder"):
            dc.load(path)


def test_a_file_that_was_saved_is_read(tmp_path):
    data = dc.synthetic_dataset("ucm", n_samples=21)
    law = dc.TensorSINDy(library=dc.build_library(["sigma"], degree=0)).fit(data)
    path = law.save(tmp_path / "law.discover")
    np.testing.assert_array_equal(dc.load(path).predict(data)[0], law.predict(data)[0])
