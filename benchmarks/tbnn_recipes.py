"""The default network recipe against the paper's, on the same data in one process.

Prints, for every law, the errors of σ12, N1 and N2 on the three flows that no training saw, the
seconds of both, and their ratio. N2's error is given relative to N1's norm, and relative to its own
where the truth has one.
"""

import argparse
import time

CASES = {
    "giesekus_0.2": ("giesekus", {"alpha": 0.2}, True),
    "giesekus_0.8": ("giesekus", {"alpha": 0.8}, True),
    "ucm": ("ucm", {}, False),
    "johnson_segalman": ("johnson_segalman", {"xi": 0.4}, True),
    "ptt_linear": ("ptt_linear", {"epsilon": 0.4}, True),
    "ptt_exponential": ("ptt_exponential", {"epsilon": 0.4}, False),
}


def errors_on_tests(law, truth) -> None:
    import numpy as np

    from discover.laws import Fluid
    from discover.protocols import paper_test_protocols
    from discover.simulate import simulate

    for name, protocol in paper_test_protocols().items():
        # oscillations to twice the training time: past what training saw
        times = np.linspace(0.0, 20.0 if name.startswith("startup") else 40.0, 401)
        learned = simulate(Fluid.dimensionless(law), protocol, times)
        exact = simulate(truth, protocol, times)
        shear = np.linalg.norm(learned.shear_stress - exact.shear_stress)
        first = np.linalg.norm(
            learned.first_normal_stress_difference - exact.first_normal_stress_difference
        )
        second = np.linalg.norm(
            learned.second_normal_stress_difference - exact.second_normal_stress_difference
        )
        scale = np.linalg.norm(exact.first_normal_stress_difference)
        own = np.linalg.norm(exact.second_normal_stress_difference)
        of_itself = f"{100 * second / own:.4f} %" if own > 1e-9 * scale else "-"
        print(
            f"    {name:11s} sigma12 {100 * shear / np.linalg.norm(exact.shear_stress):.4f} %  "
            f"N1 {100 * first / scale:.4f} %  N2 {100 * second / scale:.4f} % of N1 "
            f"({of_itself} of itself)",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", default="giesekus_0.2,giesekus_0.8", help=", ".join(CASES))
    parser.add_argument("--recipes", default="default,paper")
    parser.add_argument("--noise", type=float, default=0.0)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()

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
            model = TBNNUDE(recipe=recipe, known_relaxation=known, random_state=arguments.seed)
            started = time.perf_counter()
            model.fit(data.runs)
            seconds[recipe] = time.perf_counter() - started
            print(f"  {recipe}: {seconds[recipe]:.1f} s, compilation included")
            print(f"    {model.result_.message}")
            print(
                "    in words: "
                + (" + ".join(f"{t.coefficient:.4g} {t.term}" for t in model.terms_) or "nothing")
            )
            errors_on_tests(model.law_, data.truth)
        if len(seconds) == 2:
            print(f"  time, paper / default: {seconds['paper'] / seconds['default']:.1f}")


if __name__ == "__main__":
    main()
