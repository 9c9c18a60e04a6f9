"""Turn the blocks of exports into the files of a data folder."""

import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path

import numpy as np

from discover.dataset.importing import folder_files, quantities
from discover.dataset.importing.across_blocks import joined_intervals, waves_of
from discover.dataset.importing.files import blocks_of_importer
from discover.dataset.importing.mapping import Mapping, Source, TestName
from discover.dataset.importing.names import alternatives
from discover.dataset.importing.readings import SAME, Readings
from discover.dataset.importing.records import Record, clock_before, joined, record
from discover.dataset.importing.several_tests import tests_in_rows, tests_side_by_side
from discover.dataset.importing.text_export import Block, blocks_of_rows, require_blocks
from discover.dataset.importing.text_rows import read_rows
from discover.dataset.importing.which_test import Recognised, recognise
from discover.dataset.tables.table import read_bytes, shown
from discover.errors import InputError


@dataclass
class ImportedFolder:
    """A data folder, not yet written."""

    files: dict[str, str]  # text of every file by name
    mapping: Mapping  # all that was used, guesses included
    said: list[str]  # what was understood and done, a line each
    unread: list[str]  # what could not be read, and why, a line each


def import_files(paths: Sequence[Path], mapping: Mapping) -> ImportedFolder:
    """Return the data folder that exports hold, in SI units.

    Records in time become runs, sweeps and flow curves the tables beside them. Rows without a
    needed number are dropped and counted. `mapping`: what is known; the rest is found from names,
    units and numbers. Raises InputError if no file can be understood; else `unread` names such.
    """
    if not paths:
        raise InputError(
            "No test to import was given. Name one or more exports, or list them under [[source]] "
            "in the mapping file."
        )
    found: list[_File] = []
    sources: list[Source] = []
    unread: list[str] = []
    for path in paths:
        try:
            one = _read(path, mapping)
            digest = hashlib.sha256(read_bytes(path, path.name)).hexdigest()
        except InputError as error:
            if len(paths) == 1:
                raise
            said = str(error)
            unread.append(said if path.name in said else f"{path.name}: {said}")
        else:
            found.append(one)
            unread += one.unread
            sources.append(Source(file=str(path), sha256=digest))
    if not found:
        raise InputError(f"None of the {len(paths)} files can be read. {' '.join(unread[:6])}")
    names: dict[str, dict[str, None]] = {}  # of the columns that tests need, by quantity
    units: quantities.UnsaidUnits = {}
    for readings, made in (pair for one in found for pair in one.taken):
        for key, at in readings.columns.items():
            if key in readings.used:
                names.setdefault(key, {})[readings.block.columns[at][0]] = None
        for key, unit in readings.unsaid.items():
            if folder_files.is_part(key, made):
                units.setdefault((key, unit.column), (readings.name, unit))
    idle = _unused_options(mapping, found, names.keys())
    quantities.require_units(units)
    files, notes = folder_files.files_of([made for one in found for made in one.records])
    # a name that differs from block to block is guessed again when the import is repeated, and
    # units are read again from the files
    same = {key: next(iter(of)) for key, of in names.items() if len(of) == 1}
    tests = dict(chain.from_iterable(one.tests.items() for one in found))
    used = {
        "columns": {**same, **mapping.columns},
        "source": tuple(sources),
        "tests": {**tests, **mapping.tests},
    }
    left = folder_files.unread_columns([pair for one in found for pair in one.unused])
    of_blocks = [line for one in found for line in one.said]
    said = [*quantities.units_taken_as_si(units), *idle, *of_blocks, *left, *notes]
    return ImportedFolder(files, mapping.model_copy(update=used), said, unread)


@dataclass
class _File:
    """What a file holds, and what is to be said of it."""

    records: list[Record] = field(default_factory=list)
    said: list[str] = field(default_factory=list)
    unread: list[str] = field(default_factory=list)
    tests: dict[str, TestName] = field(default_factory=dict)  # by file and block
    taken: list[tuple[Readings, Record]] = field(default_factory=list)  # of the tests
    unused: list[tuple[str, str]] = field(default_factory=list)  # names of columns, and the file
    named: set[str] = field(default_factory=set)  # quantities that some block names


def _unused_options(mapping: Mapping, found: Sequence[_File], needed) -> list[str]:
    """Refuse names and units of what no file has; return those of what no test needs, in words."""
    given = mapping.columns
    if unmatched := sorted(given.keys() - needed):
        key = unmatched[0]
        raise InputError(
            f"No test in these files has a column {given[key]!r} for {key}, or needs it (torque, "
            "angle and force need --geometry). Correct --column."
        )
    named = set().union(*(one.named for one in found))
    if unknown := sorted(mapping.units.keys() - named):
        raise InputError(
            f"--unit {unknown[0]} changes nothing: no column or line of these files is known as "
            f"{unknown[0]}. Known are {', '.join(sorted(named))}; name another with "
            f'--column {unknown[0]}="its name", or leave the unit out.'
        )
    used = set().union(_WAVES, *(readings.used for one in found for readings, _ in one.taken))
    idle = mapping.units.keys() - used - {SAME[key] for key in used if key in SAME}
    return [
        f"warning: --unit {key} changes nothing: no test that was read needs {key}."
        for key in sorted(idle)
    ]


def blocks_of_file(path: Path, mapping: Mapping) -> list[tuple[int, Block]]:
    """Tables of a file that the user chose, numbered from 1; InputError where there is none."""
    layout = mapping.layout
    found = blocks_of_importer(path, layout.format)
    if found is None:
        rows = read_rows(path, layout.delimiter, layout.decimal, layout.encoding)
        found = require_blocks(blocks_of_rows(rows, layout.header_row), path.name)
    alone = [one for block in found for one in tests_side_by_side(block)]
    parts = [part for one in alone for part in tests_in_rows(one, mapping, path.name)]
    blocks = list(enumerate(parts, start=1))
    chosen = [pair for pair in blocks if mapping.blocks is None or pair[0] in mapping.blocks]
    if not chosen:
        raise InputError(
            f"{path.name} has {len(blocks)} blocks of numbers; none of those asked for "
            f"({', '.join(map(str, mapping.blocks or ()))}). Correct --block."
        )
    return chosen


def _read(path: Path, mapping: Mapping) -> _File:
    """Return the tests of a file; InputError if it holds none."""
    found, file = _File(), path.name
    blocks = joined_intervals(blocks_of_file(path, mapping), mapping, file)
    plain = re.sub(r"[^\w.-]+", "_", path.stem).strip("_.") or "run"
    before: Record | None = None
    clock = 0.0
    reasons, understood = [], []
    read: set[str] = set()
    there: dict[str, None] = {}
    tables: list[tuple[int, Readings]] = []
    for number, block in blocks:
        key = f"{file}:{number}"
        where = f"{file}, block {number} {block.name}".strip()
        name = plain + (f"-{number}" if len(blocks) > 1 else "")
        readings = Readings.of(block, mapping.of_block(file, number), file)
        found.named |= readings.named()
        tables.append((number, readings))
        if block.apart:
            before, clock = None, 0.0
        readings.begins, clock = clock_before(readings, clock)
        chosen = mapping.test_of(file, number)
        previous, before = before, None
        if previous is not None and chosen in (None, "creep"):
            recovered = joined(previous, readings)
            if recovered is not None:
                found.records[-1], found.tests[key] = recovered, "creep"
                words = "the recovery after the creep before it, added to that run."
                found.said.append(f"{where}: {words}")
                continue
        found.tests[key] = chosen or "none"
        try:
            one = _taken(readings, chosen, key)
            made = record(readings, one, previous)
        except InputError as error:
            if chosen is not None or mapping.blocks is not None:
                raise
            found.unread.append(f"{where}: {error}")
        else:
            none = made.kind == "none"
            why = made.notes[0] if none else _not_at(made, readings, one, mapping, chosen)
            if none or why:
                reasons += [f"block {number} is {why}"] if why else []
                found.said.append(folder_files.left_out(where, block, why))
            else:
                made.name, found.tests[key], before = name, made.kind, made
                made.notes += [readings.note] if readings.note else []
                found.records.append(made)
                found.taken.append((readings, made))
                found.said.append(folder_files.summary(where, readings, one, made, understood))
                # what another column says already is known, though it is not used
                known = (readings.used.keys() | folder_files.THROUGH) & readings.columns.keys()
                read |= {block.columns[readings.columns[k]][0] for k in known}
                read |= set(block.told_by)
                there |= dict.fromkeys(readings.numbered())
        again = Readings.of(block, readings.mapping, file)  # a wave is no part of that test
        for wave in waves_of(again) if chosen != "none" else ():
            # in SI units already, whatever the user says of the file's
            of_wave = Readings.of(wave, Mapping(), file)
            one = recognise(of_wave)
            made = record(of_wave, one, None)
            made.name = f"{name}-point-{wave.name.rpartition(' ')[2]}"
            found.records.append(made)
            found.said.append(folder_files.summary(f"{file}, {wave.name}", of_wave, one, made, []))
    if unread := [shown(name) for name in there if name not in read]:
        found.unused.append((", ".join(unread), file))
    if not found.records:
        raise InputError(" ".join(found.unread) or folder_files.nothing(path, tables, reasons))
    return found


_WAVES = {"strain_wave", "stress_wave", "wave_time"}

_CALIBRATION = re.compile(alternatives("lines")["calibrations"], re.IGNORECASE)
_A_CALIBRATION = (
    "a calibration or check of the instrument by its title, no test of the sample; to take it "
    "nevertheless, say what it is, as in --test {}=flow_curve"
)
_ISOTHERMAL = 5.0  # °C, width of the middle nine tenths of a test at one temperature


def _taken(readings: Readings, chosen: TestName | None, key: str) -> Recognised:
    every = np.ones(len(readings), bool)
    if chosen == "none":
        return Recognised("none", every, "left out as asked")
    if chosen is None and _CALIBRATION.search(readings.block.name):
        return Recognised("none", every, _A_CALIBRATION.format(key))
    found = recognise(readings)
    return found if chosen in (None, found.kind) else Recognised(chosen, every, "as asked")


def _not_at(
    made: Record, readings: Readings, one: Recognised, mapping: Mapping, chosen: TestName | None
) -> str:
    """Say why a test is at no temperature, or not at the one asked for; empty if it is."""
    if chosen is not None:
        return ""
    temperature = readings.get("temperature")
    if temperature is not None and np.isfinite(temperature[one.rows]).any():
        low, high = np.nanpercentile(temperature[one.rows], [5.0, 95.0])
        if high - low > _ISOTHERMAL:
            return f"at no one temperature, but from {low:.4g} to {high:.4g} °C"
    wanted = mapping.temperature_C
    if wanted is not None and made.temperature is None:
        made.temperature = wanted
        words = f"nothing says its temperature: taken to be at the {wanted:g} °C asked for"
        made.notes.append(words)
    if wanted is None or made.temperature is None or abs(made.temperature - wanted) <= 1.0:
        return ""
    return f"at {made.temperature:g} °C, not the temperature asked for"
