"""What a check of a data folder has to say."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any, Literal, get_args

import pandas as pd

from discover.summary_view import NotebookView

Severity = Literal["error", "warning", "note"]


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong, doubtful or worth knowing.

    Attributes
    ----------
    severity
        ``error``: the folder cannot be used; ``warning``: it can, but results may mislead;
        ``note``: how something was understood.
    subject
        What it is about, such as ``outliers`` or ``N1``; the same word for the same kind.
    file
        The file, or empty if it is about the folder.
    text
        A sentence or two in the user's words, with the remedy.
    """

    severity: Severity
    subject: str
    file: str
    text: str

    def __str__(self) -> str:
        return self.text


class Findings(tuple[Finding, ...], NotebookView):
    """All that a check has to say, errors first; a tuple that shows itself in a notebook."""

    __slots__ = ()

    def of(self, severity: Severity) -> list[Finding]:
        """Return the findings of one severity."""
        return [finding for finding in self if finding.severity == severity]

    @property
    def counts(self) -> str:
        """How many there are of each severity, in words."""
        numbers = ((severity, len(self.of(severity))) for severity in get_args(Severity))
        return ", ".join(f"{n} {severity}{'' if n == 1 else 's'}" for severity, n in numbers)

    def _shown(self) -> Iterable[Any]:
        yield f"{self.counts}." if self else "Nothing wrong was found."
        yield pd.DataFrame([asdict(finding) for finding in self])
