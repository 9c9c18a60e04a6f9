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
from discover.dataset.importing.quantities import QUANTITIES, guess_columns, to_si
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
    columns: dict[str, str] = dict(mapping.columns)
    units: dict[str, str] = dict(mapping.units)
    sources: list[Source] = []
    index: list[tuple[str, str, str]] = []
    for path in paths:
        blocks = _blocks(path, mapping)
        used = 0
        for number, block in blocks:
            name = f"{_plain(path.stem)}{f'-{number}' if len(blocks) > 1 else ''}.csv"
            found = guess_columns(block, mapping.columns, sweep=False)
            if not _is_run(found, mapping.geometry):
                folder.said.append(
                    f"{path.name}, block {number} {block.name}: not a run (columns "
                    f"{', '.join(shown(n) for n, _ in block.columns[:15] if n)}); left out."
                )
                continue
            values, dropped = _values(block, found, mapping, path.name, units)
            run = _run(values, mapping)
            if name in folder.files or name in (INDEX_FILE, SWEEP_FILE):
                raise InputError(f"Two runs would be named {name}; rename one of the files.")
            folder.files[name] = _csv(run)
            index.append((name, path.name, block.name))
            columns |= {key: block.columns[at][0] for key, at in found.items()}
            used += 1
            folder.said.append(_summary(name, path.name, block, found, run, dropped))
        if not used:
            raise InputError(_no_run(path, blocks))
        sources.append(_source(path, False))
    if sweep is not None:
        folder.files[SWEEP_FILE] = _sweep(sweep, mapping, folder.said, columns, units)
        sources.append(_source(sweep, True))
    if not index:
        raise InputError("No file to import was given. Name one or more exports.")
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerows([("file", "source_file", "source_block"), *index])
    folder.files[INDEX_FILE] = text.getvalue()
    folder.mapping = mapping.model_copy(
        update={"columns": columns, "units": units, "source": tuple(sources)}
    )
    return folder


def _blocks(path: Path, mapping: Mapping) -> list[tuple[int, Block]]:
    layout = mapping.layout
    blocks = list(
        enumerate(
            read_blocks(path, layout.delimiter, layout.decimal, layout.header_row, layout.encoding),
            start=1,
        )
    )
    if mapping.blocks is None:
        return blocks
    chosen = [pair for pair in blocks if pair[0] in mapping.blocks]
    if not chosen:
        raise InputError(
            f"{path.name} has {len(blocks)} blocks of numbers; none of those asked for "
            f"({', '.join(map(str, mapping.blocks))}). Correct --block."
        )
    return chosen


def _is_run(found: dict[str, int], geometry: Geometry | None) -> bool:
    motion = {"shear_rate", "strain"} & set(found)
    force = "stress" in found
    if geometry is not None:
        motion |= {"angular_velocity", "angle"} & set(found)
        force |= "torque" in found
    return "time" in found and bool(motion) and force


def _values(
    block: Block, found: dict[str, int], mapping: Mapping, name: str, units: dict[str, str]
) -> tuple[dict[str, np.ndarray], int]:
    """Return the found columns in SI units, and how many rows were dropped."""
    whole = [
        all(row[at] != "" and is_number(row[at]) for at in found.values()) for row in block.cells
    ]
    rows = [row for row, keep in zip(block.cells, whole, strict=True) if keep]
    if not rows:
        raise InputError(
            f"{name}: no row from line {block.line} on has numbers in all of "
            f"{', '.join(shown(block.columns[at][0]) for at in found.values())}. Name other columns."
        )
    values = {}
    for key, at in found.items():
        column, unit = block.columns[at]
        unit = str(mapping.units.get(key, unit))  # type: ignore[call-overload]
        raw = np.array([float(row[at]) for row in rows])
        values[key] = to_si(raw, key, unit, column, name)
        units.setdefault(key, unit)
    return values, len(block.cells) - len(rows)


def _run(values: dict[str, np.ndarray], mapping: Mapping) -> dict[str, np.ndarray]:
    geometry = mapping.geometry
    run = {"time_s": values["time"] - mapping.start_time_s}
    if geometry is not None:
        strain = geometry.strain_per_angle
        derived = {
            "shear_rate": ("angular_velocity", strain),
            "strain": ("angle", strain),
            "stress": ("torque", geometry.stress_per_torque),
            "N1": ("normal_force", geometry.normal_stress_per_force),
        }
        for key, (raw, factor) in derived.items():
            if key not in values and raw in values and factor is not None:
                values[key] = values[raw] * factor
    for key in ("shear_rate", "stress", "N1", "N2", "strain"):
        if key in values:
            run[QUANTITIES[key].column] = values[key]
    return run


def _sweep(
    path: Path, mapping: Mapping, said: list[str], columns: dict[str, str], units: dict[str, str]
) -> str:
    for _, block in _blocks(path, mapping.model_copy(update={"blocks": None})):
        found = guess_columns(block, mapping.columns, sweep=True)
        if {"omega", "Gp", "Gpp"} <= set(found):
            values, dropped = _values(block, found, mapping, path.name, units)
            columns |= {key: block.columns[at][0] for key, at in found.items()}
            table = {QUANTITIES[key].column: values[key] for key in ("omega", "Gp", "Gpp")}
            said.append(_summary(SWEEP_FILE, path.name, block, found, table, dropped))
            return _csv(table)
    raise InputError(
        f"{path.name} holds no sweep: a block with angular frequency, storage and loss modulus is "
        'needed. Name its columns with --column omega="…" --column Gp="…" --column Gpp="…".'
    )


def _csv(table: dict[str, Float[np.ndarray, " _"]]) -> str:
    # repr gives the shortest text that reads back as the same number
    rows = zip(*(map(repr, column.tolist()) for column in table.values()), strict=True)
    return "\n".join([",".join(table), *(",".join(row) for row in rows)]) + "\n"


def _summary(
    target: str, source: str, block: Block, found: dict[str, int], run: dict, dropped: int
) -> str:
    understood = ", ".join(
        f"{key} = {block.columns[at][0]}"
        + (f" [{block.columns[at][1]}]" if block.columns[at][1] else "")
        for key, at in found.items()
    )
    samples = len(next(iter(run.values())))
    text = f"{target} from {source}{f' ({block.name})' if block.name else ''}: {understood}; "
    text += f"{samples} rows"
    return text + (f", {dropped} without all these numbers left out" if dropped else "") + "."


def _no_run(path: Path, blocks: list[tuple[int, Block]]) -> str:
    names = {shown(name): None for _, block in blocks for name, _ in block.columns if name}
    listed = ", ".join(list(names)[:15])
    return (
        f"No block of {path.name} has time, a stress and a shear rate or strain. Its columns are "
        f'{listed}. Name them, as in --column stress="Shear stress"; torque, angular_velocity and '
        "angle need --geometry."
    )


def _source(path: Path, sweep: bool) -> Source:
    digest = hashlib.sha256(read_bytes(path, path.name)).hexdigest()
    return Source(file=str(path), sha256=digest, sweep=sweep)


def _plain(stem: str) -> str:
    return re.sub(r"[^\w.-]+", "_", stem).strip("_.") or "run"
