"""The page, the table and the JSON over a batch, kept up to date while it runs."""

import json
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from threading import RLock, Timer

from discover.batch.status import BatchResult, StudyRow, StudyStatus, read_row
from discover.errors import InputError
from discover.study.atomic import write_text

PAGE, TABLE, STATES = SUMMARY_FILES = ("index.html", "table.csv", "batch.json")
"""What lies in the folder of a batch beside the folders of its studies."""

_PAGE_PAUSE = 5.0  # seconds for which news are gathered before the page is written again


class Summary:
    """Writes ``index.html``, ``table.csv`` and ``batch.json``.

    `out`: folder of the batch. `jobs`: name and task of every study, in their order.
    """

    def __init__(self, out: Path, jobs: Sequence[tuple[str, str]]):
        self.out = out
        self._statuses = [StudyStatus(name, task, "waiting", "") for name, task in jobs]
        self._rows = [StudyRow() for _ in jobs]
        self._timer: Timer | None = None
        self._lock = RLock()

    def add(self, position: int, status: StudyStatus) -> None:
        """Take note of a study that has ended; it is on the page a few seconds later."""
        row = StudyRow() if status.status == "failed" else read_row(self.out / status.name)
        with self._lock:
            self._statuses[position] = status
            self._rows[position] = row
        self.write_soon()

    def write_soon(self) -> None:
        """Write in a few seconds: the next study may take hours, so the page cannot wait for it."""
        with self._lock:
            if self._timer is None:
                self._timer = Timer(_PAGE_PAUSE, self._write_if_possible)
                self._timer.daemon = True
                self._timer.start()

    def _write_if_possible(self) -> None:
        with suppress(OSError, InputError):  # such as a full disk: the last time, it is told
            self.write()

    def write_ended(self) -> None:
        """Write everything now if any study has ended."""
        if any(status.status != "waiting" for status in self._statuses):
            self.write()

    def write(self) -> BatchResult:
        """Write everything now and return how the studies ended."""
        with self._lock:
            if self._timer is not None:
                self._timer.cancel()
                self._timer = None
            return self._write()

    def _write(self) -> BatchResult:
        result = BatchResult(tuple(self._statuses), self.out / PAGE, tuple(self._rows))
        write_text(self.out / STATES, json.dumps(result.to_json(), indent=2) + "\n")
        table = result.table().to_csv(index=False, lineterminator="\n")
        write_text(self.out / TABLE, table)
        from discover.report.batch_report import batch_page  # late: it takes a second to import

        write_text(result.index, batch_page(result.studies, result.rows))
        return result
