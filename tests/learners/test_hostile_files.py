"""A file of an estimator is bounded by what it says of itself before anything is unpacked."""

import io
import json
import os
import resource
import zipfile

import numpy as np
import pytest

import discover as dc

HEADER = {
    "format": "discover estimator", "version": 2, "learner": "tensor_sindy", "parameters": {},
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
    # 300 MB of zeros in a megabyte
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as file:
        file.writestr("estimator.json", json.dumps(HEADER))
        with file.open("array0.npy", "w", force_zip64=True) as stream:
            for _ in range(300):
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
