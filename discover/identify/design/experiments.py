"""Experiments that a user could run next."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np
from jaxtyping import Float

from discover.errors import InputError
from discover.protocols.control import imposed_stress, steady_rates
from discover.protocols.history import after_step_strain
from discover.protocols.kinematics import FLOW_CLASSES, FlowClass
from discover.protocols.protocol import (
    FlowProtocol,
    in_flow,
    measured_rate,
    oscillatory_shear,
    start_up,
    step_rates,
)
from discover.words import unknown_name

Observed = Literal["sigma12", "N1", "N2"]
OBSERVED: tuple[Observed, ...] = ("sigma12", "N1", "N2")
"""What may be measured, the easiest first: torque, axial force, and what needs special plates."""

N_SAMPLES = 101

_FIRST = 1e-2
"""Of a relaxation time: the first sample after a strain was put on."""

_STATES = 10
_HENCKY_STRAIN = 3.0


@dataclass(frozen=True)
class Experiment:
    """A flow that could be run.

    Attributes
    ----------
    title
        In words, with numbers.
    kind
        Class of the flow.
    protocol
        Shear rate against time.
    times
        Samples in s, shape (n,).
    pipkin
        Wi and De of an oscillation, its place on the Pipkin diagram; None for other flows.
    """

    title: str
    kind: FlowClass
    protocol: FlowProtocol
    times: Float[np.ndarray, " n"]
    pipkin: tuple[float, float] | None = None

    @property
    def in_shear(self) -> bool:
        """Whether N1 and N2 may be measured beside what is recorded."""
        return self.protocol.flow == "shear"

    @property
    def in_transient_shear(self) -> bool:
        """Whether the shear rate is given in time."""
        return self.in_shear and self.protocol.control == "rate"


def candidate_experiments(
    relaxation_time: float,
    classes: Sequence[str] = FLOW_CLASSES,
    weissenberg_numbers: Sequence[float] = (0.5, 1.0, 2.0, 4.0),
    deborah_numbers: Sequence[float] = (0.25, 0.5, 1.0, 2.0),
    modulus: float = 1.0,
) -> list[Experiment]:
    """Return experiments of the classes that a user allows.

    Parameters
    ----------
    relaxation_time
        In s; Wi and De are multiplied with its inverse.
    classes
        Of `FLOW_CLASSES`.
    weissenberg_numbers
        λ times the largest rate; in creep also the stress over the modulus, and the strain after
        which stress relaxes.
    deborah_numbers
        λ times the frequency of oscillation.
    modulus
        In Pa, of all modes together.

    Raises
    ------
    InputError
        If a class is unknown, or a number is not positive.
    """
    unknown = [name for name in classes if name not in FLOW_CLASSES]
    if unknown:
        raise InputError(unknown_name("class of experiment", unknown[0], FLOW_CLASSES))
    for label, values in (("Wi", weissenberg_numbers), ("De", deborah_numbers)):
        if not values or not all(np.isfinite(v) and v > 0 for v in values):
            raise InputError(f"{label} must be positive numbers; got {list(values)}.")
    unit = 1.0 / relaxation_time
    found = []
    makers = {**_MAKERS, "creep": partial(_creep, modulus=modulus)}
    for name in FLOW_CLASSES:
        if name in classes:
            found += makers[name](unit, weissenberg_numbers, deborah_numbers)
    return found


def _experiment(title, kind, protocol, duration, unit, pipkin=None) -> Experiment:
    return Experiment(title, kind, protocol, np.linspace(0.0, duration / unit, N_SAMPLES), pipkin)


def _laos(unit, weissenberg, deborah):
    return [
        _experiment(
            f"oscillatory shear at Wi = {wi:g}, De = {de:g}",
            "laos",
            oscillatory_shear(wi * unit, de * unit),
            max(10.0, 2.5 * 2.0 * np.pi / de),
            unit,
            (wi, de),
        )
        for wi in weissenberg
        for de in deborah
    ]


def _start_up(unit, weissenberg, deborah):
    del deborah
    return [
        _experiment(f"start-up of shear at Wi = {wi:g}", "start_up", start_up(wi * unit), 8.0, unit)
        for wi in weissenberg
    ]


def _cessation(unit, weissenberg, deborah):
    del deborah
    stop = 5.0
    return [
        _experiment(
            f"cessation of steady shear at Wi = {wi:g}",
            "cessation",
            step_rates([0.0, stop / unit], [wi * unit, 0.0]),
            stop + 5.0,
            unit,
        )
        for wi in weissenberg
    ]


def _steps(unit, weissenberg, deborah):
    del deborah
    found = []
    for wi in weissenberg:
        for factor, word in ((-1.0, "reversal of"), (0.25, "step down to a quarter from")):
            protocol = step_rates([0.0, 4.0 / unit], [wi * unit, factor * wi * unit])
            found.append(_experiment(f"{word} shear at Wi = {wi:g}", "steps", protocol, 9.0, unit))
    return found


def _superposed(unit, weissenberg, deborah):
    found = []
    for wi in weissenberg:
        de = max(deborah)
        times = np.linspace(0.0, 10.0, 801)
        rates = wi * (1.0 + 0.5 * np.sin(de * times))
        found.append(
            _experiment(
                f"steady shear at Wi = {wi:g} with an oscillation of half that rate at De = {de:g}",
                "superposed",
                measured_rate(times / unit, rates * unit),
                10.0,
                unit,
            )
        )
    return found


def _step_strain(unit, weissenberg, deborah):
    """Return strains put on at the largest rate.

    None at once: no tool does that, and the stress of many a law has no bound then.
    """
    del deborah
    fastest = max(weissenberg)
    times = np.geomspace(_FIRST, 10.0, N_SAMPLES) / unit
    found = []
    for strain in weissenberg:
        lasts = strain / fastest / unit
        begun = after_step_strain(start_up(0.0), strain, first=times[0], duration=lasts)
        title = f"relaxation after a strain of {strain:g} at Wi = {fastest:g}"
        found.append(Experiment(title, "step_strain", begun, times))
    return found


def _flow_curve(unit, weissenberg, deborah):
    del deborah
    low, high = min(weissenberg), max(weissenberg)
    title = f"a flow curve from Wi = {0.1 * low:g} to {high:g}"
    rates = np.geomspace(0.1 * low, high, _STATES) * unit
    counted = np.arange(1.0, _STATES + 1.0)
    return [Experiment(title, "flow_curve", steady_rates(rates), counted)]


def _creep(unit, weissenberg, deborah, modulus):
    """Return stresses that rise as fast as an elastic solid follows at the largest rate."""
    del deborah
    times = np.linspace(0.0, 10.0, N_SAMPLES) / unit
    fastest, found = max(weissenberg) * unit, []
    for level in weissenberg:
        stress = modulus * np.minimum(fastest * times, level)
        title = f"creep at a stress of {level:g} times the modulus"
        found.append(Experiment(title, "creep", imposed_stress(times, stress), times))
    return found


def _extension(kind):
    def make(unit, weissenberg, deborah):
        del deborah
        return [
            _experiment(
                f"{kind} extension at Wi = {wi:g}",
                kind,
                in_flow(start_up(wi * unit), kind),
                _HENCKY_STRAIN / wi,
                unit,
            )
            for wi in weissenberg
        ]

    return make


_MAKERS = {
    "laos": _laos,
    "start_up": _start_up,
    "cessation": _cessation,
    "steps": _steps,
    "superposed": _superposed,
    "step_strain": _step_strain,
    "flow_curve": _flow_curve,
    "uniaxial": _extension("uniaxial"),
    "planar": _extension("planar"),
    "biaxial": _extension("biaxial"),
}
