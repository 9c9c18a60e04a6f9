"""What of a file is not read, each named once, and how to have it."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from discover.dataset.importing.readings import INSTRUMENT, Readings
from discover.dataset.importing.text_export import Block
from discover.dataset.importing.text_rows import is_number
from discover.dataset.tables.table import shown


def unread_columns(columns: Mapping[str, Sequence[str]]) -> Iterator[str]:
    """Say once of which columns nothing was read, and what to do to have them."""
    for names, files in columns.items():
        more = f" and {len(files) - 3} more files" if len(files) > 3 else ""
        yield (
            f"{', '.join(files[:3])}{more}: columns not read: {names}. To have one, say what "
            'it is, as in --column N1="its name".'
        )


def numbered(readings: Readings) -> Iterator[str]:
    """Yield the names of columns that hold numbers, but for those that number rows."""
    passed = [readings.columns.get(key) for key in ("point", "strain_wave", "stress_wave")]
    for i, (name, _) in enumerate(readings.block.columns):
        if i not in passed and name and any(is_number(row[i]) for row in readings.block.cells):
            yield name


def left_out(where: str, block: Block, reason: str) -> str:
    """Say which table is not read, and how to have it."""
    if reason:
        return f"{where}: left out, {reason}."
    if not any(name for name, _ in block.columns):
        return (
            f"{where}: numbers from line {block.line} on without names; left out. Write the names "
            "above them, or say where they are with --header-row."
        )
    names = ", ".join(shown(n) for n, _ in block.columns[:15] if n)
    return (
        f"{where}: not a run, and no table that is known (columns {names}); left out. "
        'To have it, name its columns, as in --column stress="its name".'
    )


def nothing(path: Path, tables: Sequence[tuple[int, Readings]], reasons: Sequence[str]) -> str:
    """Say which table is nearest to a test, what it lacks, and what to do.

    `tables`: number and content of each. `reasons`: why some of them were left out, in words.
    """
    if reasons:
        more = f" and {len(reasons) - 6} more" if len(reasons) > 6 else ""
        return (
            f"{path.name} holds nothing that is fitted here: {'; '.join(reasons[:6])}{more}. Say "
            "what it is if this is wrong, as in --test frequency_sweep, or give another file."
        )
    number, best = max(tables, key=lambda pair: len(pair[1].columns))
    several = len(tables) > 1
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
