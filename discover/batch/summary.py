"""The page, the table and the JSON over a batch, kept up to date while it runs."""

import json
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter

from discover.batch.rows import StudyRow, read_row
from discover.batch.status import BatchResult, StudyStatus
from discover.study.atomic import write_text

_PAUSE = 5.0  # seconds between two versions of the page while studies run


class Summary:
    """Writes ``index.html``, ``table.csv`` and ``batch.json``.

    Parameters
    ----------
    out
        Folder of the batch.
    jobs
        Name and task of every study, in their order.
    """

    def __init__(self, out: Path, jobs: Sequence[tuple[str, str]]):
        self.out = out
        self._statuses = [StudyStatus(name, task, "waiting", "") for name, task in jobs]
        self._rows = [StudyRow() for _ in jobs]
        self._written: float | None = None

    def add(self, position: int, status: StudyStatus) -> None:
        """Take note of a study that has ended."""
        self._statuses[position] = status
        if status.status != "failed":
            self._rows[position] = read_row(self.out / status.name)
        now = perf_counter()
        if self._written is None or now - self._written > _PAUSE:
            self.write()

    def write(self) -> BatchResult:
        """Write everything and return how the studies ended."""
        from discover.report.batch_report import batch_page  # workers need no report

        result = BatchResult(tuple(self._statuses), self.out / "index.html", tuple(self._rows))
        write_text(self.out / "batch.json", json.dumps(result.to_json(), indent=2) + "\n")
        table = result.table().to_csv(index=False, lineterminator="\n")
        write_text(self.out / "table.csv", table)
        write_text(result.index, batch_page(result.studies, result.rows))
        self._written = perf_counter()
        return result
