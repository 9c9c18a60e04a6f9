"""Commands that list what a study can ask for by name: laws and effects."""

import json
import math
from typing import TYPE_CHECKING, Any

import typer

from discover.cli.console import say
from discover.cli.guard import guarded
from discover.cli.options import JsonOption

if TYPE_CHECKING:  # --help needs no tables
    import pandas as pd


@guarded
def laws(as_json: JsonOption = False) -> None:
    """List the laws that a study can name, including your own, with their parameters."""
    from discover.laws import laws_table

    _show(laws_table(), ("title",), as_json)


@guarded
def effects(as_json: JsonOption = False) -> None:
    """List the effects that a loop can add, including your own, with their parameters."""
    from discover.effects import effects_table

    _show(effects_table(), ("kind",), as_json)


def _show(table: "pd.DataFrame", said: tuple[str, ...], as_json: bool) -> None:
    """Print a table of named things, which has a line for each of their parameters."""
    entries: dict[str, dict[str, Any]] = {}
    for line in table.reset_index(names="name").to_dict("records"):
        words = {key: line[key] for key in ("name", *said, "source")}
        entry = entries.setdefault(line["name"], {**words, "parameters": {}})
        if line["parameter"]:
            entry["parameters"][line["parameter"]] = {
                "unit": line["unit"],
                "low": _finite(line["low"]),
                "high": _finite(line["high"]),
                "range_scale": line.get("range_scale", "one"),
            }
    if as_json:
        typer.echo(json.dumps(list(entries.values()), indent=2, ensure_ascii=False))
        return
    for entry in entries.values():
        ranges = ", ".join(_range(*pair) for pair in entry["parameters"].items())
        words = ", ".join(entry[key] for key in said)
        say(f"{entry['name']:<32}{words:<26}{ranges or 'no parameter'}")


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _range(name: str, parameter: dict[str, Any]) -> str:
    low, high = (
        "open" if parameter[end] is None else f"{parameter[end]:g}" for end in ("low", "high")
    )
    scale = parameter["range_scale"].replace("_", " ")
    unit = "" if parameter["unit"] in ("", "1") else f" {parameter['unit']}"
    return f"{name} ({low} to {high}{unit if scale == 'one' else f' × {scale}'})"
