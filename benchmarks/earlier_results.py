"""Samples that are told by the result of another sample, `[model] from`: what is claimed of them.

Two samples are asked first, a Giesekus fluid (0.3) and a pom-pom. Then others are told by one of
these results: the same fluid again, one with another constant, another modulus and time, another
law. What counts as false is in `hostile_fluids.py`.

    python benchmarks/earlier_results.py --out earlier_results
"""

import argparse
from pathlib import Path

from hostile_fluids import TASKS, ask, line
from hostile_fluids_records import GIESEKUS, MOBILITY, POM_POM, SCALE, Case, recorded
from independent import Giesekus, PhanThienTanner

FIRST = {
    "giesekus": Case("giesekus", recorded(GIESEKUS), planted=MOBILITY),
    "pom_pom": Case("pom-pom", recorded(POM_POM), outside=True),
}
LATER = {
    "the_same": (GIESEKUS, "giesekus", {}),
    "other_mobility": (Giesekus(0.5, **SCALE), "giesekus", {"terms": {"sigma.sigma": 0.2}}),
    "other_scale": (
        Giesekus(0.3, 120.0, 0.8),
        "giesekus",
        {"outside": True, "same_as": ("relaxation_time_factor", "stress_gain")},
    ),
    "other_law": (
        PhanThienTanner(0.3, **SCALE),
        "giesekus",
        {"terms": {"sigma.sigma": -0.3, "tr(sigma)*sigma": 0.3}},
    ),
    "the_same_unexplained": (POM_POM, "pom_pom", {"outside": True}),
    "other_law_unexplained": (GIESEKUS, "pom_pom", {"outside": True}),
}


def main() -> None:
    """Ask the first two, then what is told by them, and print the answers."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=Path("earlier_results"))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--task", choices=[*TASKS, "both"], default="both")
    options = parser.parse_args()
    for name, case in FIRST.items():
        row = ask(case, name, "close-loop", options.out, options.seed)
        print(line(row), flush=True)
    for number, (name, (fluid, first, what)) in enumerate(LATER.items(), start=1):
        model = {"from": str((options.out / first / "close-loop").resolve())}
        case = Case(f"{name}, told by {first}", recorded(fluid), model=model, **what)
        for task in TASKS:
            if options.task in (task, "both"):
                row = ask(case, name, task, options.out, options.seed + number)
                print(line(row), flush=True)


if __name__ == "__main__":
    main()
