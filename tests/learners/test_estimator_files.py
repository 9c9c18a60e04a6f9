"""A file of an estimator is bounded by what it says of itself, and runs nothing."""

import gzip
import json
import os
import resource

import numpy as np
import pytest

import discover as dc
from discover.learners.files import FORMAT, VERSION


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
