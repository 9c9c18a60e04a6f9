"""Answers on every test, as lines of a log and as tables of a page."""

import json
from pathlib import Path

from every_test_answers import PLANTED, TERMS
from every_test_records import MATERIALS, TESTS


def line(row: dict) -> str:
    """Return a row of the table."""
    named = "; ".join(
        names[0] + (f" (or {len(names) - 1} more)" if len(names) > 1 else "")
        for names in row["named"]
    )
    constants = ", ".join(
        f"{name} {value:.3g} ({low:.3g} to {high:.3g})"
        for name, _, value, low, high in row["constants"]
    )
    text = (
        f"{row['test']:16s} {row['material']:10s} {row['task']:10s} {row['verdict']:17s} "
        f"{named or '-':42s} {constants:40s} {row['seconds']:4.0f} s"
    )
    return "\n".join([text, *(f"    FALSE: {text}" for text in row["false"])])


def cell(row: dict | None) -> str:
    """Return one answer as it stands in a table of a page."""
    if row is None:
        return ""
    if row["verdict"] in ("refused", "fault"):
        return f"*{row['verdict']}*"
    constants = {name: (value, low, high) for name, _, value, low, high in row["constants"]}
    planted = {*PLANTED[row["material"]], *TERMS.get(row["material"], {})}
    said = []
    for first, *aliases in row["named"]:
        named = f"`{first}`"
        if first in constants:
            value, low, high = constants[first]
            named += f" {value:.3g} ({low:.3g} to {high:.3g})"
        elif planted & set(aliases):
            named += " or " + ", ".join(f"`{name}`" for name in aliases if name in planted)
        said.append(named)
    own = constants.keys() - {names[0] for names in row["named"]}
    said += [
        f"{name} {value:.3g} ({low:.3g} to {high:.3g})"
        for name, (value, low, high) in constants.items()
        if name in own
    ]
    if row["task"] == "compare" and said and not planted & {n[0] for n in row["named"]}:
        said = [f"{len(said)} other terms"]
    said = said or ["nothing"]
    if row["verdict"] == "unexplained":
        said.append("*unexplained*")
    if row.get("undetermined"):
        said.append(f"open: {', '.join(row['undetermined'])}")
    return "; ".join([*said, *(f"**{text}**" for text in row["false"])])


def tables(out: Path) -> str:
    """Return a table for each command, of the answers that are there."""
    parts = []
    for task in ("compare", "close-loop"):
        rows = {}
        for kept in out.glob(f"*_{task}.json"):
            row = json.loads(kept.read_text())
            rows[row["test"], row["material"]] = row
        lines = [f"| test | {' | '.join(MATERIALS)} |", "|---" * (1 + len(MATERIALS)) + "|"]
        lines += [
            f"| {test} | {' | '.join(cell(rows.get((test, one))) for one in MATERIALS)} |"
            for test in TESTS
            if any((test, one) in rows for one in MATERIALS)
        ]
        parts.append(f"{task}\n\n" + "\n".join(lines))
    return "\n\n".join(parts)
