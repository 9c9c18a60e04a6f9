"""What each kind of test determined, as a table of a page."""

from collections.abc import Sequence
from typing import Any

from discover.report.wording import effect_title
from discover.statistics import Told


def told_by_table(told: Sequence[Told]) -> dict[str, Any] | None:
    """Return the kinds of test and a row for each number; None if there is nothing to compare."""
    if not told:
        return None
    kinds = list(told[0].alone)
    rows = [
        {
            "name": _title(one.name),
            "together": one.together,
            "alone": [one.alone[kind] for kind in kinds],
            # of two kinds, without one is the other alone
            "without": [one.without[kind] for kind in kinds] if len(kinds) > 2 else [],
        }
        for one in told
    ]
    return {"kinds": kinds, "rows": rows}


def _title(name: str) -> str:
    constant, of, owner = name.partition(" of ")
    return name if not of or constant == "prediction" else f"{constant} of {effect_title(owner)}"
