"""Protocols that impose a stress, or states each held until it is steady or periodic."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from discover.errors import InputError
from discover.programs import on_device
from discover.protocols.between_samples import knots_between
from discover.protocols.kinematics import STATES, Control
from discover.protocols.protocol import FlowProtocol, measured_rate

# A step of stress: over this share of the time to the next sample. A jump of the record exceeds
# this share of its largest stress, and right beside it changes are less than this share of it
_AT_ONCE, _JUMP, _LEVEL = 1e-3, 0.05, 0.15


def steady_rates(rates: Sequence[float] | np.ndarray) -> FlowProtocol:
    """Return rates in 1/s, each held until the flow is steady: a flow curve."""
    counted = np.arange(1.0, len(rates) + 1.0)
    return replace(measured_rate(counted, rates), control="steady")


def oscillations(
    strains: Sequence[float] | np.ndarray, frequencies: Sequence[float] | np.ndarray
) -> FlowProtocol:
    """Return oscillations, each gone on until periodic.

    `strains`, `frequencies`: amplitude and rad/s of each, shape (n,).
    """
    strains = np.asarray(strains, dtype=float)
    return replace(
        steady_rates(strains * np.asarray(frequencies, dtype=float)),
        control="oscillation",
        modulus="storage_modulus",
        table_strains=on_device(strains),
    )


def imposed_stress(times: Float[np.ndarray, " n"], stress: Float[np.ndarray, " n"]) -> FlowProtocol:
    """Return the stress at samples as what is imposed, from rest at t = 0.

    Between samples it is as a `sampled_rate` is. It jumps at t = 0 if the first samples hold one
    level, and between two levels right after the last sample of the first.

    `times` in s, increasing from 0 on; `stress` in Pa. Raises InputError if there are fewer than
    two samples, or no stress.
    """
    times, stress = np.asarray(times, dtype=float), np.asarray(stress, dtype=float)
    size = float(np.max(np.abs(stress), initial=0.0))
    if len(times) < 2 or size == 0.0:
        raise InputError(
            "A test at a given stress needs two samples or more and a stress other than 0; got "
            f"{len(times)} samples, the largest stress {size:g} Pa. Leave the run out."
        )
    gap = float(times[1] - times[0]) if times[0] == 0.0 else float(times[0])
    first = abs(float(stress[0]))
    at_once = first > _JUMP * size and abs(float(stress[1] - stress[0])) < _LEVEL * first
    begins = -_AT_ONCE * gap if at_once else 0.0
    start = [[begins, 0.0], [0.0, stress[0]]] if at_once else [[0.0], [0.0]]
    if times[0] == 0.0:
        start = [column[:-1] for column in start]
    jumps = _jumps(stress, size)
    parts = [np.array(start)]
    for begin, end in pairwise([0, *(jumps + 1), len(times)]):
        if begin > 0:
            jumped = times[begin - 1] + _AT_ONCE * (times[begin] - times[begin - 1])
            parts.append(np.array([[jumped], [stress[begin]]]))
        piece = np.stack([times[begin:end], stress[begin:end]])
        if begin == 0 and not at_once and times[0] > 0.0:
            piece, parts = np.concatenate([parts[0], piece], axis=1), []
        parts.append(np.stack(knots_between(*piece)))
    knots, levels = np.concatenate(parts, axis=1)
    return replace(measured_rate(knots, levels), control="stress", begins=jnp.asarray(begins))


def _jumps(stress: Float[np.ndarray, " n"], size: float) -> Int[np.ndarray, " j"]:
    """Return after which samples the stress jumps."""
    change = np.abs(np.diff(stress))
    neighbours = np.pad(change, 1)
    beside = np.maximum(neighbours[:-2], neighbours[2:])
    return np.flatnonzero((change > _JUMP * size) & (beside < _LEVEL * change))


def drawn_against(
    control: Control,
    time: Float[np.ndarray, " n"],
    rate: Float[np.ndarray, " n"],
    strain: Float[np.ndarray, " n"],
) -> tuple[str, Float[np.ndarray, " n"]]:
    """Return what a record is drawn against, in words with the unit, and its values.

    Time; of a flow curve the rate; of oscillations frequency or amplitude, whichever varies.
    """
    if control not in STATES:
        return "time (s)", time
    if control == "steady":
        return "shear rate (1/s)", np.abs(rate)
    frequency = rate / strain
    if np.max(frequency) > (1.0 + 1e-6) * np.min(frequency) and np.ptp(strain) == 0.0:
        return "frequency (rad/s)", frequency
    return "strain amplitude", strain


def paced_by(
    protocol: FlowProtocol, times: Float[np.ndarray, " n"], strain: Float[np.ndarray, " n"]
) -> FlowProtocol:
    """Return a protocol at a given stress whose integration keeps pace with a recorded strain."""
    recorded = np.interp(np.asarray(protocol.table_times), times, strain)
    return replace(protocol, table_strains=on_device(recorded))


def jumps_at_start(protocol: FlowProtocol) -> bool:
    """Return whether a stress is imposed at once at t = 0, as in creep."""
    return protocol.control == "stress" and float(protocol.begins) < 0.0
