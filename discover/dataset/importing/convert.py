"""Turn the blocks of exports into the files of a data folder."""

import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from discover.dataset.importing import folder_files, quantities
from discover.dataset.importing.files import blocks_of_importer
from discover.dataset.importing.in_time import joined_intervals
from discover.dataset.importing.mapping import Mapping, Source, TestName
from discover.dataset.importing.names import alternatives
from discover.dataset.importing.oscillations import waves_of
from discover.dataset.importing.readings import INSTRUMENT, SAME, Readings
from discover.dataset.importing.recognition import Recognised, recognise
from discover.dataset.importing.records import Record, clock_before, joined, record
from discover.dataset.importing.stacked import tests_in_rows, tests_side_by_side
from discover.dataset.importing.text_export import Block, blocks_of_rows, require_blocks
from discover.dataset.importing.text_rows import read_rows
from discover.dataset.tables.table import read_bytes, shown
from discover.errors import InputError


def blocks_of_file(path: Path, mapping: Mapping) -> list[tuple[int, Block]]:
    """Tables of a file that the user chose, numbered from 1; InputError where there is none."""
    layout = mapping.layout
    found = blocks_of_importer(path, layout.format)
    if found is None:
        rows = read_rows(path, layout.delimiter, layout.decimal, layout.encoding)
        found = blocks_of_rows(rows, layout.header_row)
        require_blocks(found, path.name)
    alone = [one for block in found for one in tests_side_by_side(block)]
    parts = [part for one in alone for part in tests_in_rows(one, mapping, path.name)]
    blocks = list(enumerate(parts, start=1))
    if mapping.blocks is None:
        return blocks
    chosen = [pair for pair in blocks if pair[0] in mapping.blocks]
    if not chosen:
        raise InputError(
            f"{path.name} has {len(blocks)} blocks of numbers; none of those asked for "
            f"({', '.join(map(str, mapping.blocks))}). Correct --block."
        )
    return chosen


@dataclass
class ImportedFolder:
    """A data folder, not yet written."""

    files: dict[str, str]  # text of every file by name
    mapping: Mapping  # all that was used, guesses included
    said: list[str]  # what was understood and done, a line each
    unread: list[str]  # what could not be read, and why, a line each


@dataclass
class _Found:
    """Records and messages, of one file or of all."""

    records: list[Record] = field(default_factory=list)
    said: list[str] = field(default_factory=list)
    unread: list[str] = field(default_factory=list)
    tests: dict[str, TestName] = field(default_factory=dict)
    seen: dict[tuple[str, str], None] = field(default_factory=dict)  # quantities and columns
    named: set[str] = field(default_factory=set)  # quantities that some block names
    asked_for: set[str] = field(default_factory=set)  # those that a test needs
    units: quantities.UnsaidUnits = field(default_factory=list)
    columns: list[tuple[str, str]] = field(default_factory=list)  # columns not read, and the file

    def note(self, readings: Readings, made: Record) -> None:
        """Keep what a test that is imported says of names and units."""
        used, names = readings.used.keys(), readings.block.columns
        seen = ((key, names[at][0]) for key, at in readings.columns.items() if key in used)
        self.seen |= dict.fromkeys(seen)
        self.units += [
            (key, readings.name, unit)
            for key, unit in readings.unsaid.items()
            if _is_part(key, made)
        ]
        self.asked_for |= used | {SAME[key] for key in used if key in SAME}

    def add(self, other: "_Found") -> None:
        """Add what another file holds."""
        for name, own in vars(self).items():
            add = own.extend if isinstance(own, list) else own.update
            add(getattr(other, name))


def import_files(paths: Sequence[Path], mapping: Mapping) -> ImportedFolder:
    """Return the data folder that exports hold, in SI units.

    A block of numbers is taken for the test that its quantities and their course make it: records
    in time become runs, sweeps and flow curves the tables beside them. Rows without a needed number
    are dropped and counted. A file that cannot be understood is named in `unread`.

    `mapping`: what is known; the rest is found from names, units and numbers. Raises InputError if
    no file can be understood.
    """
    all_, sources = _Found(), []
    for path in paths:
        try:
            one = _read(path, mapping)
            digest = hashlib.sha256(read_bytes(path, path.name)).hexdigest()
            sources.append(Source(file=str(path), sha256=digest))
        except InputError as error:
            if len(paths) == 1:
                raise
            said = str(error)
            all_.unread.append(said if path.name in said else f"{path.name}: {said}")
        else:
            all_.add(one)
    if paths and not all_.records:
        raise InputError(f"None of the {len(paths)} files can be read. {' '.join(all_.unread[:6])}")
    if not all_.records:
        raise InputError(
            "No test to import was given. Name one or more exports, or list them under [[source]] "
            "in the mapping file."
        )
    given = mapping.columns
    names: dict[str, list[str]] = {}
    for key, name in all_.seen:
        names.setdefault(key, []).append(name)
    if unmatched := sorted(given.keys() - names.keys()):
        key = unmatched[0]
        raise InputError(
            f"No test in these files has a column {given[key]!r} for {key}, or needs it (torque, "
            "angle and force need --geometry). Correct --column."
        )
    of_units = set(mapping.units)
    if unused := sorted(of_units - all_.named):
        raise InputError(
            f"--unit {unused[0]} changes nothing: no column or line of these files is known as "
            f"{unused[0]}. Known are {', '.join(sorted(all_.named))}; name another with "
            f'--column {unused[0]}="its name", or leave the unit out.'
        )
    quantities.require_units(all_.units)
    idle = (
        f"warning: --unit {key} changes nothing: no test that was read needs {key}."
        for key in sorted(of_units - all_.asked_for - _WAVES)
    )
    files, notes = folder_files.files_of(all_.records)
    # a name that differs from block to block is guessed again when the import is repeated, and
    # units are read again from the files
    same = {key: of[0] for key, of in names.items() if len(of) == 1}
    tests = {**all_.tests, **mapping.tests}
    used = {"columns": {**same, **given}, "source": tuple(sources), "tests": tests}
    units, unread = (
        quantities.units_taken_as_si(all_.units),
        folder_files.unread_columns(all_.columns),
    )
    said = [*units, *idle, *all_.said, *unread, *notes]
    return ImportedFolder(files, mapping.model_copy(update=used), said, all_.unread)


def _read(path: Path, mapping: Mapping) -> _Found:
    """Return the tests of a file; InputError if it holds none."""
    found, file = _Found(), path.name
    blocks = joined_intervals(blocks_of_file(path, mapping), mapping, file)
    plain = re.sub(r"[^\w.-]+", "_", path.stem).strip("_.") or "run"
    before: Record | None = None
    clock = 0.0
    reasons, columns = [], []
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
        found.tests[key] = chosen or "none"
        previous, before = before, None
        if previous is not None and chosen in (None, "creep"):
            recovered = joined(previous, readings)
            if recovered is not None:
                found.records[-1] = recovered
                found.tests[key] = "creep"
                words = "the recovery after the creep before it, added to that run."
                found.said.append(f"{where}: {words}")
                continue
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
                made.name = name
                found.records.append(made)
                found.tests[key] = made.kind
                found.note(readings, made)
                made.notes += readings.notes.values()
                found.said.append(_summary(where, readings, one, made, columns))
                before = made
                # what another column says already is known, though it is not used
                known = (readings.used.keys() | _THROUGH) & readings.columns.keys()
                read |= {block.columns[readings.columns[k]][0] for k in known}
                read |= set(block.told_by)
                there |= dict.fromkeys(readings.numbered())
        for wave in waves_of(readings) if chosen != "none" else ():
            # in SI units already, whatever the user says of the file's
            of_wave = Readings.of(wave, Mapping(), file)
            one = recognise(of_wave)
            made = record(of_wave, one, None)
            made.name = f"{name}-point-{wave.name.rpartition(' ')[2]}"
            found.records.append(made)
            found.said.append(_summary(f"{file}, {wave.name}", of_wave, one, made))
    if unread := [shown(name) for name in there if name not in read]:
        found.columns.append((", ".join(unread), file))
    if not found.records:
        raise InputError(" ".join(found.unread) or folder_files.nothing(path, tables, reasons))
    return found


_CALIBRATION = re.compile(alternatives("lines")["calibrations"], re.IGNORECASE)
_A_CALIBRATION = (
    "a calibration or check of the instrument by its title, no test of the sample; to take it "
    "nevertheless, say what it is, as in --test {}=flow_curve"
)
_ISOTHERMAL = 5.0  # °C, width of the middle nine tenths of a test at one temperature


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


def _taken(readings: Readings, chosen: TestName | None, key: str) -> Recognised:
    """Return what a block is taken for: what the user says, or else what it looks like."""
    every = np.ones(len(readings), bool)
    if chosen == "none":
        return Recognised("none", every, "left out as asked")
    if chosen is None and _CALIBRATION.search(readings.block.name):
        return Recognised("none", every, _A_CALIBRATION.format(key))
    found = recognise(readings)
    return found if chosen in (None, found.kind) else Recognised(chosen, every, "as asked")


_WAVES = {"strain_wave", "stress_wave", "wave_time"}
# these are read only where they have to stand for another
_THROUGH = {
    "viscosity", "complex_modulus", "complex_viscosity", "phase_angle", "loss_factor",
    "stress_amplitude", "temperature", "extensional_viscosity", "psi1", "psi2",
}  # fmt: skip
_WORDS = {
    "frequency_sweep": "a frequency sweep at small strain",
    "amplitude_sweep": "an amplitude sweep",
    "flow_curve": "a flow curve, of steady states",
    "relaxation": "relaxation after a step of strain",
    "creep": "a test at a given stress",
    "run": "a transient, such as start-up",
}


def _summary(
    where: str, readings: Readings, one: Recognised, made: Record, said: list[str] | None = None
) -> str:
    """Say what a block was taken for and its columns, unless the columns have been said before."""
    used = (f"{key} = {words}" for key, words in readings.used.items() if _is_part(key, made))
    understood = ", ".join(used)
    if said is not None:
        understood = "columns as before" if understood in said else understood
        said.append(understood)
    rows = len(next(iter(made.table.values())))
    text = f"{where}: read as {_WORDS[made.kind]} ({one.why}); {understood}; {rows} rows"
    text += f", {made.dropped} without all these numbers left out" if made.dropped else ""
    return "; ".join([text, *made.notes]) + "."


def _is_part(key: str, made: Record) -> bool:
    """Return whether a quantity that was read went into the table, by itself or through another."""
    if key == "strain_amplitude":
        return made.kind == "amplitude_sweep"
    if key == "strain":
        return "strain" in made.table or "step_strain" in made.conditions
    return key in made.table or key in _THROUGH | {INSTRUMENT.get(name) for name in made.table}
