"""How often 95 % intervals hold the truth: 200 synthetic data sets, white and autocorrelated noise.

The law's terms are taken as known; what is judged is the interval, not the search. Beside the
intervals that the software prints stand those that white noise would give.
"""

import argparse
from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from scipy.signal import lfilter

from discover.precision import enable_x64

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
    from discover.learners.tensor_sindy.intervals import parameter_uncertainty
    from discover.learners.tensor_sindy.refit import refit
    from discover.learners.trajectories.problem import make_problem

    from discover.simulate import synthetic_dataset
    from tensor_library import TermLibrary, parse_term

    for law, parameters, names, truth in CASES:
        if options.law not in (None, law):
            continue
        dataset = synthetic_dataset(law, parameters)
        library = TermLibrary(tuple(parse_term(name) for name in names))
        problem = make_problem(list(dataset), library)
        records = problem.records
        clean, weight = np.asarray(records.recorded), np.asarray(records.weight)
        size = np.where(weight > 0, options.noise / np.maximum(weight, 1e-300), 0.0)
        size /= np.sqrt(np.sum(weight > 0))
        support = tuple(range(len(names)))
        starts = np.array([truth.get(name, 0.0) for name in names])
        start = (starts, np.asarray(library.inner_default))
        for correlation in options.correlations:
            rng = np.random.default_rng(0)
            covered, covered_white, judged = 0, 0, 0
            at_one: list[tuple[float, float, bool]] = []
            for _ in range(options.sets):
                error = noise(rng, clean.shape[0], clean.shape[1], correlation)[..., None]
                changed = jnp.asarray(clean + size * error)
                noisy = eqx.tree_at(lambda p: p.records.recorded, problem, changed)
                fit = refit(noisy, [support], [start], np.ones(len(names)), slots=2)[0]
                result = parameter_uncertainty(noisy, fit, misfit_floor=1.0)
                half = result.factor * np.sqrt(np.diag(result.covariance))
                found = {name: fit.coefficients[i] for i, name in enumerate(names)}
                found |= {library.inner_names[i]: fit.inner[i] for i in result.inner_positions}
                # a floor of one gives the error that a residual of norm one would cause
                white = 1.96 * result.numerical * fit.misfit / np.sqrt(np.sum(weight > 0))
                for i, (name, value) in enumerate(found.items()):
                    missed = abs(value - truth.get(name, 0.0))
                    judged += 1
                    covered += missed < half[i]
                    covered_white += missed < white[i]
                for place in range(len(names), len(found)):
                    # a closed form's inner parameter, free and with its coefficient known as one
                    values = np.array(list(found.values()))
                    exact = replace(result, numerical=np.zeros(len(values)))
                    known, halves = exact.given(values, 0, 1.0)
                    true = truth[list(found)[place]]
                    inside = bool(abs(known[place] - true) < halves[place])
                    errors = (abs(values[place] / true - 1.0), abs(known[place] / true - 1.0))
                    at_one.append((*errors, inside))
            print(
                f"{law:16} AR(1) {correlation:3.1f}  covered {100 * covered / judged:5.1f} %"
                f"  (as if white {100 * covered_white / judged:5.1f} %)  of {judged}",
                flush=True,
            )
            if at_one:
                free, known, inside = np.array(at_one).T
                print(
                    f"{'':16} inner parameter off by {100 * np.median(free):.2f} % in the median, "
                    f"within 2 % in {100 * np.mean(free < 0.02):.0f} %; if the coefficient is one: "
                    f"{100 * np.median(known):.2f} %, within 2 % in "
                    f"{100 * np.mean(known < 0.02):.0f} %, covered {100 * np.mean(inside):.1f} %",
                    flush=True,
                )


if __name__ == "__main__":
    main()
