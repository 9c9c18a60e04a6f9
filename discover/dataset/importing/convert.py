"""Turn the blocks of exports into the files of a data folder."""

import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from discover.dataset.importing.folder_files import NamedRecord, files_of
from discover.dataset.importing.intervals import joined_intervals
from discover.dataset.importing.mapping import Mapping, Source, TestName, key_of
from discover.dataset.importing.readings import INSTRUMENT, Readings
from discover.dataset.importing.recognition import Recognised, recognise
from discover.dataset.importing.records import Record, clock_before, joined, record
from discover.dataset.importing.registry import blocks_of_importer
from discover.dataset.importing.text_export import Block, blocks_of_rows, require_blocks
from discover.dataset.importing.text_rows import read_rows
from discover.dataset.importing.waveforms import waves_of, without_names
from discover.dataset.tables.table import read_bytes, shown
from discover.errors import InputError


@dataclass
class ImportedFolder:
    """A data folder, not yet written.

    Attributes
    ----------
    files
        Text of every file by name.
    mapping
        Everything that was used, guesses included, so that the import can be repeated.
    said
        What was understood and done, a line each.
    """

    files: dict[str, str] = field(default_factory=dict)
    mapping: Mapping = field(default_factory=Mapping)
    said: list[str] = field(default_factory=list)


@dataclass
class _Import:
    """What has been found so far, over all files."""

    mapping: Mapping
    found: list[NamedRecord] = field(default_factory=list)
    said: list[str] = field(default_factory=list)
    seen: dict[str, set[str]] = field(default_factory=dict)
    tests: dict[str, TestName] = field(default_factory=dict)


def import_files(
    paths: Sequence[Path], mapping: Mapping, sweep: Path | None = None
) -> ImportedFolder:
    """Return the data folder that exports hold.

    Every block of numbers is taken for the test that its quantities and their course make it:
    records in time become runs, sweeps and flow curves the tables beside them. Values are converted
    to SI units and written with all their digits. Rows in which a needed cell is empty or no number
    are dropped, and counted in `said`.

    Parameters
    ----------
    mapping
        What is known about them; what it leaves open is found from names, units and numbers.
    sweep
        File of which the first frequency sweep becomes ``lve.csv``, if any.

    Raises
    ------
    InputError
        If a file cannot be understood; says which columns it has.
    """
    state = _Import(mapping)
    sources = []
    for path in paths:
        _read(path, state)
        sources.append(_source(path, False))
    if sweep is not None:
        _read_sweep(sweep, state)
        sources.append(_source(sweep, True))
    if not state.found:
        raise InputError(
            "No test to import was given. Name one or more exports, or list them under [[source]] "
            "in the mapping file."
        )
    given = {str(key): name for key, name in mapping.columns.items()}
    unmatched = sorted(set(given) - set(state.seen))
    if unmatched:
        key = unmatched[0]
        raise InputError(
            f"No test in these files has a column {given[key]!r} for {key}, or needs it (torque, "
            "angle and force need --geometry). Correct --column."
        )
    files, notes = files_of(state.found)
    # a name that differs from block to block is guessed again when the import is repeated, and
    # units are read again from the files
    same = {key: next(iter(names)) for key, names in state.seen.items() if len(names) == 1}
    used = mapping.model_copy(
        update={
            "columns": {**same, **given},
            "source": tuple(sources),
            "tests": {**state.tests, **mapping.tests},
        }
    )
    return ImportedFolder(files, used, [*state.said, *notes])


def _read(path: Path, state: _Import) -> None:
    """Add the tests of a file."""
    blocks = joined_intervals(_blocks(path, state.mapping), state.mapping, path.name)
    before: Record | None = None
    clock = 0.0
    reasons = []
    used = 0
    columns: list[str] = []
    for number, block in blocks:
        key = f"{key_of(path.name)}:{number}"
        where = f"{path.name}, block {number} {block.name}".strip()
        stem = _plain(path.stem) + (f"-{number}" if len(blocks) > 1 else "")
        readings = Readings.of(block, state.mapping, path.name)
        readings.begins, clock = clock_before(readings, clock)
        chosen = state.mapping.test_of(path.name, number)
        state.tests[key] = chosen or "none"
        recovered = None
        if before is not None and chosen in (None, "creep"):
            recovered = joined(before, readings)
        if recovered is not None:
            state.found[-1] = replace(state.found[-1], record=recovered)
            state.tests[key] = "creep"
            state.said.append(
                f"{where}: the recovery after the creep before it, added to that run."
            )
            before = None
            continue
        taken = _taken(readings, chosen)
        previous, before = before, None
        for part, one in enumerate(taken, start=1):
            made = None if one.kind == "none" else record(readings, one, previous)
            if made is not None and not _at_temperature(made, state.mapping):
                one = replace(one, why=f"at {made.temperature} °C, not the temperature asked for")
                made = None
            if made is None or made.kind == "none":
                reason = one.why if made is None else made.notes[0]
                reasons.append(f"block {number} is {reason}" if reason else "")
                state.said.append(_left_out(where, block, reason))
                continue
            name = stem + (f"-{part}" if len(taken) > 1 else "")
            state.found.append(NamedRecord(name, made, path.name, block.name))
            state.tests[key] = made.kind
            for quantity, at in readings.columns.items():
                if quantity in readings.used:
                    state.seen.setdefault(quantity, set()).add(block.columns[at][0])
            state.said.append(_summary(where, readings, one, made, columns))
            before, used = made, used + 1
        if chosen != "none":
            for wave in waves_of(block, state.mapping, path.name):
                used += 1
                point = wave.name.rpartition(" ")[2]
                # in SI units already, whatever the user says of the file's
                readings = Readings.of(wave, Mapping(), path.name)
                one = recognise(readings)[0]
                made = record(readings, one, None)
                found = NamedRecord(f"{stem}-point-{point}", made, path.name, wave.name)
                state.found.append(found)
                state.said.append(_summary(f"{path.name}, {wave.name}", readings, one, made))
    if not used:
        raise InputError(_nothing(path, blocks, [reason for reason in reasons if reason], state))


def _at_temperature(made: Record, mapping: Mapping) -> bool:
    wanted, has = mapping.temperature_C, made.temperature
    return wanted is None or has is None or abs(has - wanted) <= 1.0


def _taken(readings: Readings, chosen: TestName | None) -> list[Recognised]:
    """Return what a block is taken for: what the user says, or else what it looks like."""
    if chosen is None:
        return recognise(readings)
    every = np.ones(len(readings), bool)
    if chosen == "none":
        return [Recognised("none", every, "left out as asked")]
    alike = [one for one in recognise(readings) if one.kind == chosen]
    return alike or [Recognised(chosen, every, "as asked")]


def _blocks(path: Path, mapping: Mapping) -> list[tuple[int, Block]]:
    layout = mapping.layout
    found = blocks_of_importer(path, layout.format)
    if found is None:
        rows = read_rows(path, layout.delimiter, layout.decimal, layout.encoding)
        found = blocks_of_rows(rows, layout.header_row)
        if not any(Readings.of(block, mapping, path.name).columns for block in found):
            wave = without_names(rows)
            found = found if wave is None else [wave]
        require_blocks(found, path.name)
    blocks = list(enumerate(found, start=1))
    if mapping.blocks is None:
        return blocks
    chosen = [pair for pair in blocks if pair[0] in mapping.blocks]
    if not chosen:
        raise InputError(
            f"{path.name} has {len(blocks)} blocks of numbers; none of those asked for "
            f"({', '.join(map(str, mapping.blocks))}). Correct --block."
        )
    return chosen


def _read_sweep(path: Path, state: _Import) -> None:
    """Add the first frequency sweep of a file as the linear sweep."""
    for _, block in _blocks(path, state.mapping.model_copy(update={"blocks": None})):
        readings = Readings.of(block, state.mapping, path.name)
        if not readings.has("omega", "Gp", "Gpp"):
            continue
        one = next((o for o in recognise(readings) if o.kind == "frequency_sweep"), None)
        one = one or Recognised("frequency_sweep", np.ones(len(readings), bool), "as asked")
        made = record(readings, one, None)
        for quantity, at in readings.columns.items():
            state.seen.setdefault(quantity, set()).add(block.columns[at][0])
        state.found.append(NamedRecord("lve", made, path.name, block.name, chosen=True))
        state.said.append(_summary(f"{path.name} {block.name}".strip(), readings, one, made))
        return
    raise InputError(
        f"{path.name} holds no sweep: a block with angular frequency, storage and loss modulus is "
        'needed. Name its columns with --column omega="…" --column Gp="…" --column Gpp="…".'
    )


_WORDS = {
    "frequency_sweep": "a frequency sweep at small strain",
    "amplitude_sweep": "an amplitude sweep",
    "flow_curve": "a flow curve, of steady states",
    "relaxation": "relaxation after a step of strain",
    "creep": "a test at a given stress",
    "run": "a record in time at a given rate",
}


def _summary(
    where: str,
    readings: Readings,
    one: Recognised,
    made: Record,
    said: list[str] | None = None,
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
    sources = {INSTRUMENT.get(name, name) for name in made.table} | set(made.table)
    # these are read only where they have to stand for another
    through = {"viscosity", "complex_modulus", "complex_viscosity", "phase_angle", "loss_factor"}
    through |= {"strain_amplitude", "stress_amplitude", "temperature"}
    if key == "strain":
        return "strain" in made.table or "step_strain" in made.conditions
    return key in sources or (key in through)


def _left_out(where: str, block: Block, reason: str) -> str:
    if reason:
        return f"{where}: left out, {reason}."
    names = ", ".join(shown(n) for n, _ in block.columns[:15] if n)
    return f"{where}: not a run, and no table that is known (columns {names}); left out."


def _nothing(
    path: Path, blocks: list[tuple[int, Block]], reasons: list[str], state: _Import
) -> str:
    """Say what the block that is nearest to a test has, what it lacks, and what to do."""
    if reasons:
        more = f" and {len(reasons) - 6} more" if len(reasons) > 6 else ""
        return (
            f"{path.name} holds nothing that is fitted here: {'; '.join(reasons[:6])}{more}. Say "
            "what it is if this is wrong, as in --test frequency_sweep, or give another file."
        )
    all_readings = [(n, Readings.of(block, state.mapping, path.name)) for n, block in blocks]
    number, best = max(all_readings, key=lambda pair: len(pair[1].columns))
    several = len(blocks) > 1
    where = f"block {number} (numbers from line {best.block.line})" if several else "its block"
    wanted = (
        _OSCILLATION if {"omega", "Gp", "Gpp"} & set(best.columns) and not best.has("time")
        else _FLOW
    )  # fmt: skip
    lacks = [keys for keys in wanted if not any(best.has(key) for key in keys)]
    names = list(dict.fromkeys(shown(name) for name, _ in best.block.columns if name))
    text = (
        f"{path.name} holds no test that is known: {where} has no column of numbers known as "
        f"{', nor as '.join(' or '.join(keys) for keys in lacks)}. Its columns are "
        f"{', '.join(names[:15])}."
    )
    raw = [
        f"{best.block.columns[best.columns[key]][0]} is {key}"
        for key in INSTRUMENT.values()
        if key in best.columns
    ]
    if raw and best.geometry is None:
        return (
            f"{text} {shown(', '.join(raw))}: give the tool that makes stress and rate of them, as "
            "in --geometry cone_plate:radius_mm=25,angle_deg=1."
        )
    key = lacks[0][0] if lacks else "stress"
    return f'{text} Name the right one, as in --column {key}="name of the column".'


_FLOW = (("time",), ("shear_rate", "strain"), ("stress",))
_OSCILLATION = (("omega",), ("Gp",), ("Gpp",))


def _source(path: Path, sweep: bool) -> Source:
    digest = hashlib.sha256(read_bytes(path, path.name)).hexdigest()
    return Source(file=str(path), sha256=digest, sweep=sweep)


def _plain(stem: str) -> str:
    return re.sub(r"[^\w.-]+", "_", stem).strip("_.") or "run"
