"""How long the network in the equation takes to be accurate, and which of our choices pays.

For each law, on the paper's eight series and in one process:

- (a) the paper's recipe as a user of Diffrax would write it: adaptive Tsit5, continuous adjoint,
  Adam, 7,200 iterations. Its time is that of a few iterations times 7,200; its gradients are
  checked against those of (b), so its accuracy is taken to be that of (b);
- (b) the best plain variant: fixed steps, discrete adjoint, the same Adam, run to the end;
- Levenberg–Marquardt on all weights of the same network, with the variational Jacobian;
- the default recipe, which asks for the smallest law that explains the data.

Prints seconds with and without compiling, the worst relative error of N1 and N2 on the three flows
that no training saw, and the ratios of time. Asserts that the default is no less accurate.

    python benchmarks/tbnn_time_to_accuracy.py --cases giesekus,ptt_exponential
"""

import argparse
import time

import equinox as eqx
import numpy as np

CASES = {
    "ucm": ("ucm", {}, False),
    "johnson_segalman": ("johnson_segalman", {"xi": 0.4}, True),
    "giesekus": ("giesekus", {"alpha": 0.2}, True),
    "ptt_exponential": ("ptt_exponential", {"epsilon": 0.4}, False),
    "ptt_linear": ("ptt_linear", {"epsilon": 0.4}, True),
}
ITERATIONS = 7200
LM_STEPS = 60


def worst_errors(law, truth) -> tuple[float, float]:
    """Return the largest relative errors of N1 and N2 over the paper's three tests."""
    from discover.laws import Fluid
    from discover.learners.distillation import compare_fluids
    from discover.protocols import paper_test_protocols

    n1, n2 = [], []
    for protocol in paper_test_protocols().values():
        errors = compare_fluids(truth, Fluid.dimensionless(law), protocol)
        n1.append(np.inf if errors is None else errors["N1"])
        n2.append(np.inf if errors is None else errors["N2"])
    return max(n1), max(n2)


def adaptive_gradient(problem, network):
    """Return a function for the gradient of recipe (a), and one for that of recipe (b)."""
    import diffrax
    import jax
    import jax.numpy as jnp

    from discover.learners.tbnn_ude.recipe_paper import paper_loss

    everything = jnp.ones(len(problem.flows), bool)

    def loss(part, law, problem):
        law = eqx.tree_at(lambda tree: tree.network, law, part)
        fluid = problem.fluid(law)

        def one(protocol, grid):
            # samples of the paper are evenly spaced and start at zero
            times = jnp.linspace(0.0, grid.times[-1], grid.sample_index.shape[0])
            solution = diffrax.diffeqsolve(
                diffrax.ODETerm(lambda t, y, a: a[0].state_rate(y, a[1].rate(t))),
                diffrax.Tsit5(),
                0.0,
                times[-1],
                0.01,
                jnp.zeros((1, 4)),
                args=(fluid, protocol),
                saveat=diffrax.SaveAt(ts=times),
                stepsize_controller=diffrax.PIDController(1e-6, 1e-8),
                adjoint=diffrax.BacksolveAdjoint(
                    solver=diffrax.Tsit5(), stepsize_controller=diffrax.PIDController(1e-6, 1e-8)
                ),
                max_steps=16**4,
                throw=False,
            )
            return solution.ys[:, 0, 3]

        off = problem.flows.over(one) - problem.records.recorded
        errors = jnp.mean(off**2, axis=1)
        weights = jax.tree.leaves(eqx.filter(part, eqx.is_inexact_array))
        return jnp.sum(errors) + 0.01 * sum(jnp.sum(jnp.abs(w)) for w in weights)

    adaptive = eqx.filter_jit(eqx.filter_grad(loss))
    plain = eqx.filter_jit(eqx.filter_grad(paper_loss))
    law = network
    return (
        lambda: adaptive(law.network, law, problem),
        lambda: plain(law.network, law, problem, everything, 0.01),
    )


def time_of_adaptive(problem, seed: int, known: bool, calls: int) -> tuple[float, float]:
    """Return seconds of one gradient of recipe (a), and how far its direction is from (b)'s."""
    import jax

    from discover.learners.tbnn_ude.recipe_paper import make_network

    slow, plain = adaptive_gradient(problem, make_network(jax.random.key(seed), 32, known))
    first = np.concatenate([np.ravel(leaf) for leaf in jax.tree.leaves(slow())])
    other = np.concatenate([np.ravel(leaf) for leaf in jax.tree.leaves(plain())])
    seconds = []
    for _ in range(calls):
        started = time.perf_counter()
        jax.block_until_ready(jax.tree.leaves(slow()))
        seconds.append(time.perf_counter() - started)
    away = np.linalg.norm(first - other) / np.linalg.norm(other)
    return float(np.median(seconds)), float(away)


def everything_at_once(problem, seed: int, known: bool):
    """Return the law after Levenberg–Marquardt steps in all weights of a plain network."""
    import jax
    import optimistix as optx

    from discover.learners.tbnn_ude.recipe_paper import make_network
    from discover.learners.tbnn_ude.variational import states_and_jacobian
    from discover.learners.tbnn_ude.weights import Rebuild

    rebuild = Rebuild.everything(make_network(jax.random.key(seed), 16, known))

    @eqx.filter_custom_jvp
    def residual(weights, problem):
        return problem.records.residual(problem.predicted(rebuild(weights))).ravel()

    @residual.def_jvp
    def _(primals, tangents):
        weights, data = primals
        along, jacobian = states_and_jacobian(weights, rebuild, data)
        residual, columns = data.records.linearised(along.recorded, jacobian)
        return residual.ravel(), (columns @ tangents[0]).ravel()

    solution = optx.least_squares(
        residual,
        optx.LevenbergMarquardt(rtol=1e-8, atol=1e-10),
        rebuild.start,
        args=problem,
        max_steps=LM_STEPS,
        throw=False,
    )
    return rebuild(solution.value)


def main() -> None:
    """Run the cases and print a table for each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", default=",".join(CASES), help="of " + ", ".join(CASES))
    parser.add_argument("--calls", type=int, default=5, help="gradients of (a) that are timed")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()

    from discover.learners.tbnn_ude import TBNNUDE
    from discover.learners.tbnn_ude.problem import make_problem
    from discover.precision import enable_x64
    from discover.programs import forget_programs
    from discover.simulate import synthetic_dataset

    enable_x64()
    for case in arguments.cases.split(","):
        name, parameters, known = CASES[case]
        data = synthetic_dataset(name, parameters)
        problem = make_problem(data.runs, np.ones(1), np.ones(1))
        seconds, errors = {}, {}

        def clocked(label, train, truth=data.truth, seconds=seconds, errors=errors):
            started = time.perf_counter()
            law = train()
            seconds[label] = time.perf_counter() - started
            errors[label] = worst_errors(law, truth)
            print(f"  {label}: {seconds[label]:.1f} s, {_said(errors[label])}", flush=True)

        def fitted(recipe, known=known, data=data):
            model = TBNNUDE(
                recipe=recipe, known_relaxation=known, random_state=arguments.seed, n_members=1
            )
            return model.fit(data.runs).law_

        print(case, flush=True)
        forget_programs()  # or a case would find those of the one before
        clocked("default, compiling included", lambda: fitted("default"))
        clocked("default", lambda: fitted("default"))
        clocked(
            "Levenberg–Marquardt on all weights",
            lambda known=known, problem=problem: everything_at_once(problem, arguments.seed, known),
        )
        one, away = time_of_adaptive(problem, arguments.seed, known, arguments.calls)
        seconds["a"] = one * ITERATIONS
        print(
            f"  (a) adaptive, continuous adjoint: {1e3 * one:.0f} ms an iteration, so "
            f"{seconds['a']:.0f} s for {ITERATIONS}; gradient differs by {100 * away:.2g} % from "
            "(b)'s",
            flush=True,
        )
        clocked("(b) fixed steps, discrete adjoint", lambda: fitted("paper"))
        ours = seconds["default, compiling included"]
        print(
            f"  time, compiling of ours included: (a) / default {seconds['a'] / ours:.0f}, "
            f"(b) / default {seconds['(b) fixed steps, discrete adjoint'] / ours:.1f}"
        )
        theirs = errors["(b) fixed steps, discrete adjoint"]
        # below a part in ten thousand both are exact for any use
        assert all(
            mine <= max(their, 1e-4)
            for mine, their in zip(errors["default, compiling included"], theirs, strict=True)
        )


def _said(errors: tuple[float, float]) -> str:
    return f"N1 {100 * errors[0]:.3g} %, N2 {100 * errors[1]:.3g} %"


if __name__ == "__main__":
    main()
