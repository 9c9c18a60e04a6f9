"""Turn blocks of a text export into the files of a data folder."""

import csv
import hashlib
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float

from discover.dataset.importing.mapping import Geometry, Mapping, Source
from discover.dataset.importing.quantities import QUANTITIES, factor_to_si, guess_columns
from discover.dataset.importing.registry import blocks_of_importer
from discover.dataset.importing.text_export import Block, is_number, read_blocks
from discover.dataset.load import INDEX_FILE, SWEEP_FILE
from discover.dataset.table import read_bytes, shown
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


def import_files(
    paths: Sequence[Path], mapping: Mapping, sweep: Path | None = None
) -> ImportedFolder:
    """Return the data folder that text exports hold.

    Every block of numbers that has what a run needs becomes a run. Values are converted to SI units
    and written with all their digits. Rows in which a needed cell is empty or no number are
    dropped, and counted in `said`.

    Parameters
    ----------
    paths
        Files of runs.
    mapping
        What is known about them; what it leaves open is guessed from names and units.
    sweep
        File of a linear frequency sweep, if any.

    Raises
    ------
    InputError
        If a file cannot be understood; says which columns it has.
    """
    folder = ImportedFolder()
    given = {str(key): name for key, name in mapping.columns.items()}
    seen: dict[str, set[str]] = {}
    sources: list[Source] = []
    index: list[tuple[str, str, str]] = []
    for path in paths:
        blocks = _blocks(path, mapping)
        used = 0
        for number, block in blocks:
            name = f"{_plain(path.stem)}{f'-{number}' if len(blocks) > 1 else ''}.csv"
            found = _needed(guess_columns(block, given, sweep=False), block, mapping.geometry)
            if _lacking(found, mapping.geometry):
                folder.said.append(
                    f"{path.name}, block {number} {block.name}: not a run (columns "
                    f"{', '.join(shown(n) for n, _ in block.columns[:15] if n)}); left out."
                )
                continue
            values, factors, dropped = _values(block, found, mapping, path.name)
            run = _run(values, mapping)
            if name in folder.files or name in (INDEX_FILE, SWEEP_FILE):
                raise InputError(f"Two runs would be named {name}; rename one of the files.")
            folder.files[name] = _csv(run)
            index.append((name, path.name, block.name))
            _note_names(seen, block, found)
            used += 1
            folder.said.append(_summary(name, path.name, block, found, factors, run, dropped))
        if not used:
            raise InputError(_no_run(path, blocks, given, mapping.geometry))
        sources.append(_source(path, False))
    if sweep is not None:
        folder.files[SWEEP_FILE] = _sweep(sweep, mapping, folder.said, seen)
        sources.append(_source(sweep, True))
    if not index:
        raise InputError(
            "No run to import was given. Name one or more exports, or list them under [[source]] "
            "in the mapping file."
        )
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerows([("file", "source_file", "source_block"), *index])
    folder.files[INDEX_FILE] = text.getvalue()
    unmatched = set(given) - set(seen) - (set() if sweep else set(_SWEEP))
    if unmatched:
        key = sorted(unmatched)[0]
        raise InputError(
            f"No run in these files has a column {given[key]!r} for {key}, or needs it (torque, "
            "angle and force need --geometry). Correct --column."
        )
    # a name that differs from block to block is guessed again when the import is repeated, and
    # units are read again from the files
    same = {key: next(iter(names)) for key, names in seen.items() if len(names) == 1}
    folder.mapping = mapping.model_copy(
        update={"columns": {**same, **given}, "source": tuple(sources)}
    )
    return folder


def _blocks(path: Path, mapping: Mapping) -> list[tuple[int, Block]]:
    layout = mapping.layout
    found = blocks_of_importer(path, layout.format)
    if found is None:
        found = read_blocks(
            path, layout.delimiter, layout.decimal, layout.header_row, layout.encoding
        )
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


_SWEEP = ("omega", "Gp", "Gpp")
_INSTRUMENT = {
    "torque": "stress",
    "angular_velocity": "shear_rate",
    "angle": "strain",
    "normal_force": "N1",
}


def _needed(found: dict[str, int], block: Block, geometry: Geometry | None) -> dict[str, int]:
    """Leave out columns without a single number, and raw signals that nothing is made of."""
    filled = {
        key: at for key, at in found.items() if any(is_number(row[at]) for row in block.cells)
    }
    return {
        key: at
        for key, at in filled.items()
        if key not in _INSTRUMENT or (geometry is not None and _INSTRUMENT[key] not in filled)
    }


def _lacking(found: dict[str, int], geometry: Geometry | None) -> list[tuple[str, ...]]:
    """Return what a block lacks to be a run, each as the quantities of which one would do."""
    wanted = [("time",), ("shear_rate", "strain"), ("stress",)]
    if geometry is not None:
        wanted[1:] = [("shear_rate", "strain", "angular_velocity", "angle"), ("stress", "torque")]
    return [names for names in wanted if not set(names) & set(found)]


def _or(names: tuple[str, ...]) -> str:
    return " or ".join(part for part in (", ".join(names[:-1]), names[-1]) if part)


def _values(
    block: Block, found: dict[str, int], mapping: Mapping, name: str
) -> tuple[dict[str, np.ndarray], dict[str, float], int]:
    """Return the found columns in SI units, their factors, and how many rows were dropped."""
    whole = [
        all(row[at] != "" and is_number(row[at]) for at in found.values()) for row in block.cells
    ]
    rows = [row for row, keep in zip(block.cells, whole, strict=True) if keep]
    if not rows:
        names = ", ".join(shown(block.columns[at][0]) for at in found.values())
        raise InputError(
            f"{name}: no row from line {block.line} on has numbers in all of {names}. Name other "
            "columns."
        )
    values, factors = {}, {}
    for key, at in found.items():
        column, unit = block.columns[at]
        unit = str(mapping.units.get(key, unit))  # type: ignore[call-overload]
        raw = np.array([float(row[at]) for row in rows])
        factors[key] = factor_to_si(key, unit, column, name)
        values[key] = raw * factors[key]
    return values, factors, len(block.cells) - len(rows)


def _run(values: dict[str, np.ndarray], mapping: Mapping) -> dict[str, np.ndarray]:
    geometry, values = mapping.geometry, dict(values)
    run = {"time_s": values["time"] - mapping.start_time_s}
    if geometry is not None:
        strain = geometry.strain_per_angle
        factors = {
            "angular_velocity": strain,
            "angle": strain,
            "torque": geometry.stress_per_torque,
            "normal_force": geometry.normal_stress_per_force,
        }
        for raw, factor in factors.items():
            if raw in values and factor is not None:
                values[_INSTRUMENT[raw]] = values[raw] * factor
    for key in ("shear_rate", "stress", "N1", "N2", "strain"):
        if key in values:
            run[QUANTITIES[key].column] = values[key]
    return run


def _sweep(path: Path, mapping: Mapping, said: list[str], seen: dict[str, set[str]]) -> str:
    given = {str(key): name for key, name in mapping.columns.items()}
    for _, block in _blocks(path, mapping.model_copy(update={"blocks": None})):
        found = guess_columns(block, given, sweep=True)
        if set(_SWEEP) <= set(found):
            values, factors, dropped = _values(block, found, mapping, path.name)
            _note_names(seen, block, found)
            table = {QUANTITIES[key].column: values[key] for key in _SWEEP}
            said.append(_summary(SWEEP_FILE, path.name, block, found, factors, table, dropped))
            return _csv(table)
    raise InputError(
        f"{path.name} holds no sweep: a block with angular frequency, storage and loss modulus is "
        'needed. Name its columns with --column omega="…" --column Gp="…" --column Gpp="…".'
    )


def _note_names(seen: dict[str, set[str]], block: Block, found: dict[str, int]) -> None:
    for key, at in found.items():
        seen.setdefault(key, set()).add(block.columns[at][0])


def _csv(table: dict[str, Float[np.ndarray, " _"]]) -> str:
    # repr gives the shortest text that reads back as the same number
    rows = zip(*(map(repr, column.tolist()) for column in table.values()), strict=True)
    return "\n".join([",".join(table), *(",".join(row) for row in rows)]) + "\n"


def _summary(
    target: str,
    source: str,
    block: Block,
    found: dict[str, int],
    factors: dict[str, float],
    run: dict,
    dropped: int,
) -> str:
    understood = ", ".join(
        f"{key} = {block.columns[at][0]}"
        + (f" [{block.columns[at][1]}]" if block.columns[at][1] else "")
        + (f" × {factors[key]:.6g}" if factors[key] != 1.0 else "")
        for key, at in found.items()
    )
    samples = len(next(iter(run.values())))
    text = f"{target} from {source}{f' ({block.name})' if block.name else ''}: {understood}; "
    text += f"{samples} rows"
    return text + (f", {dropped} without all these numbers left out" if dropped else "") + "."


def _no_run(
    path: Path,
    blocks: list[tuple[int, Block]],
    given: dict[str, str],
    geometry: Geometry | None,
) -> str:
    """Say what the block that is nearest to a run has, what it lacks, and what to do."""

    def known(block: Block) -> dict[str, int]:
        return _needed(guess_columns(block, given, sweep=False), block, geometry)

    number, best = max(blocks, key=lambda pair: len(known(pair[1])))
    where = f"block {number} (numbers from line {best.line})" if len(blocks) > 1 else "its block"
    lacks = _lacking(known(best), geometry)
    names = list(dict.fromkeys(shown(name) for name, _ in best.columns if name))
    text = (
        f"{path.name} holds no run: {where} has no column of numbers known as "
        f"{', nor as '.join(map(_or, lacks))}. Its columns are {', '.join(names[:15])}."
    )
    if set(_SWEEP) <= set(guess_columns(best, given, sweep=True)):
        return f"{text} They look like a linear sweep: give the file with --lve, beside runs."
    raw = [f"{best.columns[at][0]} is {key}" for key, at in _raw(best, given).items()]
    if raw and geometry is None:
        return (
            f"{text} {shown(', '.join(raw))}: give the tool that makes stress and rate of them, as "
            "in --geometry cone_plate:radius_mm=25,angle_deg=1."
        )
    return f'{text} Name the right one, as in --column {lacks[0][0]}="name of the column".'


def _raw(block: Block, given: dict[str, str]) -> dict[str, int]:
    """Return the columns from which stress and rate can be made, by the geometry of the tool."""
    found = guess_columns(block, given, sweep=False)
    return {key: at for key, at in found.items() if key in _INSTRUMENT}


def _source(path: Path, sweep: bool) -> Source:
    digest = hashlib.sha256(read_bytes(path, path.name)).hexdigest()
    return Source(file=str(path), sha256=digest, sweep=sweep)


def _plain(stem: str) -> str:
    return re.sub(r"[^\w.-]+", "_", stem).strip("_.") or "run"
