"""The paper's distillations, and the pairs that it only proposes.

Run with ``python benchmarks/distillation_table.py``; each row takes a few seconds.
"""

import argparse
import json
import time

PAIRS = (
    ("giesekus", {"alpha": 0.2}, "ucm"),
    ("ptt_exponential", {"epsilon": 0.2}, "ucm"),
    ("giesekus", {"alpha": 0.2}, "ptt_linear"),
    ("giesekus", {"alpha": 0.2}, "fene_p"),
    ("ptt_linear", {"epsilon": 0.2}, "giesekus"),
    ("ptt_linear", {"epsilon": 0.2}, "fene_p"),
    ("fene_p", {"L2": 20.0}, "giesekus"),
    ("fene_p", {"L2": 20.0}, "ptt_linear"),
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="print JSON, one line a pair")
    arguments = parser.parse_args()
    from discover.precision import enable_x64

    enable_x64()
    from discover.laws import make_law
    from discover.learners.distillation import distil

    for teacher, parameters, student in PAIRS:
        started = time.perf_counter()
        result = distil(make_law(teacher, parameters), student)
        seconds = time.perf_counter() - started
        if arguments.json:
            row = {"teacher": teacher, "teacher_parameters": parameters, **result.as_dict()}
            print(json.dumps({**row, "seconds": seconds}), flush=True)
            continue
        print(f"{teacher} {parameters} -> {student}   ({seconds:.1f} s)")
        for label, values in (("penalised", result.penalised), ("debiased", result.debiased)):
            print(f"  {label:9}", {name: round(value, 4) for name, value in values.items()})
        if result.viscosity_ratio is not None:
            print(
                f"  viscosity ratio {result.viscosity_ratio:.4f}, relaxation time ratio "
                f"{result.relaxation_time_ratio:.4f}"
            )
        print(f"  training misfit {result.misfit:.2%}")
        for flow, errors in result.errors.items():
            shown = "runs away" if errors is None else {k: f"{v:.2%}" for k, v in errors.items()}
            print(f"  {flow:12}", shown, flush=True)


if __name__ == "__main__":
    main()
