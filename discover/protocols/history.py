"""What was done to the fluid before the first sample, as the beginning of its protocol."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from discover.errors import InputError
from discover.plain_numbers import as_number, as_numbers, short
from discover.programs import on_device
from discover.protocols.protocol import FlowProtocol, require_flow, shear_rates

STEADY_LENGTH = 20.0
"""A steady flow before a run is computed over this multiple of the run's length, at most: what
relaxes in the time of the run has become steady by then."""

STEADY_STRAIN = 300.0
"""Strain after which any fluid is taken to be steady."""

CYCLES = 10
"""Cycles computed before the first sample of an oscillation that had gone on. It begins where the
strain is in the middle of its range, so that what relaxes slowly starts without an offset."""

SETTLED = 6.0
"""Relaxation times after which what was different at the start is a four-hundredth of it."""

MOST_CYCLES = 500
"""Cycles that are waited for, at most."""

# Of the time to the first sample: the duration of a step of strain that has none of its own
_AT_ONCE = 1e-3
_PER_CYCLE = 64


def after_steady_flow(protocol: FlowProtocol, rate: float, end: float) -> FlowProtocol:
    """Return the protocol, begun by a flow at a constant rate that has become steady.

    Parameters
    ----------
    protocol
        From t = 0 on.
    rate, end
        Of the flow before, in 1/s, not 0; time of the last sample, in s. InputError if they are
        none, or the protocol is an oscillation by a formula.
    """
    require_flow(protocol, "after_steady_flow")
    end, rate = _positive("end", end), as_number("rate", rate)
    if rate == 0.0:
        raise InputError(f"The rate of the flow before must not be 0; got {rate}. Rest needs none.")
    length = min(STEADY_LENGTH * end, STEADY_STRAIN / abs(rate))
    return _begun(protocol, np.array([-length, 0.0]), np.array([rate, rate]))


def steady_rate_before(protocol: FlowProtocol, end: float) -> float:
    """Return the rate in 1/s of a steady flow by which a protocol is begun; 0 of none.

    `end`: time of the last sample, in s. A step of strain is over in less time and strain.
    """
    length, start_end = -float(protocol.begins), np.asarray(protocol.cycle)
    if length <= 0.0 or np.ptp(start_end) or protocol.control != "rate":
        return 0.0
    rates = shear_rates(protocol, -length * np.linspace(1.0, 0.1, 10))
    steady = length >= end or abs(rates[0]) * length >= 0.99 * STEADY_STRAIN
    return float(rates[0]) if steady and not np.ptp(rates) else 0.0


def after_step_strain(
    protocol: FlowProtocol, strain: float, first: float, duration: float = 0.0
) -> FlowProtocol:
    """Return the protocol, begun by a step of strain that ends at t = 0.

    Parameters
    ----------
    protocol
        From t = 0 on.
    strain, duration
        Put on, in so many s; 0 is at once.
    first
        Time of the first sample after 0, in s: a step at once takes a thousandth of it, which
        changes a relaxing stress by less than that. InputError as of `after_steady_flow`.
    """
    require_flow(protocol, "after_step_strain")
    first = _positive("first", first)
    strain, duration = as_number("strain", strain), as_number("duration", duration)
    if duration < 0.0:
        raise InputError(
            f"A step needs a strain and a duration from 0 on; got {strain}, {duration}."
        )
    length = duration if duration > 0.0 else _AT_ONCE * first
    rate = strain / length
    return _begun(protocol, np.array([-length, 0.0]), np.array([rate, rate]))


def after_alternation(
    protocol: FlowProtocol, period: float, times: Float[np.ndarray, " n"]
) -> FlowProtocol:
    """Return the protocol, begun by cycles like the first one of the record.

    Parameters
    ----------
    protocol
        Its rate over the first period of the record is that of every cycle before.
    period, times
        In s; times of the samples have shape (n,). InputError if the period is not positive.
    """
    require_flow(protocol, "after_alternation")
    period, times = _positive("period", period), np.atleast_1d(as_numbers("times", times))
    if times.ndim != 1 or not times.size:
        raise InputError(f"times must be a list of times in s; got {short(times)}.")
    if np.any(np.asarray(protocol.amplitudes)):
        # a cosine has gone on for ever: begin where its rate is largest
        turn = -CYCLES * period + np.arange(_PER_CYCLE) / _PER_CYCLE * period
        largest = int(np.argmax(np.abs(shear_rates(protocol, turn))))
        begins = jnp.asarray(float(turn[largest]))
        return replace(protocol, begins=begins, cycle=jnp.array([-period, 0.0]))
    # one cycle of the record, whole cycles before it, and from the largest rate on
    phase = np.arange(_PER_CYCLE) / _PER_CYCLE * period
    first = float(times[0])
    cycle = shear_rates(protocol, first + phase)
    knots = np.concatenate([first + phase - k * period for k in range(CYCLES, 0, -1)])
    rates = np.tile(cycle, CYCLES)
    start = int(np.argmax(np.abs(cycle)))
    begun = _begun(protocol, knots[start:], rates[start:], until=first)
    return replace(begun, cycle=jnp.array([first - period, first]))


def settled(protocol: FlowProtocol, relaxation_time: float) -> FlowProtocol:
    """Return the protocol with as many cycles before the record as a mode needs to be periodic.

    `relaxation_time`: the longest, in s. InputError if more than `MOST_CYCLES` would be needed.
    """
    start, end = np.asarray(protocol.cycle)
    period, begins = end - start, float(protocol.begins)
    if period <= 0.0:
        return protocol
    wanted = int(np.ceil(SETTLED * relaxation_time / period))
    if wanted > MOST_CYCLES:
        raise InputError(
            f"A run that starts periodic, with a period of {period:.3g} s, would need {wanted} "
            f"cycles until a mode of {relaxation_time:.3g} s is periodic too, more than the "
            f"{MOST_CYCLES} that a learner waits for. Use close-loop, which solves for the "
            "periodic state, leave the run out, or leave out the slowest modes."
        )
    more = wanted - int((end - begins) / period)
    if more <= 0:
        return protocol
    if np.any(np.asarray(protocol.amplitudes)):
        return replace(protocol, begins=jnp.asarray(begins - more * period))
    knots, rates = np.asarray(protocol.table_times), np.asarray(protocol.table_rates)
    inside = (knots >= start) & (knots < end)
    # from the phase on at which it begins
    first = np.searchsorted(knots[inside] - start, (begins - start) % period - 1e-9 * period)
    before = np.roll(knots[inside] - start, -first)
    before = begins + (before - before[0]) % period - more * period
    cycles = np.concatenate([before + k * period for k in range(more)])
    again = np.tile(np.roll(rates[inside], -first), more)
    return replace(
        protocol,
        table_times=on_device(np.concatenate([cycles, knots])),
        table_rates=on_device(np.concatenate([again, rates])),
        begins=jnp.asarray(float(cycles[0])),
    )


def _positive(name: str, value: float) -> float:
    number = as_number(name, value)
    if number <= 0.0:
        raise InputError(f"{name} must be a positive time in s; got {number:g}.")
    return number


def _begun(
    protocol: FlowProtocol, knots: np.ndarray, rates: np.ndarray, until: float = 0.0
) -> FlowProtocol:
    """Return the protocol with a table of rates before it, which holds until a time in s."""
    if np.any(np.asarray(protocol.amplitudes)):
        raise InputError(
            "An oscillation given by a formula has no beginning, so nothing can come before it. "
            "Give its rate in samples: measured_rate(times, rates)."
        )
    own_times, own_rates = np.asarray(protocol.table_times), np.asarray(protocol.table_rates)
    first, later = np.interp(until, own_times, own_rates), own_times > until
    return replace(
        protocol,
        table_times=on_device(np.concatenate([knots, [until], own_times[later]])),
        table_rates=on_device(np.concatenate([rates, [first], own_rates[later]])),
        begins=jnp.asarray(float(knots[0])),
        # of other samples; what is recorded at a given stress, its run gives again
        table_strains=None,
    )
