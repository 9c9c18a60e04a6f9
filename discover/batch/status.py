"""How the studies of a batch stand and ended."""

import json
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from threading import Lock
from time import monotonic
from typing import Any

import pandas as pd

from discover.errors import InputError
from discover.progress import Progress
from discover.study.atomic import write_text
from discover.summary_view import NotebookView


@dataclass(frozen=True)
class StudyStatus:
    """How one study ended."""

    name: str  # its folder under the batch's
    task: str  # ``compare`` or ``close-loop``
    status: str  # ``waiting``, ``done``, ``complete`` (was there already) or ``failed``
    text: str  # the verdict, or the reason of the failure
    input_error: bool = False  # whether the failure is the user's to mend
    seconds: float = 0.0  # time taken now

    @property
    def outcome(self) -> str:
        """``result``, ``failed`` or ``waiting``: the status without when the result was made."""
        return "result" if self.status in ("done", "complete") else self.status


@dataclass(frozen=True)
class BatchResult(NotebookView):
    """How every study of a batch ended."""

    studies: tuple[StudyStatus, ...]  # in the order given
    index: Path = field(repr=False)  # the summary page

    @property
    def failed(self) -> list[StudyStatus]:
        """Studies without a result."""
        return [study for study in self.studies if study.status == "failed"]

    def table(self) -> pd.DataFrame:
        """Return how the studies ended, a line each, with verdict or reason, whenever they ran."""
        columns = ("name", "task", "outcome", "text")
        lines = [[getattr(study, name) for name in columns] for study in self.studies]
        return pd.DataFrame(lines, columns=["study", *columns[1:]])

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


_PAUSE = 1.0  # seconds between two lines of one study that a worker sends


def now_and_then(send: Callable[[str, float], None], pause: float = _PAUSE) -> Progress:
    """Return a progress function that passes on at most one line in so many seconds."""
    latest = -pause

    def say(label: str, fraction: float) -> None:
        nonlocal latest
        if monotonic() - latest >= pause:
            latest = monotonic()
            send(label, fraction)

    return say


PAGE, TABLE, STATES = SUMMARY_FILES = ("index.html", "table.csv", "batch.json")
"""What lies in the folder of a batch beside the folders of its studies."""
_PAGE_PAUSE = 5.0  # seconds in which the page is written once, however many studies end


class Summary:
    """Follows the jobs of a batch and says how far it is; what was complete takes no time."""

    def __init__(
        self, out: Path, jobs: Sequence[tuple[str, str]],
        progress: Progress = lambda label, fraction: None,
    ):  # fmt: skip
        self.out, self._progress = out, progress
        self._statuses = [StudyStatus(name, task, "waiting", "") for name, task in jobs]
        self._fractions = [0.0] * len(jobs)
        self._last = -_PAGE_PAUSE
        self._lock = Lock()  # news from workers comes in a thread of its own

    def say(self, position: int, label: str, fraction: float) -> None:
        """Take note of how far a study is; news that a study has outrun is passed over."""
        with self._lock:
            if self._statuses[position].status == "waiting":
                self._fractions[position] = max(self._fractions[position], fraction)
                self._report(position, label)

    def end(self, position: int, status: StudyStatus) -> None:
        """Take note of a study that has ended, on the page too unless that was just written."""
        with self._lock:
            self._statuses[position], self._fractions[position] = status, 1.0
            self._report(position, status.status)
        if monotonic() - self._last >= _PAGE_PAUSE:
            with suppress(OSError, InputError):  # such as a full disk: the last time, it is told
                self.write()

    def _report(self, position: int, label: str) -> None:
        both = zip(self._fractions, self._statuses, strict=True)
        taken = [fraction for fraction, one in both if one.status != "complete"]
        ended = sum(one.status != "waiting" for one in self._statuses)
        said = f"{ended} of {len(self._statuses)} ended; {self._statuses[position].name}: {label}"
        self._progress(said, sum(taken) / len(taken) if taken else 1.0)

    def write(self) -> BatchResult:
        """Write everything now and return how the studies ended."""
        self._last = monotonic()
        result = BatchResult(tuple(self._statuses), self.out / PAGE)
        write_text(self.out / STATES, json.dumps(result.to_json(), indent=2) + "\n")
        table = result.table().to_csv(index=False, lineterminator="\n")
        write_text(self.out / TABLE, table)
        from discover.report.page import batch_page  # late: it takes a second to import

        write_text(result.index, batch_page(result.studies))
        return result
