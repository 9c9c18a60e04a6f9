"""A neural ordinary differential equation in Diffrax, with unseen states beside σ12.

The Maxwell part of σ12 is known; a network of all states and the rate is added to it. Adam with a
cosine schedule, the horizon grown in two steps, as the examples of Diffrax do.
"""

import numpy as np

from field import Answer, Training

TITLE = "neural ODE (Diffrax), three unseen states"
STAGES = ((40, 500), (None, 1500))
"""Samples of each record, all or the first ones, and steps of Adam on them."""
LARGEST_STEP = 0.1  # relaxation times


def learn(training: Training) -> Answer:
    """Return the trained equation, which knows no tensor and so says nothing but σ12."""
    import diffrax
    import equinox as eqx
    import jax
    import jax.numpy as jnp
    import optax

    jax.config.update("jax_enable_x64", True)
    unit = training.relaxation_time
    network = eqx.nn.MLP(5, 4, 32, 2, jnp.tanh, key=jax.random.key(training.seed))

    def solve(network, amplitude, frequency, times):
        def change(t, state, args):
            rate = amplitude * jnp.cos(frequency * t)
            linear = jnp.append(rate - state[0], -state[1:])
            return linear + network(jnp.append(state, rate)) - network(jnp.zeros(5))

        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(change),
            diffrax.Tsit5(),
            times[0],
            times[-1],
            LARGEST_STEP,
            jnp.zeros(4),
            saveat=diffrax.SaveAt(ts=times),
            max_steps=256,
            throw=False,
        )
        return solution.ys[:, 0]

    flows = [record.flow for record in training.records]
    amplitudes = jnp.array([unit * flow.amplitude for flow in flows])
    frequencies = jnp.array([unit * flow.frequency for flow in flows])
    times = jnp.array([flow.times / unit for flow in flows])
    target = jnp.array([record.sigma12 / training.modulus for record in training.records])
    sizes = jnp.sqrt(jnp.mean(target**2, axis=1, keepdims=True))

    def loss(network, samples):
        said = jax.vmap(solve, (None, 0, 0, 0))(
            network, amplitudes, frequencies, times[:, :samples]
        )
        return jnp.mean(((said - target[:, :samples]) / sizes) ** 2)

    @eqx.filter_jit
    def train(network, samples, steps):
        optimiser = optax.chain(
            optax.clip_by_global_norm(1.0), optax.adam(optax.cosine_decay_schedule(3e-3, steps))
        )
        weights, static = eqx.partition(network, eqx.is_inexact_array)

        def step(carry, _):
            weights, state = carry
            slope = jax.grad(lambda w: loss(eqx.combine(w, static), samples))(weights)
            moved, state = optimiser.update(slope, state)
            return (optax.apply_updates(weights, moved), state), None

        start = (weights, optimiser.init(weights))
        (weights, _), _ = jax.lax.scan(step, start, length=steps)
        return eqx.combine(weights, static)

    for samples, steps in STAGES:
        network = train(network, samples or times.shape[1], steps)

    def predict(flow):
        if flow.kind != "shear":
            return {}
        said = solve(network, unit * flow.amplitude, unit * flow.frequency, flow.times / unit)
        return {"sigma12": training.modulus * np.asarray(said)}

    return Answer(predict, words="a network")
