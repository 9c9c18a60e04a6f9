"""Tables of material functions beside the runs, as runs that can be fitted with them."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from discover.dataset.linear_viscoelasticity import LinearSweep
from discover.dataset.run import Run
from discover.dataset.tables import units
from discover.dataset.tables.table import Table, table_in
from discover.errors import InputError
from discover.protocols.control import imposed_stress, oscillations, steady_rates
from discover.protocols.history import after_step_strain
from discover.protocols.protocol import start_up

# strain as which a linear material function is looked at: what is not linear is some 1e-4 of it
LINEAR_STRAIN = 0.01
COMPLIANCE = units.Quantity("compliance", "compliance_1_Pa", "1/Pa")
RELAXATION_MODULUS = units.Quantity("relaxation_modulus", "relaxation_modulus_Pa", "Pa")


def read_material_functions(
    root: Path, runs: Sequence[str], frequency: float | None = None
) -> tuple[dict[str, Run], dict[str, str]]:
    """Tables of a data folder as runs, by kind, and why others cannot be used, by file.

    `runs`: named in ``runs.csv``. `frequency` in rad/s, of a sweep that does not give its own.
    """
    found, aside = {}, {}
    for kind, read in _READERS.items():
        name = f"{kind}.csv"
        if name in runs or (table := table_in(root, name)) is None:
            continue
        if kind == "amplitude_sweep" and table.quantity(units.ANGULAR_FREQUENCY) is None:
            if frequency is None:
                aside[name] = (
                    "it has no column omega_rad_s, and moduli belong to a frequency. Add it, or "
                    "write amplitude_sweep_rad_s in [data]"
                )
                continue
            same = {units.ANGULAR_FREQUENCY.column: [repr(frequency)] * len(table)}
            table = replace(table, columns={**table.columns, **same})
        found[kind] = read(table)
    return found, aside


def _flow_curve(table: Table) -> Run:
    rate, stress = table.all_required(units.SHEAR_RATE, units.SHEAR_STRESS)
    table.require_positive(units.SHEAR_RATE)
    order = np.argsort(rate, kind="stable")
    n1, n2 = (
        None if values is None else values[order]
        for values in map(table.quantity, units.NORMAL_STRESS_DIFFERENCES)
    )
    rate, stress = rate[order], stress[order]
    counts, about = np.arange(1.0, len(order) + 1.0), {"test": "flow curve"}
    return Run(table.name, counts, steady_rates(rate), rate, stress, n1, n2, metadata=about)


def _relaxation(table: Table) -> Run:
    time, modulus = _over_time(table, RELAXATION_MODULUS)
    still = np.zeros(len(time))
    step = after_step_strain(start_up(0.0), LINEAR_STRAIN, float(time[0]))
    stress, strain = LINEAR_STRAIN * modulus, still + LINEAR_STRAIN
    about = {"test": f"relaxation modulus, at a strain of {LINEAR_STRAIN:g}"}
    return Run(table.name, time, step, still, stress, strain=strain, metadata=about)


def _creep(table: Table) -> Run:
    time, compliance = _over_time(table, COMPLIANCE)
    stress = np.full(len(time), LINEAR_STRAIN / np.max(compliance))
    strain = stress * compliance
    imposed, rate = imposed_stress(time, stress), np.gradient(strain, time)
    about = {"test": f"creep compliance, at a stress of {stress[0]:.3g} Pa"}
    return Run(
        table.name, time, imposed, rate, stress, strain=strain, rate_is_measured=True,
        metadata=about,
    )  # fmt: skip


def _amplitude_sweep(table: Table) -> Run:
    columns = table.all_required(
        units.STRAIN, units.ANGULAR_FREQUENCY, units.STORAGE_MODULUS, units.LOSS_MODULUS
    )
    table.require_positive(units.STRAIN, units.ANGULAR_FREQUENCY)
    order = np.lexsort(columns[:2])
    return _oscillations(table.name, "amplitude sweep", *(values[order] for values in columns))


def linear_sweep_as_run(sweep: LinearSweep) -> Run:
    """Return a linear sweep as a run: oscillations of a strain of `LINEAR_STRAIN`."""
    strain = np.full(len(sweep), LINEAR_STRAIN)
    moduli = sweep.storage_modulus, sweep.loss_modulus
    what = f"linear sweep, at a strain of {LINEAR_STRAIN:g}"
    return _oscillations("lve.csv", what, strain, sweep.angular_frequency, *moduli)


def _oscillations(name, what, strain, frequency, storage, loss) -> Run:
    counts, stress = np.arange(1.0, len(strain) + 1.0), strain * np.hypot(storage, loss)
    flow, rate = oscillations(strain, frequency), strain * frequency
    moduli = {"storage_modulus": storage, "loss_modulus": loss}
    return Run(name, counts, flow, rate, stress, strain=strain, metadata={"test": what}, **moduli)


def _over_time(table: Table, quantity: units.Quantity) -> list[Float[np.ndarray, " n"]]:
    time, values = table.all_required(units.TIME, quantity)
    table.require_positive(units.TIME, quantity)
    if len(time) < 3 or np.any(np.diff(time) <= 0):
        raise InputError(
            f"time in {table.name} must increase strictly, over 3 samples or more; got "
            f"{len(time)}. Sort the rows and remove repeated times."
        )
    return [time, values]


_READERS: Mapping[str, Callable[[Table], Run]] = {
    "flow_curve": _flow_curve, "relaxation": _relaxation, "creep": _creep,
    "amplitude_sweep": _amplitude_sweep,
}  # fmt: skip

TABLES = tuple(_READERS)
"""Kinds of tables; the file of each is called so. The linear sweep is one more, which gives the
modes and is fitted or judged only where that is asked for."""


def as_compared(runs: Iterable[Run]) -> list[Run]:
    """Return runs as learners take them: oscillations as a record of each modulus."""
    return [record for run in runs for record in run.records]
