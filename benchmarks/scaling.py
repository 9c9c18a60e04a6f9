"""What a sparse discovery costs as its problem grows: time and memory, with fitted exponents.

One thing grows at a time: runs, samples a run, relaxation modes, terms of the library. Each size is
a process of its own, so that its memory is its own; timed is the second of two discoveries, so that
nothing is compiled in it. The exponent is the slope of a line through the logarithms.

    python benchmarks/scaling.py
    python benchmarks/scaling.py --axes samples,terms
"""

import argparse
import json
import resource
import subprocess
import sys
import time

import numpy as np

AXES = {
    "runs": (2, 4, 8, 16),
    "samples": (51, 101, 201, 401),
    "modes": (1, 2, 4, 8),
    "terms": (8, 32, 65, 130, 288),
}
BASE = {"runs": 8, "samples": 101, "modes": 1, "terms": 65}


def flows(count: int) -> dict:
    """Return oscillations of growing amplitude and frequency."""
    from discover.protocols import oscillatory_shear

    amplitudes = np.linspace(1.0, 2.0, count)
    frequencies = np.linspace(0.25, 1.0, count)
    return {
        f"laos_{i}": oscillatory_shear(float(a), float(w))
        for i, (a, w) in enumerate(zip(amplitudes, frequencies, strict=True))
    }


def measure(size: dict[str, int]) -> dict[str, float]:
    """Return seconds of a warm discovery and the memory of the process in MB."""
    from discover.compilation_cache import enable_compilation_cache
    from discover.learners.tensor_sindy import TensorSINDy
    from discover.precision import enable_x64
    from discover.simulate import synthetic_dataset
    from tensor_library import TermLibrary, build_library

    enable_x64()
    enable_compilation_cache()
    runs = flows(size["runs"])
    library = build_library(degree=2 if size["terms"] > 65 else 1, closed_forms=("exp",))
    names = [term.name for term in library.terms]
    kept = ["sigma.sigma", *[n for n in names if n != "sigma.sigma"][: size["terms"] - 1]]
    library = TermLibrary(tuple(t for t in library.terms if t.name in kept))
    modulus = np.full(size["modes"], 1.0 / size["modes"])
    times = np.geomspace(1.0, 0.1, size["modes"])
    seconds = 0.0
    for seed in (0, 1):
        data = synthetic_dataset(
            "giesekus", {"alpha": 0.2}, runs, noise=0.01, seed=seed, n_samples=size["samples"]
        )
        learner = TensorSINDy(
            library, modulus=modulus, relaxation_time=times, n_folds=0, n_stability=0
        )
        started = time.process_time()
        learner.fit(data)
        seconds = time.process_time() - started
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return {"terms": len(library.terms), "seconds": seconds, "memory": memory}


def main() -> None:
    """Print a table and an exponent for each axis."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--axes", default=",".join(AXES))
    parser.add_argument("--one", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print(json.dumps(measure(json.loads(options.one))))
        return
    for axis in options.axes.split(","):
        sizes, seconds, memory = [], [], []
        for value in AXES[axis]:
            size = BASE | {axis: value}
            said = subprocess.run(
                [sys.executable, __file__, "--one", json.dumps(size)],
                check=True,
                capture_output=True,
                text=True,
            )
            found = json.loads(said.stdout.splitlines()[-1])
            sizes.append(found["terms"] if axis == "terms" else value)
            seconds.append(found["seconds"])
            memory.append(found["memory"])
            print(
                f"{axis:>8} {sizes[-1]:4d}: {seconds[-1]:7.2f} s of processor, "
                f"{memory[-1]:6.0f} MB",
                flush=True,
            )
        slope = np.polyfit(np.log(sizes), np.log(seconds), 1)[0]
        growth = np.polyfit(np.log(sizes), np.log(memory), 1)[0]
        print(f"{axis:>8}: time grows as n^{slope:.2f}, memory as n^{growth:.2f}", flush=True)


if __name__ == "__main__":
    main()
