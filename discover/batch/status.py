"""How the studies of a batch ended."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from discover.batch.rows import StudyRow, results_table
from discover.notebook_view import NotebookView


@dataclass(frozen=True)
class StudyStatus:
    """How one study ended.

    `name`, `task`: folder under the batch's, and ``compare`` or ``close-loop``.
    `status`: ``waiting``, ``done``, ``complete`` (was there already) or ``failed``.
    `text`: the verdict, or the reason of the failure.
    `input_error`: whether the failure is the user's to mend.
    `seconds`: time taken now.
    """

    name: str
    task: str
    status: str
    text: str
    input_error: bool = False
    seconds: float = 0.0

    @property
    def outcome(self) -> str:
        """``result``, ``failed`` or ``waiting``: the status without when the result was made."""
        return "result" if self.status in ("done", "complete") else self.status


@dataclass(frozen=True)
class BatchResult(NotebookView):
    """How every study of a batch ended.

    `studies` in the order given.
    `index`: the summary page.
    `rows`: what they found, in the same order.
    """

    studies: tuple[StudyStatus, ...]
    index: Path = field(repr=False)
    rows: tuple[StudyRow, ...] = ()

    @property
    def failed(self) -> list[StudyStatus]:
        """Studies without a result."""
        return [study for study in self.studies if study.status == "failed"]

    def table(self) -> pd.DataFrame:
        """Return how the studies ended and what they found as a table, one line each.

        Nothing in it depends on when or how often a study was run: how long it took, and whether
        its result was there already, is in `studies`.
        """
        states = {
            "study": [study.name for study in self.studies],
            "task": [study.task for study in self.studies],
            "outcome": [study.outcome for study in self.studies],
            "reason": [s.text if s.outcome == "failed" else "" for s in self.studies],
        }
        found = results_table(self.rows)
        return pd.concat([pd.DataFrame(states), found], axis="columns")

    def _shown(self) -> Iterable[Any]:
        there = sum(study.outcome == "result" for study in self.studies)
        yield f"{there} studies with a result, {len(self.failed)} failed."
        yield self.table()

    def to_json(self) -> dict[str, Any]:
        """Return the contents of ``batch.json``."""
        return {"studies": [asdict(study) for study in self.studies]}

    def text(self) -> str:
        """Return a summary for a terminal."""
        lines = []
        for study in self.studies:
            first = (study.text.splitlines() or [""])[0]
            reason = "" if study.status == "failed" else f": {first}"  # a command says these itself
            lines.append(f"{study.status:<9}{study.name} ({study.task}){reason}")
        lines.append(f"Summary: {self.index.resolve()}")
        return "\n".join(lines)
