"""How many threads a product of matrices takes, in a process that begins."""

import os
import subprocess
import sys

import pytest

ASK = """
import numpy, scipy.linalg
from threadpoolctl import threadpool_info
before = {each["num_threads"] for each in threadpool_info()}
import discover
untouched = before == {each["num_threads"] for each in threadpool_info()}
discover.make_law("ucm")
print(untouched, *sorted({each["num_threads"] for each in threadpool_info()}))
"""


@pytest.mark.parametrize(("chosen", "threads"), [(None, "1"), ("2", "2")])
def test_a_product_takes_one_thread_from_the_first_use_on_unless_the_user_chose(chosen, threads):
    if (os.cpu_count() or 1) < 2:
        pytest.skip("OpenBLAS takes no more threads than there are cores")
    environment = {k: v for k, v in os.environ.items() if not k.endswith("_NUM_THREADS")}
    if chosen:
        environment["OPENBLAS_NUM_THREADS"] = chosen
    found = subprocess.run(
        [sys.executable, "-c", ASK], env=environment, capture_output=True, text=True, check=True
    )
    assert found.stdout.split() == ["True", threads]
