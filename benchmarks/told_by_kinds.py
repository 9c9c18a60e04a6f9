"""What start-ups, one extension and a flow curve each tell of a Giesekus fluid that scipy made.

    python benchmarks/told_by_kinds.py --out told_by_kinds

The table of docs/calibration.md. The fluid is that of `every_test_records`; modulus and relaxation
time are fitted along, and the fastest start-up is held out.
"""

import argparse
from pathlib import Path

import numpy as np
from every_test_records import (
    MATERIALS,
    MODULUS,
    SOLVENT,
    TIME,
    Folder,
    flow_curve,
    followed,
    start_up,
)

import discover as dc


def write_records(path: Path, seed: int) -> None:
    """Write three start-ups, one in uniaxial extension, and a flow curve."""
    folder, material = Folder(path, seed), MATERIALS["giesekus"]
    flow_curve(folder, material)
    start_up(folder, material)
    times, rate = np.linspace(0.05, 5.0, 80), 0.4
    stress = followed(material, lambda t: rate, times, "uniaxial")
    columns = {
        "time_s": times,
        "hencky_rate_1_s": np.full(80, rate),
        "tensile_stress_Pa": folder.noisy(stress[:, 0, 0] - stress[:, 1, 1]),
    }
    folder.run("uni", columns, flow="uniaxial")
    folder.close()


def main() -> None:
    """Make the records, run the loop, and print what each kind of test told."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("told_by_kinds"))
    parser.add_argument("--seed", type=int, default=3)
    options = parser.parse_args()
    write_records(options.out / "records", options.seed)
    loop = dc.close_loop(
        dc.load_dataset(options.out / "records").with_material_functions(),
        dc.Fluid(dc.make_law("ucm"), MODULUS, TIME, SOLVENT),
        held_out=["at_5.csv"],
        free=["modulus_Pa", "relaxation_time_s"],
        effects=["giesekus_mobility", "ptt_linear"],
        max_effects=2,
    )
    for one in loop.told_by:
        print(one.name, f"together {one.together:.2%}")
        for of, halves in (("alone", one.alone), ("without", one.without)):
            print("   ", of, ", ".join(f"{kind} {half:.2%}" for kind, half in halves.items()))


if __name__ == "__main__":
    main()
