"""Check a data folder and say everything that is wrong or doubtful, not only the first thing."""

import hashlib
import os
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import get_args

import numpy as np

from discover.dataset.checking.linear_theory import (
    against_linear_theory,
    doubts_of_amplitude_sweep,
    doubts_of_sweep,
)
from discover.dataset.checking.runs import (
    Finding,
    Findings,
    Severity,
    doubts_among_runs,
    doubts_of_run,
    doubts_of_temperature,
    error,
    note,
    warning,
)
from discover.dataset.checking.start_up import doubts_of_normal_stress, doubts_of_start
from discover.dataset.linear_viscoelasticity import (
    LinearSweep,
    RelaxationSpectrum,
    relaxation_spectrum,
)
from discover.dataset.load import (
    SWEEP_FILE,
    find_sweep,
    rates_before,
    read_clock_factors,
    read_index,
    resolve_folder,
)
from discover.dataset.material_functions import (
    COMPLIANCE,
    RELAXATION_MODULUS,
    TABLES,
    read_material_functions,
)
from discover.dataset.read_run import INDEX_FILE, read_run, reason_to_set_aside, table_of_run
from discover.dataset.run import Run, require_signal
from discover.dataset.run_table import run_line
from discover.dataset.tables import units
from discover.dataset.tables.table import Table, read_table, shown
from discover.dataset.tables.units import Quantity
from discover.errors import InputError, problems_in

_RUN_QUANTITIES = (
    units.TIME, units.SHEAR_RATE, units.SHEAR_STRESS, *units.NORMAL_STRESS_DIFFERENCES,
    units.STRAIN, units.HENCKY_RATE, units.TENSILE_STRESS, units.HENCKY_STRAIN,
)  # fmt: skip
_SWEEP_QUANTITIES = (units.ANGULAR_FREQUENCY, units.STORAGE_MODULUS, units.LOSS_MODULUS)
_TABLE_QUANTITIES = (*_RUN_QUANTITIES, *_SWEEP_QUANTITIES, COMPLIANCE, RELAXATION_MODULUS)
_BEFORE_WORDS = ("rate_before", "shear_rate_before", "initial_rate", "initial_shear_rate")
_CLOCK_WORDS = ("time_factor", "shift_factor", "clock_factor", "a_t", "at")


def check_folder(
    folder: str | Path, clock_factor: str | None = None, base: str | Path | None = None
) -> Findings:
    """Return what is wrong, doubtful or worth knowing about a data folder; errors come first.

    Nothing is simulated: the checks compare a run with itself, with what a passive fluid at rest
    can do, and with linear viscoelasticity.

    Parameters
    ----------
    folder, clock_factor, base
        As in `discover.dataset.load.load_dataset`.

    Examples
    --------
    >>> import discover as dc
    >>> dc.check_folder("melt")  # doctest: +SKIP
    """
    findings: list[Finding] = []
    place = "folder", ""
    try:
        root = resolve_folder(folder, base)
        place = "runs", INDEX_FILE
        index = read_index(root)
        findings += [*_clock(index, clock_factor), *_before(index)]
        place = "start", INDEX_FILE
        before = rates_before(index, None)
    except InputError as wrong:
        return Findings([*findings, *_errors(*place, wrong)])
    seen = _Columns()
    runs: list[Run] = []
    for row, name in enumerate(index.columns["file"]):
        try:
            reason = reason_to_set_aside(index, row, rate_before=True)
            if reason is not None:
                findings.append(note("runs", name, f"{name} is set aside: {reason}."))
                continue
            rate = None if before is None else float(before[row])
            table = table_of_run(root, name)
            runs.append(read_run(table, index, row, rate_before=rate))
        except InputError as wrong:
            findings += _errors("run", name, wrong)
            continue
        findings += [*doubts_of_run(runs[-1]), *seen.of_run(table)]
    for column, files in seen.unused.items():
        text = f"The column {shown(column)} in {_files(files)} is not used."
        findings.append(note("columns", files[0], text))
    sweep, spectrum, of_sweep = _sweep(root, seen)
    for name in (f"{kind}.csv" for kind in TABLES):
        if name not in index.columns["file"] and (root / name).is_file():
            with suppress(InputError):  # said when it is read
                seen.note_conversions(read_table(root / name), _TABLE_QUANTITIES)
    for text, files in seen.converted.items():
        findings.append(note("units", files[0], f"In {_files(files)}, {text}."))
    findings += of_sweep
    transients = [run for run in runs if run.protocol.control == "rate"]
    for run in transients:
        findings += doubts_of_start(run, sweep, spectrum)
        findings += doubts_of_normal_stress(run, sweep, spectrum)
    findings += against_linear_theory(transients, sweep, spectrum)
    findings += doubts_among_runs(transients)
    if clock_factor is None and not _shift_columns(index):
        findings += doubts_of_temperature(runs)
    tables, of_tables = _tables(root, index, sweep)
    findings += [*of_tables, *_others(root, index), *_copies([*runs, *tables.values()])]
    rank = get_args(Severity)
    return Findings(sorted(findings, key=lambda finding: rank.index(finding.severity)))


def _errors(what: str, where: str, wrong: InputError) -> list[Finding]:
    return [error(what, where, one) for one in problems_in(str(wrong))]


def _tables(
    root: Path, index: Table, sweep: LinearSweep | None
) -> tuple[dict[str, Run], list[Finding]]:
    """Return the tables of steady and periodic states, and what each was taken for."""
    try:
        tables, aside = read_material_functions(root, index.columns["file"])
    except InputError as wrong:
        return {}, _errors("tables", "", wrong)
    findings: list[Finding] = []
    for table in tables.values():
        kind = str(run_line(table)["flow"])
        text = f"{table.name} is taken for {'an' if kind[0] in 'ao' else 'a'} {kind}, "
        text += f"{len(table)} samples: it tests the law, unless the study fits it."
        findings.append(note("tables", table.name, text))
    for name, reason in aside.items():
        findings.append(warning("tables", name, f"{name} is set aside: {reason}."))
    if "amplitude_sweep" in tables:
        if sweep is not None:
            text = (
                f"{SWEEP_FILE} is taken for a frequency sweep at small strain, {len(sweep)} "
                "frequencies: used for the relaxation spectrum; not fitted unless the study asks "
                "for it."
            )
            findings.append(note("tables", SWEEP_FILE, text))
        findings += doubts_of_amplitude_sweep(tables["amplitude_sweep"], sweep)
    return tables, findings


def _shift_columns(index: Table) -> list[str]:
    """Return the columns by which times may have been shifted to one temperature."""
    return [name for name in index.columns if name.lower() in _CLOCK_WORDS]


def _clock(index: Table, column: str | None) -> Iterator[Finding]:
    for name in _shift_columns(index) if column is None else ():
        text = (
            f"{INDEX_FILE} has a column {name}. If the times were shifted by it to another "
            f'temperature, write clock_factor = "{name}" in the study, so that effects of '
            "the instrument are looked for on the instrument's clock."
        )
        yield note("clock", INDEX_FILE, text)
    try:
        factors = read_clock_factors(index, column)
    except InputError as wrong:
        yield error("clock", INDEX_FILE, str(wrong))
        return
    if column is not None and np.all(factors == 1.0):
        text = f"{column} is 1 in every run, so it changes nothing."
        yield note("clock", INDEX_FILE, text)


def _before(index: Table) -> Iterator[Finding]:
    for name in index.columns:
        if not name.lower().startswith(_BEFORE_WORDS):
            continue
        try:
            factor = units.heading_factor(name, units.SHEAR_RATE)
        except InputError as wrong:
            yield warning("start", INDEX_FILE, str(wrong))
            continue
        unit = "1/s" if factor == 1.0 else f"1/s after multiplying by {factor:.6g}"
        text = (
            f"{INDEX_FILE} has a column {name}. If each run starts from a steady flow at that "
            f'rate, write rate_before = "{name}" in the study, which reads it in {unit}; '
            "without it every run starts from rest."
        )
        yield note("start", INDEX_FILE, text)


def _files(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{names[0]} and {len(names) - 1} more files"


class _Columns:
    """What the columns of the files are read as, over all of them."""

    def __init__(self):
        self.unused: dict[str, list[str]] = {}  # files by column
        self.converted: dict[str, list[str]] = {}  # files by what is done to a column

    def note_conversions(self, table: Table, quantities: Sequence[Quantity]) -> dict[Quantity, str]:
        """Keep which columns of a file are converted; return the column of each quantity."""
        found = {one: units.find_column(tuple(table.columns), one) for one in quantities}
        known = {one: column for one, column in found.items() if column is not None}
        for quantity, (column, factor) in known.items():
            if text := units.conversion_note(column, factor, quantity):
                self.converted.setdefault(text, []).append(table.name)
        return {one: column for one, (column, _) in known.items()}

    def of_run(self, table: Table) -> Iterator[Finding]:
        """Yield what looks like a slip in the columns of a run; keep those that nobody reads."""
        try:
            known, name = self.note_conversions(table, _RUN_QUANTITIES), table.name
        except InputError:  # two columns of a quantity that is not the run's
            return
        missing = [one for one in _RUN_QUANTITIES if one not in known]
        for column in table.columns:
            if column in known.values():
                continue
            meant = [q for q in missing if column.lower() in (q.stem.lower(), q.column.lower())]
            slips = [q for q in missing if column.startswith(f"{q.stem}_")]
            if meant and column.lower() != "strain":
                text = (
                    f"The column {column} in {name} is not read. If it holds {meant[0].stem}, "
                    f"rename it to {meant[0].column}."
                )
            elif slips:
                text = (
                    f"The column {shown(column)} in {name} is not read: it ends in no unit of "
                    f"{slips[0].stem}. If it holds that, rename it to {slips[0].column}."
                )
            else:
                self.unused.setdefault(column, []).append(name)
                continue
            yield warning("columns", name, text)


def _sweep(
    root: Path, seen: _Columns
) -> tuple[LinearSweep | None, RelaxationSpectrum | None, list[Finding]]:
    try:
        sweep = find_sweep(root)
    except InputError as wrong:
        return None, None, _errors("sweep", SWEEP_FILE, wrong)
    if sweep is None:
        text = (
            f"The folder has no {SWEEP_FILE}. Without a linear sweep the relaxation times must be "
            "declared or fitted, and a wrong one looks like a missing effect."
        )
        return None, None, [warning("sweep", SWEEP_FILE, text)]
    seen.note_conversions(read_table(root / SWEEP_FILE), _SWEEP_QUANTITIES)
    try:
        spectrum = relaxation_spectrum(sweep)
    except (InputError, RuntimeError, np.linalg.LinAlgError) as wrong:
        text = f"No relaxation spectrum can be found from {SWEEP_FILE}: {wrong}"
        return sweep, None, [warning("sweep", SWEEP_FILE, text)]
    return sweep, spectrum, list(doubts_of_sweep(sweep, spectrum))


def _others(root: Path, index: Table) -> Iterator[Finding]:
    """Yield which tables nothing reads."""
    tables = (f"{kind}.csv" for kind in TABLES)
    listed = {*index.columns["file"], INDEX_FILE, SWEEP_FILE, *tables}
    there: list[str] = []
    with suppress(OSError):
        there = sorted(name for name in os.listdir(root) if name.lower().endswith(".csv"))
    for name in there:
        if name not in listed:
            yield note("runs", name, f"{name} is not named in {INDEX_FILE}, so it is not used.")


def _copies(runs: list[Run]) -> Iterator[Finding]:
    """Yield which runs hold the same samples, and that none holds a signal."""
    seen: dict[bytes, str] = {}
    for run in runs:
        # what tells runs of different samples apart, however many there are
        digest = hashlib.sha256(run.time.tobytes() + run.recorded.tobytes()).digest()
        first = seen.setdefault(digest, run.name)
        if first != run.name:
            text = (
                f"{run.name} holds the same samples as {first}. Held out, a copy of a fitted "
                "run proves nothing: remove one."
            )
            yield warning("runs", run.name, text)
    try:
        require_signal(runs)
    except InputError as wrong:
        yield error("signal", "", str(wrong))
