"""Answers on several tests together, as lines of a log and as tables of a page."""

from pathlib import Path

import numpy as np
from answer_tables import TASKS, answers, names_of, table, with_falsehoods, with_interval
from together_records import FLUIDS, TOGETHER

_ARITHMETIC = 1e-6


def line(row: dict) -> str:
    """Return a row of the log."""
    text = (
        f"{row['together']} {row['fluid']:10s} {row['task']:10s} {row['verdict']:17s} "
        f"{names_of(row) or '-'} [{_constants(row)}] {_missed(row)} {row['seconds']:.0f} s"
    )
    if _of_modes(row):
        text += f" by mode: {_of_modes(row)}"
    if row.get("undetermined"):
        text += f" open: {', '.join(row['undetermined'])}"
    return with_falsehoods(text, row)


def tables(out: Path) -> str:
    """Return a table for each command, of the answers that are there."""
    parts = []
    for task in TASKS:
        rows = answers(out, task, "together", "fluid")
        seconds = sorted(row["seconds"] for row in rows.values())
        false = sum(bool(row["false"]) for row in rows.values())
        took = f"{seconds[0]:.0f} to {seconds[-1]:.0f} s of processor" if seconds else ""
        parts.append(
            f"{task}: {len(rows)} answers, {false} with something false; {took}\n\n"
            + table(rows, "fluid", TOGETHER, FLUIDS, _cell)
        )
    return "\n\n".join(parts)


def _cell(row: dict) -> str:
    """Return one answer as it stands in a table of a page."""
    if row["verdict"] == "fault":
        return "*fault*"
    said = []
    own = {*FLUIDS[row["fluid"]].effects, *FLUIDS[row["fluid"]].terms}
    for names in row["named"]:
        if names[0] in own:
            said.append(f"`{names[0]}`")
        elif own & set(names):
            said.append(f"`{names[0]}` (or `{next(iter(own & set(names)))}`)")
        elif row["task"] == "close-loop":
            said.append(f"`{names[0]}`")
    other = len(row["named"]) - len(said)
    said += [f"{other} other term{'s' * (other > 1)}"] if other else []
    text = ", ".join(said or ["nothing"])
    if row["constants"] and not _of_modes(row):
        text += f": {_constants(row)}"
    parts = [text, "*unexplained*"] if row["verdict"] == "unexplained" else [text]
    if row.get("undetermined"):
        parts.append(f"open: {', '.join(row['undetermined'])}")
    parts.append(_missed(row))
    if _of_modes(row):
        parts.append(f"by mode *explained*, {_of_modes(row)}: {_constants(row)}")
    return "; ".join([*filter(None, parts), *(f"**{text}**" for text in row["false"])])


def _of_modes(row: dict) -> str:
    """Return what has a constant of each mode in a comparison that explains by it."""
    law = row.get("by_mode")
    if law is None or law["verdict"] != "explained":
        return ""
    return ", ".join(f"`{name}`" for name in law["constants"])


def _constants(row: dict) -> str:
    return ", ".join(with_interval(*found) for _, _, *found in row["constants"])


def _missed(row: dict) -> str:
    """Return the miss in the start-up that was not seen, in percent."""
    if np.inf in row["unseen"].values():
        return "runs away"
    return ", ".join(
        f"{name} {100 * miss if miss > _ARITHMETIC else 0.0:.2g} %"
        for name, miss in row["unseen"].items()
    )
