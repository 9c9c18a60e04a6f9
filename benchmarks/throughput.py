"""Many sparse discoveries: one after another on one core, a batch on all cores, and by `vmap`.

The first two run the same study files, with seeds of their own, and must find the same terms; the
ratio is of studies per second, and the aim is 0.9 times the number of cores. The third takes one
support and refits it to many noise seeds, as one program mapped over data sets and one by one.

    python benchmarks/throughput.py --studies 100
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

STUDY = """
[data]
synthetic = {{ law = "{law}", parameters = {{ {parameter} = 0.2 }}, noise = 0.01, seed = {seed} }}
[compare]
learners = ["tensor_sindy"]
high_deborah = []
next = {{ flows = ["start_up"], observe = ["N1"] }}
"""
LAWS = (("giesekus", "alpha"), ("ptt_linear", "epsilon"))


def run_batch(studies: list[Path], out: Path, workers: int, one_core: bool) -> float:
    """Return the seconds of a batch, in a process of its own."""
    code = "from discover.cli import main; main()"
    before = os.sched_getaffinity(0)
    if one_core:
        os.sched_setaffinity(0, {min(before)})  # the child inherits it
    try:
        started = time.perf_counter()
        names = [str(study) for study in studies]
        options = ["--out", str(out), "--workers", str(workers), "--quiet"]
        subprocess.run(
            [sys.executable, "-c", code, "batch", *names, *options], check=True, capture_output=True
        )
        return time.perf_counter() - started
    finally:
        os.sched_setaffinity(0, before)


def terms(out: Path) -> dict[str, list[str]]:
    """Return the terms found by study."""
    found = {}
    for path in sorted(out.rglob("comparison.json")):
        learner = json.loads(path.read_text())["learners"]["tensor_sindy"]
        found[path.parent.name] = [term["term"] for term in learner["terms"]]
    return found


def by_vmap(seeds: int, repeats: int) -> None:
    """Print what mapping one refit over data sets gains."""
    import equinox as eqx
    import jax
    import jax.numpy as jnp

    from discover.learners.tensor_sindy.refit import _descend, _lay_out
    from discover.learners.trajectories import problem as problems
    from discover.precision import enable_x64
    from discover.simulate import synthetic_dataset
    from tensor_library import build_library

    enable_x64()
    library = build_library(degree=1, closed_forms=("exp",))
    names = [term.name for term in library.terms]
    support = (names.index("sigma.sigma"), names.index("tr(sigma)*sigma"))
    made = []
    for seed in range(seeds):
        data = synthetic_dataset("giesekus", {"alpha": 0.2}, noise=0.01, seed=seed)
        made.append(problems.make_problem(data.runs, library, np.ones(1), np.ones(1)))
    everything = np.ones(made[0].records.recorded.shape[:2], dtype=bool)
    start = (np.zeros(len(library)), library.inner_default)
    scale = np.ones(len(library))
    layouts = [_lay_out(p, support, start, scale, 2, everything) for p in made]
    rest = eqx.filter(made[0], eqx.is_array, inverse=True)
    stacked = jax.tree.map(
        lambda *leaves: jnp.stack(leaves), *[eqx.filter(p, eqx.is_array) for p in made]
    )
    stacked_layouts = jax.tree.map(lambda *leaves: jnp.stack(leaves), *layouts)
    tolerance = jnp.asarray(1e-6)

    @eqx.filter_jit
    def mapped(stacked, layouts):
        def one(part, layout):
            return _descend(eqx.combine(part, rest), *layout, tolerance)

        return jax.vmap(one)(stacked, layouts)

    single = eqx.filter_jit(_descend)

    def one_by_one():
        return [single(p, *layout, tolerance)[1] for p, layout in zip(made, layouts, strict=True)]

    ways = {
        "mapped": lambda: jax.block_until_ready(mapped(stacked, stacked_layouts)[1]),
        "one by one": lambda: jax.block_until_ready(one_by_one()),
    }
    predicted = {name: way() for name, way in ways.items()}
    apart = max(
        float(np.max(np.abs(a - b)))
        for a, b in zip(predicted["mapped"], predicted["one by one"], strict=True)
    )
    seconds: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(repeats):
        for name, way in ways.items():
            started = time.perf_counter()
            way()
            seconds[name].append(time.perf_counter() - started)
    median = {name: float(np.median(values)) for name, values in seconds.items()}
    print(
        f"one support, {seeds} noise seeds: mapped {median['mapped']:.2f} s, one by one "
        f"{median['one by one']:.2f} s, ratio {median['one by one'] / median['mapped']:.2f}; "
        f"predictions differ by {apart:.1e} at most"
    )


def main() -> None:
    """Print seconds and ratios."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--studies", type=int, default=12)
    parser.add_argument("--seeds", type=int, default=16)
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    cores = len(os.sched_getaffinity(0))
    by_vmap(options.seeds, options.repeats)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        studies = []
        for seed in range(options.studies):
            law, parameter = LAWS[seed % len(LAWS)]
            path = folder / f"study_{seed:03d}.toml"
            path.write_text(STUDY.format(law=law, parameter=parameter, seed=seed))
            studies.append(path)
        # compile once before, into the cache that both use
        run_batch(studies[: len(LAWS)], folder / "first", 1, one_core=False)
        alone = run_batch(studies, folder / "alone", 1, one_core=True)
        together = run_batch(studies, folder / "together", cores, one_core=False)
        assert terms(folder / "alone") == terms(folder / "together")
    print(
        f"{options.studies} studies: one core {alone:.0f} s, {cores} workers {together:.0f} s; "
        f"throughput {alone / together:.2f} times, {alone / together / cores:.2f} of the cores"
    )


if __name__ == "__main__":
    main()
