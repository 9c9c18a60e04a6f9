"""Runs of several controls in one batch, with the grid of each."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from discover.protocols.protocol import FlowProtocol, stack_protocols
from discover.simulate.grid import IntegrationGrid, make_grids

# Of its strain, what an oscillation keeps that is to be still: without any it has no modulus
_SMALL_STRAIN = 1e-3


class FlowBatch(eqx.Module):
    """Flows and their grids, those of one control together, for each has a program of its own.

    Attributes
    ----------
    parts
        Protocols and grids of each control, both with a leading axis of runs.
    rows
        Which runs these are.
    """

    parts: tuple[tuple[FlowProtocol, IntegrationGrid], ...]
    rows: tuple[tuple[int, ...], ...] = eqx.field(static=True)

    def __len__(self) -> int:
        return sum(map(len, self.rows))

    @property
    def sample_mask(self) -> Bool[Array, "runs n"]:
        """False where a sample is padding."""
        return self.over(lambda _, grid: grid.sample_mask)

    @property
    def n_steps(self) -> int:
        """Steps of all runs; of oscillations those of one half cycle for each state."""
        return sum(
            grid.times.size
            if grid.phase is None
            else grid.sample_index.size * grid.phase.shape[-1] // 2
            for _, grid in self.parts
        )

    def over(self, function: Callable[..., Any], *batched: Any) -> Any:
        """Return what a function makes of each flow and its grid, runs in their order.

        Parameters
        ----------
        function
            Of one protocol and its grid, and of a run's share of `batched`; it may return a tree
            of arrays, whose shapes do not depend on the control.
        *batched
            Trees of arrays with a leading axis of runs.
        """
        if len(self.parts) == 1:
            return jax.vmap(function)(*self.parts[0], *batched)
        found = []
        for part, rows in zip(self.parts, self.rows, strict=True):
            own = jax.tree.map(partial(jnp.take, indices=jnp.asarray(rows), axis=0), batched)
            found.append(jax.vmap(function)(*part, *own))
        order = np.argsort(np.concatenate(self.rows))
        return jax.tree.map(lambda *leaves: jnp.concatenate(leaves)[order], *found)

    def with_steps_in(self, multiple: int) -> "FlowBatch":
        """Return the flows with steps rounded up, so that different runs share a compilation."""
        parts = []
        for protocols, grids in self.parts:
            times = np.asarray(grids.times)
            more = -times.shape[1] % multiple
            spacing = (times[:, -1] - times[:, -2])[:, None] if times.shape[1] > 1 else 1.0
            added = times[:, -1:] + spacing * np.arange(1, more + 1)
            longer = jnp.asarray(np.concatenate([times, added], axis=1))
            parts.append((protocols, eqx.tree_at(lambda grid: grid.times, grids, longer)))
        return FlowBatch(tuple(parts), self.rows)

    def in_pieces(self, count: int) -> "FlowBatch":
        """Return the flows with every step cut into so many of one length."""
        if count == 1:
            return self
        parts = []
        for protocols, grids in self.parts:
            if protocols.control != "steady":  # of steady states nothing is stepped
                times, share = np.asarray(grids.times), np.arange(count) / count
                cut = times[:, :-1, None] + np.diff(times, axis=1)[..., None] * share
                cut = np.concatenate([cut.reshape(len(times), -1), times[:, -1:]], axis=1)
                index = count * grids.sample_index
                grids = IntegrationGrid(jnp.asarray(cut), index, grids.sample_mask)
            parts.append((protocols, grids))
        return FlowBatch(tuple(parts), self.rows)

    def faster(self, factor: Float[Array, " runs"]) -> "FlowBatch":
        """Return the flows with the rate of each multiplied; their grids stay.

        Oscillations keep their frequency, and some strain. A given stress may fall but not rise:
        not every fluid bears more.
        """
        parts = []
        for (protocols, grids), rows in zip(self.parts, self.rows, strict=True):
            own = factor[jnp.asarray(rows)][:, None]
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
        return FlowBatch(tuple(parts), self.rows)

    def some(self, first: Int[Array, ""] | np.int32 | int, count: int) -> "FlowBatch":
        """Return so many runs from the first on; all must be of one control."""
        (part,) = self.parts
        chosen = jax.tree.map(lambda leaf: jax.lax.dynamic_slice_in_dim(leaf, first, count), part)
        return FlowBatch((chosen,), (tuple(range(count)),))


def lay_out(
    protocols: Sequence[FlowProtocol],
    times: Sequence[Float[np.ndarray, " _"]],
    n_samples: int = 0,
    **limits: Any,
) -> FlowBatch:
    """Return flows with their grids, as many padded samples in each.

    Parameters
    ----------
    protocols, times
        One flow and its sampling times for each run.
    n_samples
        Pad to so many samples, or to those of the longest run.
    **limits
        As `make_grids` takes them.
    """
    kinds = [(protocol.control, protocol.modulus) for protocol in protocols]
    n = max(n_samples, *(len(sampled) for sampled in times))
    parts, rows = [], []
    for kind in dict.fromkeys(kinds):
        own = tuple(i for i, other in enumerate(kinds) if other == kind)
        flows = [protocols[i] for i in own]
        grids = make_grids(flows, [times[i] for i in own], **limits)
        parts.append((stack_protocols(flows), _with_samples(grids, n)))
        rows.append(own)
    return FlowBatch(tuple(parts), tuple(rows))


def _with_samples(grids: IntegrationGrid, n: int) -> IntegrationGrid:
    index, mask = np.asarray(grids.sample_index), np.asarray(grids.sample_mask)
    more = ((0, 0), (0, n - index.shape[1]))
    if not more[1][1]:
        return grids
    longer = jnp.asarray(np.pad(index, more, mode="edge")), jnp.asarray(np.pad(mask, more))
    return IntegrationGrid(grids.times, *longer, grids.phase)
