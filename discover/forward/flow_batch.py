"""Runs of several controls in one batch, with the grid of each."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from discover.forward.grid import IntegrationGrid, make_grids
from discover.programs import on_device
from discover.protocols.kinematics import MODULI, RecordedQuantity
from discover.protocols.protocol import FlowProtocol, stack_protocols

# Of its strain, what an oscillation keeps that is to be still: without any it has no modulus
_SMALL_STRAIN = 1e-3

# What no sum of stresses is
_NEVER = -1.23456789e300


class Shown(NamedTuple):
    """What a run shows: a flow of its part, and of an oscillation which modulus."""

    run: int
    flow: int
    modulus: RecordedQuantity | None


class FlowBatch(eqx.Module):
    """Flows and their grids, those of one control together, for each has a program of its own.

    G′ and G″ of one sweep are two runs of one flow. `parts`: protocols and grids of each control,
    with a leading axis of flows. `shown`: what each run of a part shows of them.
    """

    parts: tuple[tuple[FlowProtocol, IntegrationGrid], ...]
    shown: tuple[tuple[Shown, ...], ...] = eqx.field(static=True)

    def __len__(self) -> int:
        return sum(map(len, self.shown))

    @property
    def n_steps(self) -> int:
        """Steps of all flows; of oscillations those of one half cycle for each state."""
        return sum(
            grid.times.size
            if grid.phase is None
            else grid.sample_index.size * grid.phase.shape[-1] // 2
            for _, grid in self.parts
        )

    @property
    def is_uniform(self) -> bool:
        """Whether all runs are of one control, and each has a flow of its own."""
        (first, *others) = self.parts
        return not others and len(first[1].sample_index) == len(self)

    def over(self, function: Callable[..., Any]) -> Any:
        """Return what a function makes of each flow and its grid, runs in their order.

        It may return a tree of arrays; of a complex one a run has the part that is its modulus.
        """
        found, told = [], None
        for part, shown in zip(self.parts, self.shown, strict=True):
            if told is not None:
                part = _after(told, part)
            of_flows = _of_flows(function, part)
            told = jax.tree.leaves(of_flows)[0]
            found.append(jax.tree.map(partial(_of_runs, shown), of_flows))
        if len(found) == 1:
            return found[0]
        order = np.argsort([one.run for shown in self.shown for one in shown])
        return jax.tree.map(lambda *leaves: jnp.concatenate(leaves)[order], *found)

    def faster(self, factor: Float[Array, " runs"]) -> "FlowBatch":
        """Return the flows with the rate of each multiplied; their grids stay.

        Oscillations keep their frequency, and some strain. A given stress may fall but not rise:
        not every fluid bears more. Of a flow that several runs show the largest factor counts.
        """
        parts = []
        for (protocols, grids), shown in zip(self.parts, self.shown, strict=True):
            runs, flows = np.array([(one.run, one.flow) for one in shown]).T
            own = jax.ops.segment_max(factor[runs], flows, len(grids.sample_index))[:, None]
            if protocols.control == "stress":
                own = jnp.minimum(own, 1.0)
            oscillates = protocols.table_strains is not None
            if oscillates:
                own = jnp.maximum(own, _SMALL_STRAIN)

            def moved(flow, oscillates=oscillates):
                strains = [flow.table_strains] if oscillates else []
                return [flow.table_rates, flow.amplitudes, *strains]

            changed = eqx.tree_at(moved, protocols, [own * leaf for leaf in moved(protocols)])
            parts.append((changed, grids))
        return FlowBatch(tuple(parts), self.shown)

    def some(self, first: Int[Array, ""] | np.int32 | int, count: int) -> "FlowBatch":
        """Return so many runs from the first on, of a batch that `is_uniform`."""
        (part,), (shown,) = self.parts, self.shown
        chosen = jax.tree.map(lambda leaf: jax.lax.dynamic_slice_in_dim(leaf, first, count), part)
        return FlowBatch((chosen,), (shown[:count],))


def _of_flows(function: Callable[..., Any], part: tuple[FlowProtocol, IntegrationGrid]) -> Any:
    """Return what a function makes of each flow, with a leading axis."""
    if len(part[1].sample_index) > 1:
        return jax.vmap(function)(*part)
    # where one flow is by itself a choice in it takes one branch, and not both
    alone = jax.tree.map(lambda leaf: leaf[0], part)
    return jax.tree.map(lambda leaf: leaf[None], function(*alone))


def _of_runs(shown: tuple[Shown, ...], of_flows: Array) -> Array:
    """Return what each run shows of its flow, with a leading axis of runs."""
    of_runs = of_flows
    if len(shown) > len(of_flows):
        of_runs = of_flows[np.array([one.flow for one in shown])]
    if not jnp.iscomplexobj(of_runs):
        return of_runs
    stored = np.array([one.modulus == MODULI[0] for one in shown])
    return jnp.where(stored.reshape(-1, *(1,) * (of_runs.ndim - 1)), of_runs.real, of_runs.imag)


def _after(told: Array, part: Any) -> Any:
    """Return flows as they are, to be followed after something else is told.

    Left to themselves XLA's threads follow both at once, and wait for one another for ever where
    each iterates   [seen with jaxlib 0.10.2: two loops of Newton's steps, a scan in each].
    """
    # that this is false the compiler cannot know: zero is added, and waited for
    never = jnp.sum(jax.lax.stop_gradient(told).real) == _NEVER

    def delayed(leaf):
        return leaf + never if eqx.is_inexact_array(leaf) else leaf

    return jax.tree.map(delayed, part)


def lay_out(
    protocols: Sequence[FlowProtocol],
    times: Sequence[Float[np.ndarray, " _"]],
    relaxation_time: float | None = None,
    **limits: Any,
) -> FlowBatch:
    """Return flows with their grids, as many padded samples in each.

    Of an oscillation that had gone on for ever the periodic state is solved for if the fluid
    relaxes; else the cycles with which its protocol begins are waited for. `relaxation_time`:
    longest of the fluid, in s; None where only what is learned relaxes. `**limits`: of
    `make_grids`.
    """
    n = max(len(sampled) for sampled in times)
    parts, shown = [], []
    for control in dict.fromkeys(protocol.control for protocol in protocols):
        own = [i for i, protocol in enumerate(protocols) if protocol.control == control]
        firsts = [next(j for j in own if _is_one_flow(protocols, times, i, j)) for i in own]
        distinct = list(dict.fromkeys(firsts))
        flows = [replace(protocols[i], modulus=None) for i in distinct]
        grids = make_grids(
            flows,
            [times[i] for i in distinct],
            relaxation_time,
            from_cycle=relaxation_time is not None,
            **limits,
        )
        parts.append((stack_protocols(flows), _with_samples(grids, n)))
        pairs = zip(own, firsts, strict=True)
        shown.append(tuple(Shown(i, distinct.index(j), protocols[i].modulus) for i, j in pairs))
    return FlowBatch(tuple(parts), tuple(shown))


def _is_one_flow(protocols, times, i: int, j: int) -> bool:
    """Return whether two runs are moduli of one sweep, or the same run."""
    if i == j or protocols[i].control != "oscillation":
        return i == j
    alike = [jax.tree.leaves((replace(protocols[k], modulus=None), times[k])) for k in (i, j)]
    return all(np.array_equal(a, b) for a, b in zip(*alike, strict=True))


def _with_samples(grids: IntegrationGrid, n: int) -> IntegrationGrid:
    index = np.asarray(grids.sample_index)
    more = ((0, 0), (0, n - index.shape[1]))
    if not more[1][1]:
        return grids
    return replace(grids, sample_index=on_device(np.pad(index, more, mode="edge")))
