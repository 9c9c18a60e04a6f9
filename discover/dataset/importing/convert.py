"""Turn the blocks of exports into the files of a data folder."""

import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from discover.dataset.importing.files import blocks_of_importer
from discover.dataset.importing.folder_files import (
    NamedRecord,
    files_of,
    left_out,
    nothing,
    unread_columns,
)
from discover.dataset.importing.in_time import joined_intervals
from discover.dataset.importing.mapping import Mapping, Source, TestName, key_of
from discover.dataset.importing.names import name_table
from discover.dataset.importing.oscillations import waves_of, without_names
from discover.dataset.importing.quantities import UnsaidUnits, guess_columns
from discover.dataset.importing.readings import INSTRUMENT, SAME, Readings
from discover.dataset.importing.recognition import Recognised, recognise
from discover.dataset.importing.records import Record, clock_before, joined, record
from discover.dataset.importing.stacked import tests_in_rows, tests_side_by_side
from discover.dataset.importing.text_export import Block, blocks_of_rows, require_blocks
from discover.dataset.importing.text_rows import read_rows
from discover.dataset.tables.table import read_bytes, shown
from discover.errors import InputError


def blocks_of_file(path: Path, mapping: Mapping) -> list[tuple[int, Block]]:
    """Return the tables of a file with their numbers, from 1; those that the user chose.

    Raises InputError if it cannot be read, holds no table, or none of those chosen.
    """
    layout = mapping.layout
    found = blocks_of_importer(path, layout.format)
    if found is None:
        rows = read_rows(path, layout.delimiter, layout.decimal, layout.encoding)
        found = blocks_of_rows(rows, layout.header_row)
        given = {str(key): column for key, column in mapping.columns.items()}
        names = name_table(mapping.names)
        if not any(guess_columns(block, given, names) for block in found):
            wave = without_names(rows)
            found = found if wave is None else [wave]
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
class _Import:
    """What has been found so far, over all files."""

    mapping: Mapping
    found: list[NamedRecord] = field(default_factory=list)
    said: list[str] = field(default_factory=list)
    seen: dict[str, set[str]] = field(default_factory=dict)
    named: set[str] = field(default_factory=set)
    asked_for: set[str] = field(default_factory=set)
    units: UnsaidUnits = field(default_factory=UnsaidUnits)
    tests: dict[str, TestName] = field(default_factory=dict)
    unread: list[str] = field(default_factory=list)
    columns: dict[str, list[str]] = field(default_factory=dict)

    def note(self, readings: Readings, made: Record) -> None:
        """Keep what a test that is imported says of names and units."""
        for quantity, at in readings.columns.items():
            if quantity in readings.used:
                self.seen.setdefault(quantity, set()).add(readings.block.columns[at][0])
        parts = ((key, one) for key, one in readings.unsaid.items() if _is_part(key, made))
        self.units.add(readings.name, parts)
        self.asked_for |= readings.used.keys() | {SAME[k] for k in readings.used if k in SAME}

    def add(self, other: "_Import") -> None:
        """Add what another file holds."""
        for name in ("found", "said", "unread"):
            getattr(self, name).extend(getattr(other, name))
        for name in ("tests", "named", "asked_for"):
            getattr(self, name).update(getattr(other, name))
        self.units.found = {**other.units.found, **self.units.found}
        for key, names in other.seen.items():
            self.seen.setdefault(key, set()).update(names)
        for names, files in other.columns.items():
            self.columns.setdefault(names, []).extend(files)

    def refuse(self, where: str, error: InputError, chosen: TestName | None) -> None:
        """Keep why a block cannot be read; raise it if the user named the block."""
        if chosen is not None or self.mapping.blocks is not None:
            raise error
        self.unread.append(f"{where}: {error}")


def import_files(
    paths: Sequence[Path], mapping: Mapping, sweep: Path | None = None
) -> ImportedFolder:
    """Return the data folder that exports hold.

    Every block of numbers is taken for the test that its quantities and their course make it:
    records in time become runs, sweeps and flow curves the tables beside them. Values are converted
    to SI units and written with all their digits. Rows in which a needed cell is empty or no number
    are dropped, and counted in `said`. A file that cannot be understood does not keep the others
    from being read; it is named in `unread`.

    `mapping`: what is known about them; what it leaves open is found from names, units and numbers.
    `sweep`: file of which the first frequency sweep becomes ``lve.csv``, if any. Raises InputError
    if no file can be understood; says which columns it has.
    """
    state = _Import(mapping)
    sources = []
    for path in paths:
        one = _Import(mapping)
        try:
            _read(path, one)
            sources.append(_source(path, False))
        except InputError as error:
            if len(paths) == 1:
                raise
            said = str(error)
            state.unread.append(said if path.name in said else f"{path.name}: {said}")
        else:
            state.add(one)
    if paths and state.unread and not state.found and sweep is None:
        raise InputError(
            f"None of the {len(paths)} files can be read. {' '.join(state.unread[:6])}"
        )
    if sweep is not None:
        _read_sweep(sweep, state)
        sources.append(_source(sweep, True))
    if not state.found:
        raise InputError(
            "No test to import was given. Name one or more exports, or list them under [[source]] "
            "in the mapping file."
        )
    given = {str(key): name for key, name in mapping.columns.items()}
    if unmatched := sorted(set(given) - set(state.seen)):
        key = unmatched[0]
        raise InputError(
            f"No test in these files has a column {given[key]!r} for {key}, or needs it (torque, "
            "angle and force need --geometry). Correct --column."
        )
    of_units = set(map(str, mapping.units))
    if unused := sorted(of_units - state.named):
        raise InputError(
            f"--unit {unused[0]} changes nothing: no column or line of these files is known as "
            f"{unused[0]}. Known are {', '.join(sorted(state.named))}; name another with "
            f'--column {unused[0]}="its name", or leave the unit out.'
        )
    state.units.require()
    idle = [
        f"warning: --unit {key} changes nothing: no test that was read needs {key}."
        for key in sorted(of_units - state.asked_for - _WAVES)
    ]
    files, notes = files_of(state.found)
    # a name that differs from block to block is guessed again when the import is repeated, and
    # units are read again from the files
    same = {key: next(iter(names)) for key, names in state.seen.items() if len(names) == 1}
    tests = {**state.tests, **mapping.tests}
    used = {"columns": {**same, **given}, "source": tuple(sources), "tests": tests}
    unread = unread_columns(state.columns)
    said = [*state.units.warning(), *idle, *state.said, *unread, *notes]
    return ImportedFolder(files, mapping.model_copy(update=used), said, state.unread)


def _read(path: Path, state: _Import) -> None:
    """Add the tests of a file."""
    blocks = joined_intervals(blocks_of_file(path, state.mapping), state.mapping, path.name)
    before: Record | None = None
    clock = 0.0
    used = len(state.found)
    reasons, columns = [], []
    read: set[str] = set()
    there: dict[str, None] = {}
    tables: list[tuple[int, Readings]] = []
    for number, block in blocks:
        key = f"{key_of(path.name)}:{number}"
        where = f"{path.name}, block {number} {block.name}".strip()
        plain = re.sub(r"[^\w.-]+", "_", path.stem).strip("_.") or "run"
        name = plain + (f"-{number}" if len(blocks) > 1 else "")
        readings = Readings.of(block, state.mapping.of_block(path.name, number), path.name)
        state.named |= readings.named()
        tables.append((number, readings))
        if block.apart:
            before, clock = None, 0.0
        readings.begins, clock = clock_before(readings, clock)
        chosen = state.mapping.test_of(path.name, number)
        state.tests[key] = chosen or "none"
        follows = before is not None and chosen in (None, "creep")
        recovered = joined(before, readings) if follows else None  # pyright: ignore[reportArgumentType]
        if recovered is not None:
            state.found[-1] = replace(state.found[-1], record=recovered)
            state.tests[key] = "creep"
            state.said.append(
                f"{where}: the recovery after the creep before it, added to that run."
            )
            before = None
            continue
        previous, before = before, None
        try:
            one = _taken(readings, chosen, key)
            made = None if one.kind == "none" else record(readings, one, previous)
        except InputError as error:
            state.refuse(where, error, chosen)
        else:
            why = one.why
            if made is not None and made.kind == "none":
                why = made.notes[0]
            elif made is not None:
                why = _not_at(made, readings, one, state.mapping) if chosen is None else ""
            if made is None or made.kind == "none" or why:
                reasons += [f"block {number} is {why}"] if why else []
                state.said.append(left_out(where, block, why))
            else:
                state.found.append(NamedRecord(name, made, path.name, block.name))
                state.tests[key] = made.kind
                state.note(readings, made)
                made.notes += readings.notes.values()
                state.said.append(_summary(where, readings, one, made, columns))
                before = made
                known = readings.used.keys() & readings.columns.keys()
                read |= {block.columns[readings.columns[k]][0] for k in known}
                read |= set(block.told_by)
                there |= dict.fromkeys(readings.numbered())
        for wave in waves_of(readings) if chosen != "none" else ():
            point = wave.name.rpartition(" ")[2]
            # in SI units already, whatever the user says of the file's
            of_wave = Readings.of(wave, Mapping(), path.name)
            one = recognise(of_wave)
            made = record(of_wave, one, None)
            state.found.append(NamedRecord(f"{name}-point-{point}", made, path.name, wave.name))
            state.said.append(_summary(f"{path.name}, {wave.name}", of_wave, one, made))
    unread = [shown(name) for name in there if name not in read]
    if unread:
        state.columns.setdefault(", ".join(unread), []).append(path.name)
    if len(state.found) == used:
        raise InputError(" ".join(state.unread) or nothing(path, tables, reasons))


_CALIBRATION = re.compile(
    r"calibra|kalibri|étalon|taratura|verification|(reference|standard|référence) (oil|fluid)"
    r"|viscosity standard"
    r"|\bblank (run|test|measurement)\b|empty (tool|geometry|cup)|leermessung|prüföl|referenzöl"
    r"|air check|self-?test|校正|校准|標準液|較正|보정|교정",
    re.IGNORECASE,
)
_A_CALIBRATION = (
    "a calibration or check of the instrument by its title, no test of the sample; to take it "
    "nevertheless, say what it is, as in --test {}=flow_curve"
)
_ISOTHERMAL = 5.0  # °C, width of the middle nine tenths of a test at one temperature


def _not_at(made: Record, readings: Readings, one: Recognised, mapping: Mapping) -> str:
    """Return why a test is at no temperature, or not at that which the user wants; else nothing."""
    temperature = readings.get("temperature")
    if temperature is not None and np.isfinite(temperature[one.rows]).any():
        low, high = np.nanpercentile(temperature[one.rows], [5.0, 95.0])
        if high - low > _ISOTHERMAL:
            return f"at no one temperature, but from {low:.4g} to {high:.4g} °C"
    wanted = mapping.temperature_C
    if wanted is None:
        return ""
    if made.temperature is None:
        made.temperature = wanted
        made.notes.append(
            f"nothing says its temperature: taken to be at the {wanted:g} °C asked for"
        )
    if abs(made.temperature - wanted) <= 1.0:
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


def _read_sweep(path: Path, state: _Import) -> None:
    """Add the first frequency sweep of a file as the linear sweep."""
    for _, block in blocks_of_file(path, state.mapping.model_copy(update={"blocks": None})):
        readings = Readings.of(block, state.mapping, path.name)
        if not readings.has("omega", "Gp", "Gpp"):
            continue
        one = _taken(readings, "frequency_sweep", "")
        made = record(readings, one, None)
        state.named |= readings.named()
        state.note(readings, made)
        state.found.append(NamedRecord("lve", made, path.name, block.name, chosen=True))
        state.said.append(_summary(f"{path.name} {block.name}".strip(), readings, one, made))
        return
    raise InputError(
        f"{path.name} holds no sweep: a block with angular frequency, storage and loss modulus is "
        'needed. Name its columns with --column omega="…" --column Gp="…" --column Gpp="…".'
    )


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
    "run": "a transient at a given rate, such as start-up",
}


def _summary(
    where: str, readings: Readings, one: Recognised, made: Record, said: list[str] | None = None
) -> str:
    """Say what a block was taken for and its columns, unless the columns have been said before."""
    understood = ", ".join(
        f"{key} = {words}" for key, words in readings.used.items() if _is_part(key, made)
    )
    if said is not None:
        if understood in said:
            understood = "columns as before"
        said.append(understood)
    rows = len(next(iter(made.table.values())))
    text = f"{where}: taken for {_WORDS[made.kind]} ({one.why}); {understood}; {rows} rows"
    if made.dropped:
        text += f", {made.dropped} without all these numbers left out"
    return "; ".join([text, *made.notes]) + "."


def _is_part(key: str, made: Record) -> bool:
    """Return whether a quantity that was read went into the table, by itself or through another."""
    if key == "strain_amplitude":
        return made.kind == "amplitude_sweep"
    if key == "strain":
        return "strain" in made.table or "step_strain" in made.conditions
    return key in made.table or key in _THROUGH | {INSTRUMENT.get(name) for name in made.table}


def _source(path: Path, sweep: bool) -> Source:
    digest = hashlib.sha256(read_bytes(path, path.name)).hexdigest()
    return Source(file=str(path), sha256=digest, sweep=sweep)
