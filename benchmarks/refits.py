"""Refitting the supports of a search: eight to a program by `vmap`, or one to each, in threads.

Every refit of one discovery is recorded and done again both ways in one process, by turns; the
misfits must agree. A batch takes as many steps as its slowest member, and is as large when it is
not full. The ratio is of medians.

    python benchmarks/refits.py --repeats 3
"""

import argparse
import time

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from discover.compilation_cache import enable_compilation_cache
from discover.precision import enable_x64

JOBS_AT_ONCE = 8


def recorded(library, data) -> list[tuple]:
    """Return the arguments of every call of `refit` in one discovery."""
    from discover.learners.tensor_sindy import TensorSINDy, search

    calls, refit = [], search.refit

    def listen(*arguments):
        calls.append(arguments)
        return refit(*arguments)

    search.refit = listen
    try:
        TensorSINDy(library, n_stability=0, n_folds=0).fit(data)
    finally:
        search.refit = refit
    return [call for call in calls if call[1]]


def batches(call):
    """Return layouts, starts and the number of supports of each padded batch of a call."""
    from discover.learners.tensor_sindy.refit import _lay_out

    problem, supports, starts, scale, slots, keeps, _ = call
    everything = np.ones(problem.records.recorded.shape[:2], dtype=bool)
    keeps = [everything] * len(supports) if keeps is None else keeps
    jobs = list(zip(supports, starts, keeps, strict=True))
    nothing = ((), starts[0], everything)
    for first in range(0, len(jobs), JOBS_AT_ONCE):
        some = jobs[first : first + JOBS_AT_ONCE]
        padded = [*some, *[nothing] * (JOBS_AT_ONCE - len(some))]
        laid_out = [_lay_out(problem, s, begin, scale, slots, keep) for s, begin, keep in padded]
        layouts, begins = jax.tree.map(lambda *leaves: jnp.stack(leaves), *laid_out)
        yield layouts, begins, len(some)


def main() -> None:
    """Print seconds of both ways, wall and processor, and their ratio."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    enable_x64()
    enable_compilation_cache()
    from discover.learners.tensor_sindy.refit import _descend, refit
    from discover.simulate import synthetic_dataset
    from tensor_library import build_library

    library = build_library(degree=1, closed_forms=("exp",))
    calls = recorded(library, synthetic_dataset("giesekus", {"alpha": 0.2}, noise=0.02, seed=1))
    n_supports = sum(len(call[1]) for call in calls)

    @eqx.filter_jit
    def together(problem, layouts, starts, tolerance):
        one = lambda layout, start: _descend(problem, layout, start, tolerance)  # noqa: E731
        return jax.vmap(one)(layouts, starts)

    def by_vmap():
        predicted = []
        for call in calls:
            for layouts, starts, count in batches(call):
                found = together(call[0], layouts, starts, jnp.asarray(call[6]))
                predicted += list(np.asarray(found[1])[:count])
        return predicted

    def one_by_one():
        return [fit.predicted for call in calls for fit in refit(*call)]

    ways = {"vmap": by_vmap, "threads": one_by_one}
    made = {name: way() for name, way in ways.items()}
    agree = [
        float(np.linalg.norm(a - b)) < 1e-4 * max(float(np.linalg.norm(b)), 1.0)
        for a, b in zip(made["vmap"], made["threads"], strict=True)
    ]
    seconds: dict[str, list] = {name: [] for name in ways}
    for _ in range(options.repeats):
        for name, way in ways.items():
            wall, processor = time.perf_counter(), time.process_time()
            way()
            seconds[name].append((time.perf_counter() - wall, time.process_time() - processor))
    median = {name: np.median(values, axis=0) for name, values in seconds.items()}
    print(f"{n_supports} supports in {len(calls)} calls; {sum(agree)} predict the same to 1e-4")
    for name, (wall, processor) in median.items():
        print(f"{name:>8}: {wall:7.2f} s wall, {processor:7.2f} s of processor")
    wall, processor = median["vmap"] / median["threads"]
    print(f"   ratio: {wall:7.1f} wall, {processor:7.1f} of processor")


if __name__ == "__main__":
    main()
