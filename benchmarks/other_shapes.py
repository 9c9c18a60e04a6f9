"""What a wrong shape leaves, and what the test of noise lets pass.

    python benchmarks/other_shapes.py unseen
    python benchmarks/other_shapes.py left --out other_shapes

The first adds smooth random misfits to white noise, and prints how often the test sees them, by
their sum of squares over the variance of the noise. The second puts fluids that no dictionary holds
to the loop with hardly any noise, so that it goes on adding effects that are not there, and prints
what each leaves over what it takes away. `discover.closed_loop.explanations.other_shapes` has both.
"""

import argparse
import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from hostile_fluids import CASES, run
from hostile_fluids_loud_cases import LOUD
from hostile_fluids_materials import white

from discover.statistics.lack_of_fit import what_is_left

_NOISE, _QUIET, _DRAWS = 0.01, 0.002, 60


def smooth(samples: int, length: float, lot: np.random.Generator) -> np.ndarray:
    """Return a random function with a correlation length over the run, of mean square 1."""
    time = np.arange(samples) / samples
    covariance = np.exp(-0.5 * ((time[:, None] - time) / length) ** 2) + 1e-9 * np.eye(samples)
    drawn = np.linalg.cholesky(covariance) @ lot.standard_normal(samples)
    return drawn / np.sqrt(np.mean(drawn**2))


def unseen() -> None:
    """Print how often a smooth misfit is seen."""
    lot = np.random.default_rng(0)
    sums = (10, 20, 30, 45, 60, 90, 150)
    print("| samples | correlation length | " + " | ".join(map(str, sums)) + " |")
    for runs in ((80, 80, 120), (120,) * 4):
        for length in (0.05, 0.15, 0.3):
            seen = []
            for squares in sums:
                size = _NOISE * np.sqrt(squares / sum(runs))
                count = 0
                for _ in range(_DRAWS):
                    rows = [
                        _NOISE * lot.standard_normal(n) + size * smooth(n, length, lot)
                        for n in runs
                    ]
                    left = what_is_left(rows, [np.ones(n) for n in runs])
                    count += left.verdict == "unexplained"
                seen.append(f"{100 * count / _DRAWS:.0f} %")
            print(f"| {sum(runs)} | {length} | " + " | ".join(seen) + " |", flush=True)


def left(out: Path) -> None:
    """Print what every effect but the first left, over what it took away."""
    ratios = []
    for name in (name for name in LOUD if name.startswith("loud_5_")):
        quiet = name.replace("loud_5", "quiet")
        CASES[quiet] = replace(LOUD[name], noise=white(_QUIET))
        run(quiet, "close-loop", out, 0, pages=False)
        found = json.loads((out / quiet / "close-loop" / "loop.json").read_text())
        errors = [stage["error"]["fit"] for stage in found["stages"]]
        own = []
        for before, after in pairwise(errors):
            rest = np.sqrt(max(after**2 - _QUIET**2, 0.0))
            own.append(rest / np.sqrt(before**2 - after**2) if after < before else np.inf)
        ratios += own
        print(f"{quiet}: {[stage['effect'] for stage in found['stages']]}, "
              f"{', '.join(f'{one:.2g}' for one in own)}", flush=True)  # fmt: skip
    print("sorted:", ", ".join(f"{one:.2g}" for one in sorted(ratios)))


def main() -> None:
    """Print one of the two."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=["unseen", "left"])
    parser.add_argument("--out", type=Path, default=Path("other_shapes"))
    options = parser.parse_args()
    if options.what == "unseen":
        unseen()
    else:
        left(options.out)


if __name__ == "__main__":
    main()
