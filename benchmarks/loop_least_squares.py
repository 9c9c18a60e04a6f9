"""The fits of the closed loop by its own least squares, and by optimistix's Levenberg–Marquardt.

Four effects in the fluid, each with a rise time of the rate, are fitted to a melt
(`loop_speed.py` says which), with all candidates in the model: by `fit_batch`, whose derivatives
are differences that steps correct, and by `optimistix.least_squares`, whose derivatives are
tangents through the same prediction. Prints seconds of processor of both, first and second time,
the ratio, and how far the costs reached are apart.

    python benchmarks/loop_least_squares.py
"""

import time

import numpy as np
from loop_speed import with_all_candidates

LAWS = "ptt_exponential", "ptt_linear", "giesekus_mobility", "non_affine_motion"


def main() -> None:
    """Print seconds and costs."""
    from discover.compilation_cache import enable_compilation_cache
    from discover.precision import enable_x64

    enable_x64()
    enable_compilation_cache()
    import jax
    import jax.numpy as jnp
    import optimistix

    from discover.inference.least_squares import fit_batch

    model, batch = with_all_candidates()
    starts, free = [], []
    for name in LAWS:
        positions = [*model.positions(name), *model.positions("rate_rise_time")]
        theta = model.zero()
        theta[positions] = model.first_trial[positions]
        starts.append(theta)
        free.append(positions)
    program, numbers = model._program, model._numbers
    (flows,) = batch.parts
    records = jax.tree.map(jnp.asarray, batch.records)

    @jax.jit
    def fit(used, theta, positions):
        def residual(moved, _):
            at = theta.at[positions].set(moved)
            found = program._predict_all(numbers, used, at, flows, records, None, jnp.inf)
            return records.residual(found)

        low, high = jnp.asarray(model.low)[positions], jnp.asarray(model.high)[positions]
        found = optimistix.least_squares(
            residual,
            optimistix.LevenbergMarquardt(rtol=1e-4, atol=1e-8),
            theta[positions],
            options={"jac": "fwd", "lower": low, "upper": high},
            max_steps=60,
            throw=False,
        )
        return jnp.sum(residual(found.value, None) ** 2), found.stats["num_steps"]

    def by_optimistix():
        return [
            [float(of) for of in fit(program.fluid.in_use(theta), theta, jnp.asarray(positions))]
            for theta, positions in zip(starts, free, strict=True)
        ]

    def of_the_loop():
        return [[fit.cost, np.nan] for fit in fit_batch(model, batch, starts, free)]

    spent = {}
    for name, method in (("loop", of_the_loop), ("optimistix", by_optimistix)) * 3:
        started = time.process_time()
        found = np.array(method())
        spent.setdefault(name, []).append(time.process_time() - started)
        print(f"{name}: {spent[name][-1]:.2f} s of processor, costs {found[:, 0]}", flush=True)
    later = {name: min(seconds[1:]) for name, seconds in spent.items()}
    print(f"optimistix over the loop's: {later['optimistix'] / later['loop']:.2f}")


if __name__ == "__main__":
    main()
