"""The default network recipe against the paper's, on the same data in one process.

Prints, for every law, the errors of σ12, N1 and N2 on the three flows that no training saw (N2's
relative to N1's norm), the seconds of both, and their ratio.

    python benchmarks/tbnn_recipes.py --recipes default
    python benchmarks/tbnn_recipes.py --cases giesekus
"""

import argparse
import time

CASES = {
    "giesekus": ("giesekus", {"alpha": 0.2}, True),
    "giesekus_0.8": ("giesekus", {"alpha": 0.8}, True),
    "ucm": ("ucm", {}, False),
    "johnson_segalman": ("johnson_segalman", {"xi": 0.4}, True),
    "ptt_linear": ("ptt_linear", {"epsilon": 0.4}, True),
    "ptt_exponential": ("ptt_exponential", {"epsilon": 0.4}, False),
}


def print_errors(law, truth) -> None:
    """Print the relative L2 errors of a law on the paper's three tests."""
    from discover.laws import Fluid
    from discover.learners.distillation import compare_fluids
    from discover.protocols import paper_test_protocols

    worst = dict.fromkeys(("sigma12", "N1", "N2"), 0.0)
    for name, protocol in paper_test_protocols().items():
        errors = compare_fluids(truth, Fluid.dimensionless(law), protocol)
        if errors is None:
            print(f"    {name:11s} runs away", flush=True)
            worst = dict.fromkeys(worst, float("inf"))
            continue
        worst = {key: max(value, errors[key]) for key, value in worst.items()}
        print(f"    {name:11s} {_percent(errors)}", flush=True)
    print(f"    worst       {_percent(worst)}", flush=True)


def _percent(errors) -> str:
    return "  ".join(f"{key} {100 * value:.4f} %" for key, value in errors.items())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", default=",".join(CASES), help="of " + ", ".join(CASES))
    parser.add_argument("--recipes", default="default,paper")
    parser.add_argument("--noise", type=float, default=0.0)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    unknown = [case for case in arguments.cases.split(",") if case not in CASES]
    if unknown:
        parser.error(f"unknown case {unknown[0]!r}; choose among {', '.join(CASES)}")

    from discover.learners.tbnn_ude import TBNNUDE
    from discover.precision import enable_x64
    from discover.simulate import synthetic_dataset

    enable_x64()
    for case in arguments.cases.split(","):
        law, parameters, known = CASES[case]
        data = synthetic_dataset(law, parameters, noise=arguments.noise, seed=arguments.seed)
        print(f"{case}, noise {arguments.noise:g}")
        seconds = {}
        for recipe in arguments.recipes.split(","):
            model = TBNNUDE(
                recipe=recipe, known_relaxation=known, random_state=arguments.seed, n_members=1
            )
            started, processor = time.perf_counter(), time.process_time()
            model.fit(data.runs)
            seconds[recipe] = time.perf_counter() - started
            spent = time.process_time() - processor
            print(
                f"  {recipe}: {seconds[recipe]:.1f} s ({spent:.1f} s of processor time), "
                "compilation included"
            )
            print(f"    {model.result_.message}")
            print(
                "    in words: "
                + (" + ".join(f"{t.coefficient:.4g} {t.term}" for t in model.terms_) or "nothing")
            )
            print_errors(model.law_, data.truth)
        if len(seconds) == 2:
            print(f"  time, paper / default: {seconds['paper'] / seconds['default']:.1f}")


if __name__ == "__main__":
    main()
