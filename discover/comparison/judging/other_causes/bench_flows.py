"""What a gap that is off, and a tool that yields, do to a flow."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from discover.comparison.outcomes.flows import Flow, predict
from discover.laws.multimode import Fluid
from discover.protocols.protocol import measured_rate, shear_rates

_STEP = 1e-2  # of the compliance, times the modulus
_EVENLY, _EARLY = 120, 60  # times between which the rate that is felt is a straight line


def faster(flow: Flow, rate: float, later: float = 0.0) -> Flow:
    """Return a flow whose rates are larger by a share, sampled some time later."""
    protocol, factor = flow.protocol, 1.0 + rate
    if rate:
        protocol = replace(
            protocol,
            table_rates=protocol.table_rates * factor,
            amplitudes=protocol.amplitudes * factor,
        )
    return replace(flow, protocol=protocol, times=flow.times + later)


def yielding(fluid: Fluid, flow: Flow) -> Float[np.ndarray, " n"] | None:
    """Return the change of σ12 by a tool that yields, per compliance times the modulus.

    The fluid feels γ̇ − C dσ12/dt   [Gottlieb & Macosko 1982, Rheol. Acta 21, 90], to first order
    in C. Zero of states, which the tool follows, and of a flow that did not begin at rest; None
    where the law runs away.
    """
    protocol, times = flow.protocol, flow.times
    went_on = float(protocol.begins) < 0.0 or float(protocol.cycle[0]) != float(protocol.cycle[1])
    if flow.is_of_states or went_on:
        return np.zeros(len(times))
    first, last = float(times[times > 0.0][0]), float(times[-1])
    early = np.geomspace(1e-2 * first, last, _EARLY)
    grid = np.unique(np.concatenate([np.linspace(0.0, last, _EVENLY), early]))
    rate = np.asarray(shear_rates(protocol, grid), dtype=float)
    dense = predict(fluid, replace(flow, times=grid, rate=rate, reference={}, measured=None))
    if dense is None or not np.all(np.isfinite(dense["sigma12"])):
        return None
    lost = np.gradient(np.asarray(dense["sigma12"], dtype=float), grid) / float(
        jnp.sum(jnp.asarray(fluid.modulus))
    )
    found = [
        predict(fluid, replace(flow, protocol=measured_rate(grid, one)))
        for one in (rate, rate - _STEP * lost)
    ]
    rows = [np.asarray(one["sigma12"], dtype=float) for one in found if one is not None]
    if len(rows) < len(found) or not np.all(np.isfinite(rows)):
        return None
    return (rows[1] - rows[0]) / _STEP
