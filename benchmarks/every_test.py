"""Every test that a rheometer makes, one at a time: what each tells of a law that scipy made.

Four materials (`independent`, which shares nothing with the software under test) with G = 100 Pa,
λ = 1 s and 1 Pa s of solvent: the declared one, one with a term of the library, one whose term has
an invariant, one with a structure variable. Each is told by one test alone, as a folder written by
hand, with 1 % noise. Both commands are told the upper convected Maxwell law.

Counted as false: an effect that is neither the planted one nor said to be its alias; a constant
outside three half-widths of its interval; *explained* by a law whose N1 is wrong by more than a
tenth in a start-up at 2 1/s and yet not undetermined. To leave open what a test cannot tell is
right.

    python benchmarks/every_test.py --out every_test
    python benchmarks/every_test.py --out every_test --tests creep,uniaxial --materials giesekus
    python benchmarks/every_test.py --out every_test --table

The last one writes the tables of docs/every-test.md from the answers that are there, and runs
nothing.
"""

import argparse
import json
import time
import traceback
import warnings
from pathlib import Path

from every_test_answers import of_compare, of_loop
from every_test_records import MATERIALS, MODULUS, SOLVENT, TESTS, TIME, Folder
from every_test_tables import line, tables


def main() -> None:
    """Run or resume the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("every_test"))
    parser.add_argument("--tests", default=",".join(TESTS))
    parser.add_argument("--materials", default=",".join(MATERIALS))
    parser.add_argument("--task", choices=["close-loop", "compare", "both"], default="both")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--table", action="store_true", help="Write what is there, run nothing.")
    options = parser.parse_args()
    if options.table:
        print(tables(options.out))
        return
    import discover as dc

    base = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME, SOLVENT)
    tasks = {"close-loop": of_loop, "compare": of_compare}
    rows = []
    for test in options.tests.split(","):
        for material in options.materials.split(","):
            folder = options.out / f"{test}_{material}"
            if not folder.exists():
                # whatever else is asked for, so that a part makes the same records as the whole
                place = 1000 * list(MATERIALS).index(material) + 10 * list(TESTS).index(test)
                made = Folder(folder, options.seed + place)
                TESTS[test](made, MATERIALS[material])
                made.close()
            for task, ask in tasks.items():
                if options.task not in ("both", task):
                    continue
                kept = options.out / f"{test}_{material}_{task}.json"
                if kept.exists():
                    rows.append(json.loads(kept.read_text()))
                    continue
                started = time.perf_counter()
                try:
                    with warnings.catch_warnings():
                        warnings.simplefilter("ignore")
                        row = ask(folder, material, base)
                except dc.InputError as error:
                    row = {"verdict": "refused", "named": [], "constants": [], "false": []}
                    row["message"] = str(error)
                except Exception as error:
                    traceback.print_exc()
                    row = {"verdict": "fault", "named": [], "constants": [], "false": [str(error)]}
                row |= {"test": test, "material": material, "task": task}
                row["seconds"] = time.perf_counter() - started
                kept.write_text(json.dumps(row) + "\n")
                rows.append(row)
                print(line(row), flush=True)
    false = sum(bool(row["false"]) for row in rows)
    held = [c for row in rows for c in row["constants"] if row["verdict"] != "unexplained"]
    inside = sum(low <= true <= high for _, true, _, low, high in held)
    print(f"{len(rows)} answers, {false} with something false; intervals {inside} of {len(held)}")


if __name__ == "__main__":
    main()
