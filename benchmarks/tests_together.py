"""Several tests of one fluid, fitted together: what both commands say, and whether it is false.

Four combinations of tests (`together_records`), each of eight fluids by scipy, with 1 % noise:
three whose law the library holds, one with a structure of the dictionary, one with a finite
extensibility, and three of which no name says all (Rolie-Poly with stretch, pom-pom, two Giesekus
modes with constants of their own). Both commands are told the upper convected Maxwell law with the
right modes and solvent, and see all the records; a start-up at 3 1/s is kept from them.

Counted as false, under *explained* or *effects_added*: an effect with a name and a probability of a
half or more that is neither there nor said to be an alias of what is; a constant outside three
half-widths of its interval; another law where the library holds the right one; σ12, or in a
comparison N1 or N2, off by more than a tenth in the start-up that was not seen, and yet not
undetermined. Errors of N2 are over the size of N1.

    python benchmarks/tests_together.py --out tests_together
    python benchmarks/tests_together.py --out tests_together --together A,B --fluids pom
    python benchmarks/tests_together.py --out tests_together --table

The last one writes the tables of docs/every-test.md from the answers that are there, and runs
nothing.
"""

import argparse
import json
import time
import traceback
import warnings
from pathlib import Path

from together_answers import of_compare, of_loop
from together_records import FLUIDS, TOGETHER, write_records
from together_tables import line, tables

TASKS = {"compare": of_compare, "close-loop": of_loop}


def main() -> None:
    """Run or resume the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("tests_together"))
    parser.add_argument("--together", default=",".join(TOGETHER))
    parser.add_argument("--fluids", default=",".join(FLUIDS))
    parser.add_argument("--task", choices=[*TASKS, "both"], default="both")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--table", action="store_true", help="Write what is there, run nothing.")
    options = parser.parse_args()
    if options.table:
        print(tables(options.out))
        return
    rows = []
    for fluid in options.fluids.split(","):
        for together in options.together.split(","):
            folder = options.out / f"{together}_{fluid}"
            if not folder.exists():
                write_records(folder, together, fluid, options.seed)
            for task, ask in TASKS.items():
                if options.task in ("both", task):
                    kept = options.out / f"{together}_{fluid}_{task}.json"
                    if not kept.exists():
                        row = {"together": together, "fluid": fluid, "task": task}
                        kept.write_text(json.dumps(row | asked(ask, folder, fluid)) + "\n")
                        print(line(json.loads(kept.read_text())), flush=True)
                    rows.append(json.loads(kept.read_text()))
    false = sum(bool(row["false"]) for row in rows)
    print(f"{len(rows)} answers, {false} with something false")


def asked(ask, folder: Path, fluid: str) -> dict:
    """Return the row of one answer, with the seconds of processor that it took."""
    started = time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            row = ask(folder, fluid)
    except Exception as error:
        traceback.print_exc()
        row = {"verdict": "fault", "named": [], "constants": [], "unseen": {}}
        row["false"] = [f"{type(error).__name__}: {error}"]
    return row | {"seconds": time.process_time() - started}


if __name__ == "__main__":
    main()
