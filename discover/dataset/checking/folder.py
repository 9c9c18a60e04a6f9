"""Check a data folder: everything that is wrong or doubtful, not only the first thing."""

import hashlib
import os
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import get_args

import numpy as np
from jaxtyping import Bool

from discover.dataset import index_of_runs, load, material_functions
from discover.dataset.checking import linear_theory, start_up
from discover.dataset.checking import runs as run_checks
from discover.dataset.checking.runs import Finding, Findings, Severity, found
from discover.dataset.index_of_runs import read_index
from discover.dataset.linear_viscoelasticity import relaxation_spectrum
from discover.dataset.load import SWEEP_FILE
from discover.dataset.read_run import INDEX_FILE
from discover.dataset.run import Run, require_signal
from discover.dataset.run_table import run_line
from discover.dataset.tables import units
from discover.dataset.tables.table import Table, read_table, shown
from discover.errors import InputError, problems_in
from discover.words import counted

_RUN_QUANTITIES = (
    units.TIME, units.SHEAR_RATE, units.SHEAR_STRESS, *units.NORMAL_STRESS_DIFFERENCES,
    units.STRAIN, units.HENCKY_RATE, units.TENSILE_STRESS, units.HENCKY_STRAIN,
)  # fmt: skip
_TABLE_QUANTITIES = (
    units.ANGULAR_FREQUENCY, units.STORAGE_MODULUS, units.LOSS_MODULUS,
    material_functions.COMPLIANCE, material_functions.RELAXATION_MODULUS,
)  # fmt: skip
_BEFORE_WORDS = ("rate_before", "shear_rate_before", "initial_rate", "initial_shear_rate")
_CLOCK_WORDS = ("time_factor", "shift_factor", "clock_factor", "a_t", "at")


def check_folder(folder: str | Path, clock_factor: str | None = None) -> Findings:
    """Return what is wrong, doubtful or worth knowing about a data folder; errors come first.

    A run is compared with itself, with what a passive fluid at rest can do, and with linear
    viscoelasticity. `folder`, `clock_factor`: as in `load_dataset`.

    Examples
    --------
    >>> check_folder("melt")  # doctest: +SKIP
    """
    findings: list[Finding] = []
    place = "folder", ""
    try:
        root = load.resolve_folder(folder, None)
        place = "runs", INDEX_FILE
        index = read_index(root)
        findings += _clock(index, clock_factor)
        place = "start", INDEX_FILE
        before = index_of_runs.rates_before(index, None)
        findings += _before(index)
    except InputError as wrong:
        return Findings([*findings, *_errors(*place, wrong)])
    read = load.read_folder(root, index, before)
    names, runs, sweep = index.columns["file"], [*read.runs.values()], read.sweep
    for (subject, file), wrong in read.wrong.items():
        findings += _errors(subject, file, wrong)
    findings += [found("set_aside", name, why=why) for name, why in read.aside.items()]
    for run in runs:
        findings += run_checks.doubts_of_run(run)
    beside = []
    for name in load.DATA_FILES[1:]:
        if name not in names and (root / name).is_file():
            with suppress(InputError):  # said when it is read
                beside.append(read_table(root / name))
    findings += _of_columns([*read.samples.values()], beside)
    spectrum = None
    if sweep is not None:
        try:
            spectrum = relaxation_spectrum(sweep)
            findings += linear_theory.doubts_of_sweep(sweep, spectrum)
        except (InputError, RuntimeError, np.linalg.LinAlgError) as wrong:
            findings.append(found("no_spectrum", SWEEP_FILE, why=wrong))
    elif ("sweep", SWEEP_FILE) not in read.wrong:
        findings.append(found("no_sweep", SWEEP_FILE))
    transients = [run for run in runs if run.protocol.control == "rate"]
    for run in transients:
        findings += start_up.doubts_of_start(run, sweep, spectrum)
        findings += start_up.doubts_of_normal_stress(run, spectrum)
    findings += linear_theory.against_linear_theory(transients, sweep, spectrum)
    if clock_factor is None and not _shift_columns(index):
        findings += run_checks.doubts_of_temperature(runs)
    findings += _of_tables(read)
    with suppress(OSError):
        known = {*names, *load.DATA_FILES}
        tables = sorted(name for name in os.listdir(root) if name.lower().endswith(".csv"))
        findings += [found("not_listed", name) for name in tables if name not in known]
    findings += _copies([*runs, *read.tables.values()])
    rank = get_args(Severity)
    return Findings(sorted(findings, key=lambda finding: rank.index(finding.severity)))


def _errors(subject: str, file: str, wrong: InputError) -> list[Finding]:
    return [Finding("error", subject, file, one) for one in problems_in(str(wrong))]


def _of_tables(read: load.Folder) -> Iterator[Finding]:
    """Yield what each table of steady and periodic states was taken for."""
    for table in read.tables.values():
        kind = str(run_line(table)["flow"])
        kind = f"{'an' if kind[0] in 'ao' else 'a'} {kind}"
        yield found("table", table.name, kind=kind, samples=counted(len(table), "sample"))
    for name, reason in read.unused.items():
        yield found("table_set_aside", name, why=reason)
    if "amplitude_sweep" in read.tables:
        if read.sweep is not None:
            yield found("sweep", SWEEP_FILE, samples=len(read.sweep))
        sweep = read.tables["amplitude_sweep"]
        yield from linear_theory.doubts_of_amplitude_sweep(sweep, read.sweep)


def _shift_columns(index: Table) -> list[str]:
    return [name for name in index.columns if name.lower() in _CLOCK_WORDS]


def _clock(index: Table, column: str | None) -> Iterator[Finding]:
    for name in _shift_columns(index) if column is None else ():
        yield found("clock_column", INDEX_FILE, column=name)
    try:
        factors = index_of_runs.read_clock_factors(index, column)
    except InputError as wrong:
        yield Finding("error", "clock", INDEX_FILE, str(wrong))
        return
    if column is not None and np.all(factors == 1.0):
        yield found("clock_unchanged", INDEX_FILE, column=column)


def _before(index: Table) -> Iterator[Finding]:
    for name in index.columns:
        if not name.lower().startswith(_BEFORE_WORDS):
            continue
        try:
            factor = units.heading_factor(name, units.SHEAR_RATE)
            rates = index_of_runs.rates_in(index, name)
        except InputError as wrong:
            yield found("unknown_rate_before", INDEX_FILE, why=wrong)
            continue
        unit = "1/s" if factor == 1.0 else f"1/s after multiplying by {factor:.6g}"
        words = {"column": name, "unit": unit}
        steady = index_of_runs.starts_steady(index)
        if name != index_of_runs.column_of_rates_before(index) or not np.any(steady):
            yield found("rate_before", INDEX_FILE, **words)
            continue
        yield found("rate_before_used", INDEX_FILE, runs=_runs(index, steady), **words)
        beside = (rates != 0.0) & ~steady
        if np.any(beside):
            yield found("rate_before_beside", INDEX_FILE, runs=_runs(index, beside), column=name)


def _runs(index: Table, which: Bool[np.ndarray, " runs"]) -> str:
    """Return some runs in words: the name of one, or how many."""
    names = [name for name, one in zip(index.columns["file"], which, strict=True) if one]
    return names[0] if len(names) == 1 else counted(len(names), "run")


def _of_columns(runs: Sequence[Table], beside: Sequence[Table]) -> Iterator[Finding]:
    """Yield what looks like a slip, what nobody reads, and what is converted, of all files."""
    unused: dict[str, list[str]] = {}  # files by column
    converted: dict[str, list[str]] = {}  # files by what is done to a column
    for is_run, table in (*((True, one) for one in runs), *((False, one) for one in beside)):
        names = tuple(table.columns)
        wanted = _RUN_QUANTITIES if is_run else (*_RUN_QUANTITIES, *_TABLE_QUANTITIES)
        try:
            columns = {quantity: units.find_column(names, quantity) for quantity in wanted}
        except InputError:  # two columns of a quantity that is not the run's
            continue
        known = {quantity: column for quantity, column in columns.items() if column is not None}
        for quantity, (column, factor) in known.items():
            if text := units.conversion_note(column, factor, quantity):
                converted.setdefault(text, []).append(table.name)
        missing = [one for one in _RUN_QUANTITIES if one not in known]
        read = {column for column, _ in known.values()}
        for column in (one for one in names if is_run and one not in read):
            plain = column.lower()
            meant = [q for q in missing if plain in (q.stem.lower(), q.column.lower())]
            slips = [q for q in missing if column.startswith(f"{q.stem}_")]
            if plain == "strain" or not (meant or slips):
                unused.setdefault(column, []).append(table.name)
                continue
            check, quantity = ("misnamed", meant[0]) if meant else ("no_unit", slips[0])
            words = {"stem": quantity.stem, "name": quantity.column}
            yield found(check, table.name, column=shown(column), **words)
    for check, by_text in (("unused", unused), ("converted", converted)):
        for text, files in by_text.items():
            several = f"{files[0]} and {len(files) - 1} more files" if len(files) > 1 else files[0]
            yield found(check, files[0], files=several, column=shown(text), how=text)


def _copies(runs: list[Run]) -> Iterator[Finding]:
    """Yield which runs hold the same samples, and that none holds a signal."""
    seen: dict[bytes, str] = {}
    for run in runs:
        # what tells runs of different samples apart, however many there are
        digest = hashlib.sha256(run.time.tobytes() + run.recorded.tobytes()).digest()
        first = seen.setdefault(digest, run.name)
        if first != run.name:
            yield found("copy", run.name, other=first)
    try:
        require_signal(runs)
    except InputError as wrong:
        yield Finding("error", "signal", "", str(wrong))
