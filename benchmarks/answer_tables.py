"""Answers of both commands on records of planted materials, as a log and as tables of a page."""

import json
from collections.abc import Callable, Iterable
from pathlib import Path

Row = dict
TASKS = ("compare", "close-loop")


def names_of(row: Row) -> str:
    """Return what was named, each with the number of its aliases."""
    return "; ".join(
        names[0] + (f" (or {len(names) - 1} more)" if len(names) > 1 else "")
        for names in row["named"]
    )


def with_interval(value: float, low: float, high: float) -> str:
    """Return a constant with its interval."""
    return f"{value:.3g} ({low:.3g} to {high:.3g})"


def with_falsehoods(text: str, row: Row) -> str:
    """Return a line of the log with what is false below it."""
    return "\n".join([text, *(f"    FALSE: {false}" for false in row["false"])])


def answers(out: Path, task: str, across: str, down: str) -> dict[tuple[str, str], Row]:
    """Return the answers to a task that are there, by what stands across and down a table."""
    rows = [json.loads(kept.read_text()) for kept in out.glob(f"*_{task}.json")]
    return {(row[across], row[down]): row for row in rows}


def table(
    rows: dict[tuple[str, str], Row],
    corner: str,
    across: Iterable[str],
    down: Iterable[str],
    cell: Callable[[Row], str],
) -> str:
    """Return a table of answers; what has none has no line."""
    across = list(across)
    lines = [f"| {corner} | {' | '.join(across)} |", "|---" * (1 + len(across)) + "|"]
    for name in down:
        found = [rows.get((one, name)) for one in across]
        if any(found):
            lines.append(f"| {name} | {' | '.join(cell(row) if row else '' for row in found)} |")
    return "\n".join(lines)
