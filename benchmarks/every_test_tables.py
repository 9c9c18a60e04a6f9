"""Answers on every test, as lines of a log and as tables of a page."""

from pathlib import Path

from answer_tables import TASKS, answers, names_of, table, with_falsehoods, with_interval
from every_test_answers import PLANTED, TERMS
from every_test_records import MATERIALS, TESTS


def line(row: dict) -> str:
    """Return a row of the table."""
    constants = ", ".join(f"{name} {with_interval(*found)}" for name, _, *found in row["constants"])
    text = (
        f"{row['test']:16s} {row['material']:10s} {row['task']:10s} {row['verdict']:17s} "
        f"{names_of(row) or '-':42s} {constants:40s} {row['seconds']:4.0f} s"
    )
    return with_falsehoods(text, row)


def cell(row: dict) -> str:
    """Return one answer as it stands in a table of a page."""
    if row["verdict"] in ("refused", "fault"):
        return f"*{row['verdict']}*"
    constants = {name: with_interval(*found) for name, _, *found in row["constants"]}
    planted = {*PLANTED[row["material"]], *TERMS.get(row["material"], {})}
    said = []
    for first, *aliases in row["named"]:
        named = f"`{first}`"
        if first in constants:
            named += f" {constants[first]}"
        elif planted & set(aliases):
            named += " or " + ", ".join(f"`{name}`" for name in aliases if name in planted)
        said.append(named)
    own = constants.keys() - {names[0] for names in row["named"]}
    said += [f"{name} {text}" for name, text in constants.items() if name in own]
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
    for task in TASKS:
        rows = answers(out, task, "material", "test")
        parts.append(f"{task}\n\n" + table(rows, "test", MATERIALS, TESTS, cell))
    return "\n\n".join(parts)
