"""How often 95 % intervals hold the truth: 200 synthetic data sets, white and autocorrelated noise.

The law's terms are taken as known; what is judged is the interval, not the search.
"""

import argparse
from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from discover.first_use import enable_x64

CASES = (
    ("giesekus", {"alpha": 0.2}, ("sigma.sigma",), {"sigma.sigma": 0.2}),
    ("ptt_linear", {"epsilon": 0.4}, ("sigma.sigma", "tr(sigma)*sigma"), {"tr(sigma)*sigma": 0.4}),
    (
        "ptt_exponential",
        {"epsilon": 0.4},
        ("(exp(epsilon*tr(sigma))-1)*sigma",),
        {"(exp(epsilon*tr(sigma))-1)*sigma": 1.0, "epsilon": 0.4},
    ),
)


def noise(rng, runs: int, samples: int, correlation: float) -> np.ndarray:
    """Return noise of unit variance, one row for each run."""
    start = 300
    white = rng.normal(size=(runs, start + samples))
    coloured = lfilter([1.0], [1.0, -correlation], white)[:, start:]
    return coloured * np.sqrt(1.0 - correlation**2)


def main() -> None:
    """Print one line for each law and kind of noise."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=200)
    parser.add_argument("--law", help="this law only")
    parser.add_argument("--noise", type=float, default=0.02)
    parser.add_argument("--correlations", type=float, nargs="+", default=[0.0, 0.5, 0.9])
    options = parser.parse_args()
    enable_x64()
    from discover.inference.engine.fits import Fitter
    from discover.learners.known_part import KnownPart
    from discover.learners.runs import as_runs
    from discover.learners.tensor_sindy.report import recovered_terms
    from discover.learners.tensor_sindy.search import SupportSearch, library_problem
    from discover.linear_algebra_threads import in_one_thread
    from discover.simulate import synthetic_dataset
    from tensor_library import TermLibrary, parse_term

    known = KnownPart(None, np.ones(1), np.ones(1), 0.0, True)

    @in_one_thread
    def judge(law, names, problem, library, truth, correlation) -> None:
        rows = problem.fitted
        runs, longest = len(rows.runs), max(map(len, rows.runs))
        theta = problem.zero.copy()
        for name in names:
            theta[problem.model.positions(name)[0]] = truth.get(name, 0.0)
        rng = np.random.default_rng(0)
        inside, at_one = [], []
        for _ in range(options.sets):
            error = noise(rng, runs, longest, correlation)
            own = np.concatenate([error[i, : len(run)] for i, run in enumerate(rows.runs)])
            noisy = replace(rows, recorded=rows.recorded + options.noise * rows.size * own)
            search = SupportSearch(
                Fitter(problem, noisy), library, "stlsq", len(names), lambda line: None
            )
            (fit,) = search.add([search.fitter.start(names, theta)])
            for term in recovered_terms(search, fit):
                low, high = term.ci95
                inside.append(low < truth.get(term.term, 0.0) < high)
                for name, ends in term.inner_ci95.items():
                    inside.append(ends[0] < truth[name] < ends[1])
                    if name in term.inner_at_one:
                        value, low, high = term.inner_at_one[name]
                        off = abs(term.inner[name] / truth[name] - 1.0)
                        given = abs(value / truth[name] - 1.0)
                        at_one.append((off, given, low < truth[name] < high))
        print(
            f"{law:16} AR(1) {correlation:3.1f}  covered {100 * np.mean(inside):5.1f} %"
            f"  of {len(inside)}",
            flush=True,
        )
        if at_one:
            free, given, held = np.array(at_one).T
            print(
                f"{'':16} inner parameter off by {100 * np.median(free):.2f} % in the median; if "
                f"the coefficient is one: {100 * np.median(given):.2f} %, covered "
                f"{100 * np.mean(held):.1f} %",
                flush=True,
            )

    for law, parameters, names, truth in CASES:
        if options.law not in (None, law):
            continue
        library = TermLibrary(tuple(parse_term(name) for name in names))
        runs = as_runs(synthetic_dataset(law, parameters), 1.0)
        problem = library_problem(runs, library, known, False)
        for correlation in options.correlations:
            judge(law, names, problem, library, truth, correlation)


if __name__ == "__main__":
    main()
