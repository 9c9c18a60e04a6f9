"""Ways to differentiate the training loss of the paper's network, in one process.

Compares, on the eight series: reverse mode through the steps with recursive checkpoints, reverse
mode with every step stored, the continuous adjoint that the paper uses, and the whole Jacobian from
the variational equation (which gives the gradient and the curvature). Prints seconds, the ratio to
the first, and the error of each against central differences along a random direction.
"""

import argparse
import time

import numpy as np


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--width", type=int, default=32)
    arguments = parser.parse_args()

    from discover.precision import enable_x64

    enable_x64()
    import diffrax
    import equinox as eqx
    import jax
    import jax.numpy as jnp

    from discover.forward.integrators.exponential_runge_kutta import ExponentialRungeKutta4
    from discover.learners.tbnn_ude.problem import make_problem
    from discover.learners.tbnn_ude.recipe_paper import make_network
    from discover.learners.tbnn_ude.variational import states_and_jacobian
    from discover.learners.tbnn_ude.weights import Rebuild
    from discover.simulate import synthetic_dataset

    data = synthetic_dataset("giesekus", {"alpha": 0.2})
    problem = make_problem(data.runs, np.ones(1), np.ones(1))
    law = make_network(jax.random.key(0), arguments.width, True)
    rebuild = Rebuild.everything(law)
    weights = rebuild.start
    times = jnp.asarray(data.runs[0].time)

    def loss(weights, problem, adjoint):
        """Sum over series of the mean squared error; samples are the grid's own times."""
        fluid = problem.fluid(rebuild(weights))

        def one(protocol, grid):
            solution = diffrax.diffeqsolve(
                # a closed-over tracer would escape the continuous adjoint
                diffrax.ODETerm(lambda t, y, a: a[0].state_rate(y, a[1].rate(t))),
                ExponentialRungeKutta4(jnp.ones((1, 1))),
                0.0,
                times[-1],
                None,
                jnp.zeros((1, 4)),
                args=(fluid, protocol),
                saveat=diffrax.SaveAt(ts=times),
                stepsize_controller=diffrax.StepTo(grid.times),
                adjoint=adjoint,
                max_steps=grid.times.shape[0] - 1,
                throw=False,
            )
            return solution.ys[:, 0, 3]

        errors = problem.flows.over(one) - problem.records.recorded
        return jnp.sum(jnp.mean(errors**2, axis=1))

    def through(adjoint):
        gradient = eqx.filter_jit(jax.grad(lambda w, p: loss(w, p, adjoint)))
        return lambda: gradient(weights, problem)

    @eqx.filter_jit
    def variational(weights, problem):
        along, jacobian = states_and_jacobian(weights, rebuild, problem)
        residual = along.recorded - problem.records.recorded
        n = residual.shape[1]
        return 2.0 / n * jnp.einsum("rn,rnp->p", residual, jacobian)

    ways = {
        "recursive checkpoints": through(diffrax.RecursiveCheckpointAdjoint()),
        "every step stored": through(diffrax.DirectAdjoint()),
        "continuous adjoint": through(
            diffrax.BacksolveAdjoint(
                solver=diffrax.Tsit5(), stepsize_controller=diffrax.PIDController(1e-6, 1e-8)
            )
        ),
        "variational Jacobian": lambda: variational(weights, problem),
    }
    direction = jax.random.normal(jax.random.key(1), weights.shape)
    direction = direction / jnp.linalg.norm(direction)
    value = eqx.filter_jit(lambda w, p: loss(w, p, diffrax.RecursiveCheckpointAdjoint()))
    step = 1e-5
    difference = (
        value(weights + step * direction, problem) - value(weights - step * direction, problem)
    ) / (2 * step)

    first = None
    for name, way in ways.items():
        started = time.perf_counter()
        gradient = jax.block_until_ready(way())
        compiled = time.perf_counter() - started
        seconds = []
        for _ in range(arguments.repeats):
            started = time.perf_counter()
            jax.block_until_ready(way())
            seconds.append(time.perf_counter() - started)
        median = float(np.median(seconds))
        first = first or median
        error = abs(float(gradient @ direction - difference)) / abs(float(difference))
        print(
            f"{name:22s} {1e3 * median:8.1f} ms   ratio {median / first:6.2f}   "
            f"relative error {error:.1e}   first call {compiled:.1f} s",
            flush=True,
        )
    samples = problem.records.recorded.size
    print(f"{weights.size} weights, {samples} samples, {arguments.repeats} repeats")


if __name__ == "__main__":
    main()
