"""Tables of material functions beside the runs, as runs that can be fitted with them."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from discover.dataset import units
from discover.dataset.run import Run
from discover.dataset.table import Table, read_table
from discover.errors import InputError
from discover.protocols.control import imposed_stress, jumps_at_start, steady_rates
from discover.protocols.history import after_step_strain
from discover.protocols.protocol import in_flow, measured_rate, start_up

LINEAR_STRAIN = 0.01
"""Strain as which a linear material function is looked at: terms beyond the linear ones are some
ten thousandth of them."""

COMPLIANCE = units.Quantity("compliance", "compliance_1_Pa", "1/Pa")
RELAXATION_MODULUS = units.Quantity("relaxation_modulus", "relaxation_modulus_Pa", "Pa")


def read_material_functions(root: Path, runs: Sequence[str] = ()) -> dict[str, Run]:
    """Return the tables of a data folder as runs, by kind: those of `TABLES`.

    Parameters
    ----------
    root
        The folder.
    runs
        Files that ``runs.csv`` names: they are runs, whatever they are called.

    Raises
    ------
    InputError
        If a file is wrong.
    """
    found = {}
    for kind, read in _READERS.items():
        path = root / f"{kind}.csv"
        if path.name in runs or not os.path.lexists(path):
            continue
        if not path.resolve().is_relative_to(root.resolve()):
            raise InputError(
                f"{path.name} is a link to outside the folder. Put the file itself in the folder."
            )
        found[kind] = read(read_table(path))
    return found


def _flow_curve(table: Table) -> Run:
    rate = table.required(units.SHEAR_RATE)
    stress = table.required(units.SHEAR_STRESS)
    _require_positive(table, rate, "shear_rate")
    order = np.argsort(rate, kind="stable")

    def sorted_(values):
        return None if values is None else values[order]

    return Run(
        table.name,
        np.arange(1.0, len(rate) + 1.0),
        steady_rates(rate[order]),
        rate[order],
        stress[order],
        sorted_(table.quantity(units.FIRST_NORMAL_STRESS_DIFFERENCE)),
        sorted_(table.quantity(units.SECOND_NORMAL_STRESS_DIFFERENCE)),
        metadata={"test": "flow curve"},
    )


def _relaxation(table: Table) -> Run:
    time, modulus = _over_time(table, RELAXATION_MODULUS)
    still = np.zeros(len(time))
    return Run(
        table.name,
        time,
        after_step_strain(start_up(0.0), LINEAR_STRAIN, float(time[0])),
        still,
        LINEAR_STRAIN * modulus,
        strain=still + LINEAR_STRAIN,
        metadata={"test": f"relaxation modulus, at a strain of {LINEAR_STRAIN:g}"},
    )


def _creep(table: Table) -> Run:
    time, compliance = _over_time(table, COMPLIANCE)
    stress = np.full(len(time), LINEAR_STRAIN / np.max(compliance))
    strain = stress * compliance
    return Run(
        table.name,
        time,
        imposed_stress(time, stress),
        np.gradient(strain, time),
        stress,
        strain=strain,
        rate_is_measured=True,
        metadata={"test": f"creep compliance, at a stress of {stress[0]:.3g} Pa"},
    )


def _over_time(
    table: Table, quantity: units.Quantity
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    time, values = table.required(units.TIME), table.required(quantity)
    _require_positive(table, time, "time")
    _require_positive(table, values, quantity.stem)
    if len(time) < 3 or np.any(np.diff(time) <= 0):
        raise InputError(
            f"time in {table.name} must increase strictly, over 3 samples or more; got "
            f"{len(time)}. Sort the rows and remove repeated times."
        )
    return time, values


def _require_positive(table: Table, values: np.ndarray, what: str) -> None:
    if np.any(values <= 0):
        row = int(np.argmax(values <= 0))
        raise InputError(
            f"{what} in {table.name} must be positive; line {table.lines[row]} holds "
            f"{values[row]:g}. Remove that line."
        )


_READERS: Mapping[str, Callable[[Table], Run]] = {
    "flow_curve": _flow_curve,
    "relaxation": _relaxation,
    "creep": _creep,
}

TABLES = tuple(_READERS)
"""Kinds of tables; the file of each is called so."""


def at_measured_rate(run: Run) -> Run:
    """Return a run at a given stress as one that follows the rate derived from its strain.

    Raises
    ------
    InputError
        If the stress was put on at once, which no finite rate follows, or it is a flow curve.
    """
    if run.protocol.control == "rate":
        return run
    if run.protocol.control == "steady":
        raise InputError(
            f"{run.name} is a flow curve, which a learner that follows a rate in time cannot fit. "
            "discover close-loop fits it; leave it out here."
        )
    if jumps_at_start(run.protocol):
        raise InputError(
            f"{run.name} is a creep test: its strain jumps with the stress, and no rate can be "
            "followed through a jump. discover close-loop fits it; leave it out here."
        )
    protocol = in_flow(measured_rate(run.time, run.rate), run.flow)
    return replace(run, protocol=protocol, rate_is_measured=True)
