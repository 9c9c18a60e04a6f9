"""Sums that stay inside the loop they stand in, against those that XLA hands to a library.

One prediction of start-ups with the sensitivities to the terms of a trial law, compiled both ways
and run by turns in one process; the numbers must agree. The ratio is of least seconds of processor.

    python benchmarks/whole_loops.py
    python benchmarks/whole_loops.py --modes 14 --runs 8 --terms 2,5,8
"""

import argparse
import time

import numpy as np


def main() -> None:
    """Print milliseconds of both ways for each number of terms, and their ratio."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--modes", type=int, default=14)
    parser.add_argument("--runs", type=int, default=8)
    parser.add_argument("--terms", default="1,2,3,5,8")
    parser.add_argument("--repeats", type=int, default=7)
    options = parser.parse_args()
    from discover.precision import enable_x64

    enable_x64()
    import jax
    import jax.numpy as jnp

    from discover.learners.trajectories.sensitivities import observe
    from discover.programs.program_cache import _whole_loops

    problem = problem_of(options.runs, options.modes)
    print(f"{options.runs} runs, {options.modes} modes, {problem.flows.n_steps} steps")
    for terms in map(int, options.terms.split(",")):
        trial = problem, jnp.arange(terms), jnp.full(terms, 0.01), jnp.zeros(0)
        ways = {
            name: jax.jit(observe, compiler_options=asked)
            for name, asked in {"as XLA does": None, "whole loops": _whole_loops() or None}.items()
        }
        found = {name: way(*trial) for name, way in ways.items()}
        agree = all(
            np.allclose(one, other, rtol=1e-9, atol=1e-12)
            for one, other in zip(*found.values(), strict=True)
        )
        seconds: dict[str, list[float]] = {name: [] for name in ways}
        for _ in range(options.repeats):
            for name, way in ways.items():
                started = time.process_time()
                jax.block_until_ready(way(*trial))
                seconds[name].append(time.process_time() - started)
        old, new = (1e3 * min(values) for values in seconds.values())
        said = "agree" if agree else "DIFFER"
        print(f"{terms:3d} terms: {old:7.1f} and {new:7.1f} ms, ratio {old / new:.1f}, {said}")


def problem_of(runs: int, modes: int):
    """Return what sparse regression fits, of start-ups of a fluid with so many modes."""
    from discover.laws.registry import make_law
    from discover.learners.trajectories.problem import make_problem
    from discover.protocols import start_up
    from discover.simulate import synthetic_dataset
    from tensor_library import build_library

    flows = {
        f"rate_{i}": start_up(float(rate)) for i, rate in enumerate(np.geomspace(0.3, 3, runs))
    }
    data = synthetic_dataset("giesekus", {"alpha": 0.2}, flows, noise=0.01, seed=0, n_samples=101)
    return make_problem(
        data.runs,
        build_library(degree=1),
        np.full(modes, 1.0 / modes),
        np.geomspace(1.0, 0.01, modes),
        base=make_law("ucm"),
    )


if __name__ == "__main__":
    main()
