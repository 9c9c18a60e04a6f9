"""Protocols: what the rheometer was told to do, in shear and in extension."""

from collections.abc import Sequence
from dataclasses import replace
from types import ModuleType
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.integrate import cumulative_trapezoid

from discover.errors import InputError
from discover.plain_numbers import as_numbers, short
from discover.programs import on_device
from discover.protocols.kinematics import (
    MODULI,
    Control,
    FlowKind,
    Kinematics,
    RecordedQuantity,
    kind_of,
    kinematics_of,
    of_one_kind,
    quantity_of,
)
from tensor_library.algebra import VelocityGradient


class FlowProtocol(eqx.Module):
    """Rate of deformation as a function of time: a piecewise-linear table plus a sum of cosines.

    One class holds every protocol, so that runs of all kinds stack into one batch. A jump is two
    table entries at one time. The fluid is at rest until the protocol begins, which is before t = 0
    where a step of strain, a steady flow or an oscillation came before the record.

    Attributes
    ----------
    table_times, table_rates
        In s and 1/s, shape (m,); held at the end values.
    amplitudes, frequencies, phases
        Cosine terms a cos(ω t + φ), shape (c,), in 1/s, rad/s and rad.
    begins
        Time in s, zero or negative, until which the fluid was at rest.
    cycle
        Times in s of the last cycle before the record, of an oscillation that had gone on; else the
        same twice.
    kinematics
        Which flow has this rate; None is simple shear, for which a scalar is enough.
    control, modulus
        ``rate``; ``stress``: the table holds the stress imposed, in Pa, and the strain is recorded;
        ``steady`` or ``oscillation``: each sample is a state, counted by time, at this rate or
        amplitude of it. Which modulus is recorded of oscillations.
    table_strains
        Shape (m,): amplitudes of oscillations; at a given stress the strain recorded, which only
        sets the pace of the integration. None elsewhere.
    """

    table_times: Float[Array, " m"]
    table_rates: Float[Array, " m"]
    amplitudes: Float[Array, " c"]
    frequencies: Float[Array, " c"]
    phases: Float[Array, " c"]
    begins: Float[Array, ""] = eqx.field(default=0.0, converter=on_device)
    cycle: Float[Array, "2"] = eqx.field(default=(0.0, 0.0), converter=on_device)
    kinematics: Kinematics | None = None
    control: Control = eqx.field(static=True, default="rate")
    modulus: RecordedQuantity | None = eqx.field(static=True, default=None)
    table_strains: Float[Array, " m"] | None = None

    def velocity_gradient(self, time: Float[Array, ""]) -> VelocityGradient:
        """Return L(t) in 1/s: its four components, or the scalar shear rate in simple shear."""
        rate = self.rate(time)
        return rate if self.kinematics is None else rate * self.kinematics.gradient

    @property
    def flow(self) -> FlowKind:
        """Name of the flow."""
        return kind_of(self.kinematics)

    @property
    def quantity(self) -> RecordedQuantity:
        """What is recorded, as studies and results spell it."""
        if self.modulus is not None:
            return self.modulus
        return "strain" if self.control == "stress" else quantity_of(self.kinematics)

    def recorded_stress(self, components: Float[Array, "4 ..."]) -> Float[Array, " ..."]:
        """Return what a rheometer records of σ11, σ22, σ33, σ12 in this flow."""
        return components[3] if self.kinematics is None else self.kinematics.stress(components)

    def rate(self, time: Float[Array, ""]) -> Float[Array, ""]:
        """Return γ̇(t) in 1/s, in extension the Hencky rate; at a jump, the value after it."""
        time = jnp.asarray(time)
        table = in_table(jnp, time, self.table_times, self.table_rates)
        waves = self.amplitudes * jnp.cos(self.frequencies * time + self.phases)
        return table + jnp.sum(waves)

    def strain_in_table(self, time: Float[Array, ""]) -> Float[Array, ""]:
        """Return the strain that belongs to the table, such as the amplitude of an oscillation."""
        assert self.table_strains is not None
        return in_table(jnp, jnp.asarray(time), self.table_times, self.table_strains)


def in_table(xp: ModuleType, times: Any, knots: Any, values: Any) -> Any:
    """Return at times what a table holds, straight between its knots; `xp`: NumPy or JAX's."""
    # interp leaves the value at a repeated abscissa (a jump) undefined
    if knots.size == 1:
        return xp.full(times.shape, values[0])
    left = xp.clip(xp.searchsorted(knots, times, side="right") - 1, 0, knots.size - 2)
    width, after = knots[left + 1] - knots[left], times - knots[left]
    share = xp.where(width > 0.0, after / xp.where(width > 0.0, width, 1.0), after >= 0.0)
    return values[left] + xp.clip(share, 0.0, 1.0) * (values[left + 1] - values[left])


def _checked(name: str, values: Sequence[float] | np.ndarray) -> np.ndarray:
    array = np.atleast_1d(as_numbers(name, values))
    if array.ndim != 1 or array.size == 0:
        raise InputError(f"{name} must be a non-empty list of numbers; got {short(values)}.")
    return array


def _pair(name: str, times: Sequence[float] | np.ndarray, rates: Sequence[float] | np.ndarray):
    t, r = _checked("times", times), _checked("rates", rates)
    if t.size != r.size or np.any(np.diff(t) <= 0):
        raise InputError(
            f"{name} needs as many rates as times, and strictly increasing times; got {t.size} "
            f"times and {r.size} rates."
        )
    return t, r


def require_flow(protocol: object, name: str) -> None:
    """Refuse what is no flow, as an argument of a function of this name."""
    if not isinstance(protocol, FlowProtocol):
        raise InputError(
            f"{name} takes a flow, such as start_up(0.3); got a {type(protocol).__name__}."
        )


def _protocol(times, rates, amplitudes=(0.0,), frequencies=(0.0,), phases=(0.0,)) -> FlowProtocol:
    table, waves = (times, rates), (amplitudes, frequencies, phases)
    t, r, a, f, p = (on_device(np.asarray(part, float)) for part in (*table, *waves))
    return FlowProtocol(t, r, a, f, p)


def oscillatory_shear(amplitude: float, frequency: float, phase: float = 0.0) -> FlowProtocol:
    """Return γ̇(t) = amplitude · cos(frequency · t + phase).

    Parameters
    ----------
    amplitude, frequency, phase
        In 1/s, rad/s (positive) and rad; dimensionless, the Weissenberg and Deborah numbers.

    Examples
    --------
    >>> import discover as dc
    >>> import jax.numpy as jnp
    >>> float(dc.oscillatory_shear(2.0, 0.5).rate(jnp.asarray(0.0)))
    2.0
    """
    _checked("amplitude, frequency and phase", [amplitude, frequency, phase])
    if frequency <= 0:
        raise InputError(
            f"frequency must be positive; got {frequency}. Use start_up for a constant rate."
        )
    return _protocol([0.0], [0.0], [amplitude], [frequency], [phase])


def start_up(rate: float) -> FlowProtocol:
    """Return the constant shear rate γ̇(t) = rate, in 1/s, from rest at t = 0."""
    _checked("rate", [rate])
    return _protocol([0.0], [rate])


def step_rates(times: Sequence[float], rates: Sequence[float]) -> FlowProtocol:
    """Return a shear rate that jumps to ``rates[i]`` at ``times[i]``.

    `times`, `rates`: in s, increasing, and in 1/s, as many, shape (n,); the first rate also holds
    before ``times[0]``.
    """
    t, r = _pair("step_rates", times, rates)
    # each jump is a pair of entries at one time
    table_times = np.concatenate([t[:1], np.repeat(t[1:], 2)])
    table_rates = np.concatenate([np.repeat(r[:-1], 2), r[-1:]])
    return _protocol(table_times, table_rates)


def measured_rate(
    times: Sequence[float] | np.ndarray, rates: Sequence[float] | np.ndarray
) -> FlowProtocol:
    """Return the piecewise-linear shear rate through measured points.

    `times`, `rates`: in s, strictly increasing, and in 1/s, as many, shape (n,). Of few samples a
    cycle straight lines cut the crests: `sampled_rate` does not.

    Examples
    --------
    >>> import discover as dc
    >>> import jax.numpy as jnp
    >>> float(dc.measured_rate([0.0, 1.0], [0.0, 3.0]).rate(jnp.asarray(0.5)))
    1.5
    """
    return _protocol(*_pair("measured_rate", times, rates))


def in_flow(protocol: FlowProtocol, kind: str) -> FlowProtocol:
    """Return the protocol with its rate in another flow: uniaxial, planar or biaxial extension.

    Raises InputError if there is no such flow.

    Examples
    --------
    >>> import discover as dc
    >>> dc.in_flow(dc.start_up(0.3), "uniaxial").flow
    'uniaxial'
    """
    require_flow(protocol, "in_flow")
    found = kinematics_of(kind)
    return replace(protocol, kinematics=None if kind == "shear" else found)


def recording(protocol: FlowProtocol, quantity: RecordedQuantity) -> FlowProtocol:
    """Return the same flow with another quantity recorded: N1 or N2 in shear, or a modulus."""
    if quantity in MODULI:
        return replace(protocol, modulus=quantity)
    return replace(protocol, kinematics=kinematics_of(protocol.flow, quantity))


def stack_protocols(protocols: Sequence[FlowProtocol]) -> FlowProtocol:
    """Return one protocol with a leading batch axis, for `jax.vmap`.

    Tables are padded by holding their last value, cosines by zero amplitudes.
    """
    m = max(p.table_times.shape[0] for p in protocols)
    c = max(p.amplitudes.shape[0] for p in protocols)
    flows = of_one_kind([p.kinematics for p in protocols])
    # at a given stress it has paced the grid by now
    bare = [replace(p, table_strains=None) if p.control == "stress" else p for p in protocols]
    stacked = [
        replace(_padded(p, m, c), kinematics=flow) for p, flow in zip(bare, flows, strict=True)
    ]
    return jax.tree.map(lambda *leaves: on_device(np.stack(leaves)), *stacked)


def _padded(protocol: FlowProtocol, entries: int, cosines: int) -> FlowProtocol:
    # in numpy: every operation of JAX's outside a program is a program of its own to compile
    times, rates = np.asarray(protocol.table_times), np.asarray(protocol.table_rates)
    rows = entries - times.size
    strains = protocol.table_strains
    if strains is not None:
        strains = np.pad(np.asarray(strains), (0, rows), mode="edge")
    waves = (0, cosines - protocol.amplitudes.shape[0])
    amplitudes, frequencies, phases = (
        on_device(np.pad(np.asarray(v), waves))
        for v in (protocol.amplitudes, protocol.frequencies, protocol.phases)
    )
    return replace(
        protocol, table_times=on_device(np.concatenate([times, times[-1] + 1.0 + np.arange(rows)])),
        table_rates=on_device(np.pad(rates, (0, rows), mode="edge")), amplitudes=amplitudes,
        frequencies=frequencies, phases=phases,
        table_strains=None if strains is None else on_device(strains),
    )  # fmt: skip


def recorded_at(
    protocol: FlowProtocol, components: Float[np.ndarray, "n 4"]
) -> Float[np.ndarray, " n"]:
    """Return what a rheometer records of σ11, σ22, σ33, σ12 at many times, shape (n,)."""
    flow = protocol.kinematics
    return components[:, 3] if flow is None else components @ np.asarray(flow.recorded)


def shear_rates(protocol: FlowProtocol, times: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return γ̇ in 1/s at many times in s, shape (n,)."""
    # in NumPy, as all below: without a program for each length
    knots, rates, amplitudes, frequencies, phases = _in_numpy(protocol)
    waves = np.cos(np.outer(times, frequencies) + phases) @ amplitudes
    return in_table(np, np.asarray(times), knots, rates) + waves


def strains(protocol: FlowProtocol, times: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return the strain since t = 0 at many times in s, exactly integrated, shape (n,)."""
    knots, rates, amplitudes, frequencies, phases = _in_numpy(protocol)
    at_knots = cumulative_trapezoid(rates, knots, initial=0.0)
    places = np.append(times, 0.0)
    last = np.clip(np.searchsorted(knots, places, side="right") - 1, 0, None)
    mean = 0.5 * (rates[last] + in_table(np, places, knots, rates))
    area = at_knots[last] + (places - knots[last]) * mean
    # the integral of a cosine from 0 on, that of a constant too
    half = 0.5 * np.outer(times, frequencies)
    waves = (np.cos(half + phases) * np.sinc(half / np.pi)) @ amplitudes
    return area[:-1] - area[-1] + times * waves


def strains_in_table(
    protocol: FlowProtocol, times: Float[np.ndarray, " n"]
) -> Float[np.ndarray, " n"]:
    """Return the strains of the table at many times, such as amplitudes, shape (n,)."""
    table = np.asarray(protocol.table_times), np.asarray(protocol.table_strains)
    return in_table(np, np.asarray(times), *table)


def _in_numpy(protocol: FlowProtocol) -> list[np.ndarray]:
    """Return times and rates of the table; amplitudes, frequencies and phases of the cosines."""
    names = "table_times", "table_rates", "amplitudes", "frequencies", "phases"
    return [np.asarray(getattr(protocol, name)) for name in names]


TRAINING_DURATION = 20.0
"""Length of every training series, in relaxation times."""

TEST_DURATION = 40.0
"""Length of the oscillatory tests: past what training saw."""

DEBORAH_NUMBERS = (0.25, 0.5, 0.75, 1.0)
WEISSENBERG_NUMBERS = (1.0, 2.0)


def paper_training_protocols() -> dict[str, FlowProtocol]:
    """Return the eight training flows γ̇ = Wi cos(De t), keyed ``laos_WI_DE``."""
    return {
        f"laos_{wi:g}_{de:g}": oscillatory_shear(wi, de)
        for wi in WEISSENBERG_NUMBERS
        for de in DEBORAH_NUMBERS
    }


def paper_test_protocols() -> dict[str, FlowProtocol]:
    """Return the three flows that no training saw, keyed by name.

    ``laos_2_1`` repeats a training flow past its last time, as the paper does.
    """
    return {
        "laos_3_1.5": oscillatory_shear(3.0, 1.5),
        "laos_2_1": oscillatory_shear(2.0, 1.0),
        "startup_2": start_up(2.0),
    }
