"""Check a data folder and say everything that is wrong with it, not only the first thing."""

from pathlib import Path

import numpy as np

from discover.dataset.load import (
    SWEEP_FILE,
    read_clock_factors,
    read_index,
    read_run,
    read_sweep,
    resolve_folder,
)
from discover.dataset.run import ShearRun
from discover.errors import InputError

FEWEST_SAMPLES = 10
"""Runs with fewer samples than this say little about a law."""


def check_folder(
    folder: str | Path, clock_factor: str | None = None, base: str | Path | None = None
) -> list[str]:
    """Return what is wrong with a data folder, in plain language; empty if it is sound.

    Parameters
    ----------
    folder, clock_factor, base
        As in `discover.dataset.load.load_dataset`.
    """
    try:
        root = resolve_folder(folder, base)
        index = read_index(root)
    except InputError as error:
        return [str(error)]
    problems: list[str] = []
    try:
        read_clock_factors(index, clock_factor)
    except InputError as error:
        problems.append(str(error))
    for row in range(len(index)):
        try:
            problems += _doubts(read_run(root, index, row))
        except InputError as error:
            problems.append(str(error))
    if (root / SWEEP_FILE).exists():
        try:
            read_sweep(root / SWEEP_FILE)
        except InputError as error:
            problems.append(str(error))
    return problems


def _doubts(run: ShearRun) -> list[str]:
    doubts = []
    if len(run) < FEWEST_SAMPLES:
        doubts.append(f"{run.name} has only {len(run)} samples; a fit needs {FEWEST_SAMPLES}.")
    if not np.any(run.shear_rate):
        doubts.append(f"The shear rate in {run.name} is zero throughout, so nothing flows.")
    if not np.any(run.shear_stress):
        doubts.append(f"The stress in {run.name} is zero throughout.")
    return doubts
