"""How the studies of a batch stand and ended, and what each found."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from threading import Lock
from time import monotonic
from typing import Any

import pandas as pd

from discover.dataset.tables.table import read_bytes
from discover.errors import InputError
from discover.plain_numbers import parse_json
from discover.progress import Progress
from discover.study.atomic import write_text
from discover.summary_view import NotebookView
from tensor_library.law_terms import spell

QUANTITIES = ("sigma12", "N1", "N2")


@dataclass(frozen=True)
class LearnerRow:
    """What one learner found in one study: terms with coefficient and inner parameters."""

    terms: tuple[tuple[str, float, Mapping[str, float]], ...]
    errors: Mapping[str, float]  # largest relative error of each quantity in flows that no fit saw

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
    """One study as the tables of a batch show it; everything empty where it failed."""

    learners: Mapping[str, LearnerRow] = field(default_factory=dict)  # by name
    rivals: int | None = None  # number of laws that its data do not tell from the one found
    undetermined: tuple[str, ...] = ()  # quantities that they do not decide
    effects: tuple[str, ...] = ()  # effects that a closed loop added
    verdict: str = ""  # of the closed loop, or of the comparison
    # on its held-out runs, or on the fitted ones where none were held out
    error_before: float | None = None
    error_after: float | None = None


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
        str(name): LearnerRow(tuple(map(_term, learner["terms"])), _worst(learner["errors"]))
        for name, learner in content["learners"].items()
    }
    undetermined, verdict = tuple(map(str, content["undetermined"])), content.get("verdict", "")
    return StudyRow(learners, len(content["rivals"]), undetermined, verdict=str(verdict))


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
        line |= {"rivals": row.rivals, "undetermined": ", ".join(row.undetermined)}
        line |= {"effects": ", ".join(row.effects), "verdict": row.verdict}
        line |= {"error_before": row.error_before, "error_after": row.error_after}
        lines.append(line)
    return pd.DataFrame(lines).dropna(axis="columns", how="all")


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
    rows: tuple[StudyRow, ...] = ()  # what they found, in the same order

    @property
    def failed(self) -> list[StudyStatus]:
        """Studies without a result."""
        return [study for study in self.studies if study.status == "failed"]

    def table(self) -> pd.DataFrame:
        """Return how the studies ended and what they found as a table, one line each.

        Nothing in it depends on when or how often a study was run, as `studies` does.
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


_PAUSE = 1.0  # seconds between two lines of one study that a worker sends


class BatchProgress:
    """Adds up studies that run side by side or one after the other.

    Studies whose result was there already do not count: finding it takes no time.
    """

    def __init__(self, names: list[str], progress: Progress):
        self._names = names
        self._progress = progress
        self._fractions = [0.0] * len(names)
        self._ended: dict[int, StudyStatus] = {}
        self._lock = Lock()  # news from workers comes in a thread of its own

    def say(self, position: int, label: str, fraction: float) -> None:
        """Take note of how far a study is; news that a study has outrun is passed over."""
        with self._lock:
            if position in self._ended:
                return
            self._fractions[position] = max(self._fractions[position], fraction)
            self._report(position, label)

    def end(self, position: int, status: StudyStatus) -> None:
        """Take note of a study that has ended."""
        with self._lock:
            self._ended[position] = status
            self._fractions[position] = 1.0
            self._report(position, status.status)

    def _report(self, position: int, label: str) -> None:
        there = [i for i, status in self._ended.items() if status.status == "complete"]
        to_do = len(self._names) - len(there)
        fraction = (sum(self._fractions) - len(there)) / to_do if to_do else 1.0
        ended = f"{len(self._ended)} of {len(self._names)} ended"
        self._progress(f"{ended}; {self._names[position]}: {label}", fraction)


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
    """Writes ``index.html``, ``table.csv`` and ``batch.json`` of jobs, given as name and task."""

    def __init__(self, out: Path, jobs: Sequence[tuple[str, str]]):
        self.out = out
        self._statuses = [StudyStatus(name, task, "waiting", "") for name, task in jobs]
        self._rows = [StudyRow() for _ in jobs]
        self._last = -_PAGE_PAUSE

    def add(self, position: int, status: StudyStatus) -> None:
        """Take note of a study that has ended, on the page too unless that was just written."""
        row = StudyRow() if status.status == "failed" else read_row(self.out / status.name)
        self._statuses[position], self._rows[position] = status, row
        if monotonic() - self._last >= _PAGE_PAUSE:
            with suppress(OSError, InputError):  # such as a full disk: the last time, it is told
                self.write()

    def write(self) -> BatchResult:
        """Write everything now and return how the studies ended."""
        self._last = monotonic()
        result = BatchResult(tuple(self._statuses), self.out / PAGE, tuple(self._rows))
        write_text(self.out / STATES, json.dumps(result.to_json(), indent=2) + "\n")
        table = result.table().to_csv(index=False, lineterminator="\n")
        write_text(self.out / TABLE, table)
        from discover.report.batch_report import batch_page  # late: it takes a second to import

        write_text(result.index, batch_page(result.studies, result.rows))
        return result
