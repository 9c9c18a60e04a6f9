"""Tests become the files of a folder; what of an export is not read is named."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from discover.dataset.importing.readings import INSTRUMENT, Readings
from discover.dataset.importing.records import Record
from discover.dataset.importing.text_export import Block
from discover.dataset.importing.which_test import Recognised
from discover.dataset.load import INDEX_FILE, TESTS_FILE
from discover.dataset.tables.table import shown

# what each kind of test is called, and its table beside the runs, without its ending
_KINDS = {
    "frequency_sweep": ("a frequency sweep at small strain", "lve"),
    "amplitude_sweep": ("an amplitude sweep", "amplitude_sweep"),
    "flow_curve": ("a flow curve, of steady states", "flow_curve"),
    "relaxation": ("relaxation after a step of strain", "relaxation"),
    "creep": ("a test at a given stress", "creep"),
    "run": ("a transient, such as start-up", ""),
}
_TAKEN = (INDEX_FILE, TESTS_FILE, *(f"{table}.csv" for _, table in _KINDS.values()))
_NO_TEMPERATURE = (
    "Nothing says its temperature; if it is another, give it, as in --temperature FILE=60 or "
    "FILE:2=60 for a block. To exchange the two, rename them."
)
_INDEX_COLUMNS = [
    "file", "source_file", "source_block", "flow", "control", "start", "rate_before_1_s",
    "step_strain", "step_time_s", "temperature_C",
]  # fmt: skip
_FLOW = (("time",), ("shear_rate", "strain"), ("stress",))
_OSCILLATION = (("omega",), ("Gp",), ("Gpp",))
_SIZES = ("complex_modulus", "complex_viscosity")


def files_of(found: Sequence[Record]) -> tuple[dict[str, str], list[str]]:
    """Return the text of every file of a folder by name, and what is to be said of them."""
    runs: list[Record] = []
    taken: set[str] = set()
    for one in (one for one in found if one.is_run):
        # a file called creep.txt is no table of compliances
        own = f"{one.name}-run" if f"{one.name}.csv" in _TAKEN else one.name
        names = (f"{own}{end}" for end in ("", *(f"_{k}" for k in range(2, len(found) + 2))))
        # two names that differ in capitals are one file on some disks
        runs.append(replace(one, name=next(name for name in names if name.lower() not in taken)))
        taken.add(runs[-1].name.lower())
    files = {f"{one.name}.csv": _csv(one.columns) for one in runs}
    notes: list[str] = []
    by_temperature: list[dict[str, str]] = []
    of_runs = {one.temperature for one in runs}
    for kind, (_, table) in _KINDS.items():
        records = [one for one in found if one.kind == kind and not one.is_run]
        groups: list[list[Record]] = []  # by temperature
        for one in _merged(records) if kind == "amplitude_sweep" else records:
            group = next((g for g in groups if g[0].near(one.temperature)), None)
            if group is None:
                groups.append(group := [])
            group.append(one)
        for group in groups:
            at = f"{group[0].temperature:g}" if len(groups) > 1 else ""
            base = f"{table}_{at}C" if at else table
            if at:
                by_temperature.append({"file": f"{base}.csv", "test": table, "temperature_C": at})
            files[f"{base}.csv"] = _csv(group[0].columns)
            for number, one in enumerate(group[1:], start=2):
                files[f"{base}-{number}.csv"] = _csv(one.columns)
                notes.append(_not_used(f"{base}-{number}.csv", table, one))
        if len(groups) > 1:
            at_runs = [g[0] for g in groups if of_runs and all(g[0].near(t) for t in of_runs)]
            if len(at_runs) == 1:
                files[f"{table}.csv"] = _csv(at_runs[0].columns)
            notes.append(_of_temperatures(table, groups, len(at_runs) == 1))
    if by_temperature:
        files[TESTS_FILE] = _csv(by_temperature)
    if runs:
        files[INDEX_FILE] = _index(runs)
    return files, notes


def _not_used(name: str, table: str, one: Record) -> str:
    known = one.temperature is not None
    same = "at the same temperature, " if known else ""
    remedy = "To exchange the two, rename them." if known else _NO_TEMPERATURE
    return (
        f"{name} is another {table.replace('_', ' ')}, {same}from "
        f"{f'{one.source} {one.block}'.strip()}: nothing reads it. {remedy}"
    )


def _of_temperatures(table: str, groups: list[list[Record]], at_runs: bool) -> str:
    first, last = (f"{g[0].temperature:g}" for g in (groups[0], groups[-1]))
    text = f"{table}: {len(groups)} temperatures, {first} to {last} °C, a file each, listed in "
    text += f"{TESTS_FILE}; "
    if at_runs:
        return f"{text}{table}.csv is that at the temperature of the runs."
    return f"{text}a fit takes one of them: import again with --temperature {first}."


def _merged(records: Sequence[Record]) -> list[Record]:
    """Return amplitude sweeps at one temperature and different frequencies as one table."""

    def goes_into(one: Record, into: Record) -> bool:
        here, there = one.table.get("omega"), into.table.get("omega")
        if here is None or there is None or not into.near(one.temperature):
            return False
        return not (np.abs(there[:, None] - here) < 0.02 * there[:, None]).any()

    kept: list[Record] = []
    for one in records:
        into = next((into for into in kept if goes_into(one, into)), None)
        if into is None:
            kept.append(one)
        else:
            table = into.table
            table |= {k: np.concatenate([table[k], one.table[k]]) for k in table}
    return kept


def _index(runs: Sequence[Record]) -> str:
    rows = []
    for one in runs:
        degrees = one.temperature
        warm = {} if degrees is None else {"temperature_C": f"{degrees:g}"}
        source = {"source_file": one.source, "source_block": one.block}
        rows.append({"file": f"{one.name}.csv", **source, **one.conditions, **warm})
    table = pd.DataFrame(rows).reindex(columns=_INDEX_COLUMNS)
    return _csv(table.dropna(axis="columns", how="all"))


def _csv(table: object) -> str:
    return pd.DataFrame(table).to_csv(index=False, lineterminator="\n")


def unread_columns(columns: Sequence[tuple[str, str]]) -> Iterator[str]:
    """Say once of which columns nothing was read, and what to do to have them."""
    for names in dict.fromkeys(names for names, _ in columns):
        files = [file for other, file in columns if other == names]
        more = f" and {len(files) - 3} more files" if len(files) > 3 else ""
        yield (
            f"{', '.join(files[:3])}{more}: columns not read: {names}. To have one, say what "
            'it is, as in --column N1="its name".'
        )


THROUGH = {
    "viscosity", "complex_modulus", "complex_viscosity", "phase_angle", "loss_factor",
    "stress_amplitude", "temperature", "extensional_viscosity", "psi1", "psi2",
}  # fmt: skip
"""Quantities that are read only where they have to stand for another."""


def summary(where: str, readings: Readings, one: Recognised, made: Record, said: list[str]) -> str:
    """Say what a block was taken for, and its columns unless they were among what was `said`."""
    used = (f"{key} = {words}" for key, words in readings.used.items() if is_part(key, made))
    understood = ", ".join(used)
    columns = "columns as before" if understood in said else understood
    said.append(columns)
    rows = len(next(iter(made.table.values())))
    text = f"{where}: read as {_KINDS[made.kind][0]} ({one.why}); {columns}; {rows} rows"
    text += f", {made.dropped} without all these numbers left out" if made.dropped else ""
    return "; ".join([text, *made.notes]) + "."


def is_part(key: str, made: Record) -> bool:
    """Return whether a quantity that was read went into the table, by itself or through another."""
    if key == "strain_amplitude":
        return made.kind == "amplitude_sweep"
    if key == "strain":
        return "strain" in made.table or "step_strain" in made.conditions
    return key in made.table or key in THROUGH | {INSTRUMENT.get(name) for name in made.table}


def left_out(where: str, block: Block, reason: str) -> str:
    """Say which table is not read, and how to have it."""
    if reason:
        return f"{where}: left out, {reason}."
    names = ", ".join(shown(n) for n, _ in block.columns[:15] if n)
    if not any(name for name, _ in block.columns):
        return (
            f"{where}: numbers from line {block.line} on without names; left out. Write the names "
            "above them, or say where they are with --header-row."
        )
    return (
        f"{where}: not a run, and no table that is known (columns {names}); left out. "
        'To have it, name its columns, as in --column stress="its name".'
    )


def nothing(path: Path, tables: Sequence[tuple[int, Readings]], reasons: Sequence[str]) -> str:
    """Which of numbered tables is nearest to a test, what it lacks, and the remedy, in words."""
    if reasons:
        more = f" and {len(reasons) - 6} more" if len(reasons) > 6 else ""
        return (
            f"{path.name} holds nothing that is fitted here: {'; '.join(reasons[:6])}{more}. Say "
            "what it is if this is wrong, as in --test frequency_sweep, or give another file."
        )
    number, best = max(tables, key=lambda pair: len(pair[1].columns))
    line = f"block {number} (numbers from line {best.block.line})"
    where = line if len(tables) > 1 else "its block"
    swings = {"omega", "Gp", "Gpp", *_SIZES} & set(best.columns) and not best.has("time")
    wanted = _OSCILLATION if swings else _FLOW
    lacks = [keys for keys in wanted if not any(best.has(key) for key in keys)]
    names = list(dict.fromkeys(shown(name) for name, _ in best.block.columns if name))
    text = (
        f"{path.name} holds no test that is known: {where} has no column of numbers known as "
        f"{', nor as '.join(' or '.join(keys) for keys in lacks)}. Its columns are "
        f"{', '.join(names[:15])}."
    )
    if size := next((key for key in _SIZES if swings and key in best.columns), None):
        name = shown(best.block.columns[best.columns[size]][0])
        return (
            f"{text} {name} alone does not give G' and G'': export these, or the phase angle δ or "
            "tan δ with it. If a column has one of them by another name, say so, as in --column "
            'phase_angle="its name".'
        )
    known = [(best.columns[key], key) for key in INSTRUMENT.values() if key in best.columns]
    if known and best.geometry is None:
        raw = ", ".join(f"{best.block.columns[at][0]} is {key}" for at, key in known)
        return (
            f"{text} {shown(raw)}: give the tool that makes stress and rate of them, as "
            "in --geometry cone_plate:radius_mm=25,angle_deg=1."
        )
    key = lacks[0][0] if lacks else "stress"
    return f'{text} Name the right one, as in --column {key}="name of the column".'
