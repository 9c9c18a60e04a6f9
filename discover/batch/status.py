"""How the studies of a batch ended."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from discover.batch.rows import StudyRow, results_table


@dataclass(frozen=True)
class StudyStatus:
    """How one study ended.

    Attributes
    ----------
    name, task
        Folder under the batch's, and ``compare`` or ``close-loop``.
    status
        ``waiting``, ``done``, ``complete`` (was there already) or ``failed``.
    text
        The verdict, or the reason of the failure.
    input_error
        Whether the failure is the user's to mend.
    seconds
        Time taken now.
    """

    name: str
    task: str
    status: str
    text: str
    input_error: bool = False
    seconds: float = 0.0


@dataclass(frozen=True)
class BatchResult:
    """How every study of a batch ended.

    Attributes
    ----------
    studies
        In the order given.
    index
        The summary page.
    rows
        What they found, in the same order.
    """

    studies: tuple[StudyStatus, ...]
    index: Path
    rows: tuple[StudyRow, ...] = ()

    @property
    def failed(self) -> list[StudyStatus]:
        """Studies without a result."""
        return [study for study in self.studies if study.status == "failed"]

    def table(self) -> pd.DataFrame:
        """Return what the studies found as a table, one line each."""
        return results_table([study.name for study in self.studies], self.rows)

    def _repr_html_(self) -> str:
        states = pd.DataFrame(
            {"task": [s.task for s in self.studies], "status": [s.status for s in self.studies]}
        )
        both = pd.concat([states, self.table()], axis="columns")
        return both.to_html(escape=True, float_format=lambda value: f"{value:.4g}", na_rep="–")

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
