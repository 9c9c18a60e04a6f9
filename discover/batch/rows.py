"""What the studies of a batch found, one row each, from their result files."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from discover.dataset.tables.table import read_bytes
from discover.plain_json import parse_json
from tensor_library.law_terms import spell

QUANTITIES = ("sigma12", "N1", "N2")


@dataclass(frozen=True)
class LearnerRow:
    """What one learner found in one study.

    `terms`: term, coefficient and inner parameters.
    `errors`: largest relative error of each quantity in flows that no fit saw.
    """

    terms: tuple[tuple[str, float, Mapping[str, float]], ...]
    errors: Mapping[str, float]

    @property
    def text(self) -> str:
        """The terms as plain text."""
        parts = {}
        for term, value, inner in self.terms:
            values = ", ".join(f"{name} = {number:.4g}" for name, number in inner.items())
            parts[f"{term} [{values}]" if values else term] = value
        return spell(parts) if parts else "no term"


@dataclass(frozen=True)
class StudyRow:
    """One study as the tables of a batch show it; everything empty where it failed.

    `learners`: by name.
    `rivals`: number of laws that its data do not tell from the one found.
    `undetermined`: quantities that they do not decide.
    `chosen`: terms that each rule for choosing a law takes, by rule.
    `effects`: effects that a closed loop added.
    `verdict`: of the closed loop, or of the comparison.
    `error_before`, `error_after`: on its held-out runs, or on the fitted ones where none were held
        out.
    """

    learners: Mapping[str, LearnerRow] = field(default_factory=dict)
    rivals: int | None = None
    undetermined: tuple[str, ...] = ()
    chosen: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    effects: tuple[str, ...] = ()
    verdict: str = ""
    error_before: float | None = None
    error_after: float | None = None

    @property
    def agree(self) -> bool:
        """Whether all rules choose the same terms."""
        return len({tuple(sorted(terms)) for terms in self.chosen.values()}) <= 1


def read_row(folder: Path) -> StudyRow:
    """Return the row of a folder of results; an empty one where they are missing or damaged."""
    try:
        for name, reader in (("comparison.json", _comparison), ("loop.json", _loop)):
            if (folder / name).is_file():
                return reader(parse_json(read_bytes(folder / name, name)))
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError):
        pass  # a table over thousands of studies does not fall over one of them
    return StudyRow()


def _comparison(content: Mapping[str, Any]) -> StudyRow:
    learners = {
        str(name): LearnerRow(
            tuple(_term(t) for t in learner["terms"]),
            _worst(learner["errors"]),
        )
        for name, learner in content["learners"].items()
    }
    details = content["learners"].get("tensor_sindy", {}).get("details") or {}
    chosen = (details.get("selectors") or {}).get("chosen") or {}
    return StudyRow(
        learners,
        len(content["rivals"]),
        tuple(map(str, content["undetermined"])),
        {str(rule): tuple(map(str, terms)) for rule, terms in chosen.items()},
        verdict=str(content.get("verdict", "")),
    )


def _term(content: Mapping[str, Any]) -> tuple[str, float, dict[str, float]]:
    inner = {str(name): float(value) for name, value in content.get("inner", {}).items()}
    return str(content["term"]), float(content["coefficient"]), inner


def _worst(errors: Mapping[str, Mapping[str, float | None]]) -> dict[str, float]:
    worst = {}
    for quantity in QUANTITIES:
        values = [v for row in errors.values() if (v := row.get(quantity)) is not None]
        if values:
            worst[quantity] = float(max(values))
    return worst


def _loop(content: Mapping[str, Any]) -> StudyRow:
    errors = []
    for key in ("error_before", "error_after"):
        pair = content[key]
        value = pair["fit"] if pair["held_out"] is None else pair["held_out"]
        errors.append(None if value is None else float(value))
    return StudyRow(
        effects=tuple(str(stage["effect"]) for stage in content["stages"]),
        verdict=str(content["verdict"]),
        error_before=errors[0],
        error_after=errors[1],
    )


def results_table(rows: Sequence[StudyRow]) -> pd.DataFrame:
    """Return what studies found as a table, one line each, without columns that nothing fills."""
    lines = []
    for row in rows:
        line: dict[str, Any] = {}
        for learner, found in row.learners.items():
            line[f"{learner}_terms"] = found.text
            line |= {f"{learner}_{quantity}": error for quantity, error in found.errors.items()}
        line |= {f"chosen_by_{rule}": ", ".join(terms) for rule, terms in row.chosen.items()}
        line |= {"rivals": row.rivals, "undetermined": ", ".join(row.undetermined)}
        line |= {"effects": ", ".join(row.effects), "verdict": row.verdict}
        line |= {"error_before": row.error_before, "error_after": row.error_after}
        lines.append(line)
    return pd.DataFrame(lines).dropna(axis="columns", how="all")
