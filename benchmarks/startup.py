"""How long the command line takes to answer, what its imports cost, and what the cache saves.

python benchmarks/startup.py
"""

import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HELP = "from discover.cli import main; main()"
STUDY = """
[data]
synthetic = { law = "giesekus", parameters = { alpha = 0.2 }, noise = 0.01 }
[compare]
learners = ["tensor_sindy"]
"""
PACKAGES = ("discover", "discover.cli", "tensor_library", "discover.learners.tensor_sindy",
            "discover.learners.tbnn_ude", "discover.loop", "discover.report")  # fmt: skip


def seconds_of(code: str, *arguments: str, **environment: str) -> float:
    """Return the seconds of one interpreter running this code."""
    started = time.perf_counter()
    subprocess.run(
        [sys.executable, "-c", code, *arguments],
        check=True,
        capture_output=True,
        env=os.environ | environment,
    )
    return time.perf_counter() - started


def dearest_imports(package: str, count: int = 4) -> str:
    """Return the modules whose own import takes longest, in ms."""
    said = subprocess.run(
        [sys.executable, "-X", "importtime", "-c", f"import {package}"],
        check=True,
        capture_output=True,
        text=True,
    ).stderr
    own: dict[str, float] = {}
    for line in said.splitlines():
        if found := re.match(r"import time:\s+(\d+) \|\s+\d+ \|\s+(\S+)", line):
            top = found[2].split(".")[0]
            own[top] = own.get(top, 0.0) + int(found[1]) / 1000
    dearest = sorted(own.items(), key=lambda pair: -pair[1])[:count]
    return ", ".join(f"{name} {spent:.0f}" for name, spent in dearest)


def main() -> None:
    """Print medians."""
    bare = statistics.median(seconds_of("pass") for _ in range(7))
    helped = statistics.median(seconds_of(HELP, "--help") for _ in range(7))
    print(f"discover --help: {helped:.2f} s (the interpreter alone {bare:.2f} s)")
    for package in PACKAGES:
        took = statistics.median(seconds_of(f"import {package}") for _ in range(3))
        print(f"import {package}: {took:.2f} s; dearest, ms: {dearest_imports(package)}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "study.toml").write_text(STUDY)
        spent = []
        for start in ("first", "second"):
            out = str(folder / start)
            arguments = ("compare", str(folder / "study.toml"), "--out", out, "--quiet")
            spent.append(seconds_of(HELP, *arguments, XDG_CACHE_HOME=str(folder / "cache")))
    print(
        f"a comparison: {spent[0]:.1f} s with an empty compilation cache, {spent[1]:.1f} s at the "
        f"second start, ratio {spent[0] / spent[1]:.1f}"
    )


if __name__ == "__main__":
    main()
