"""What a check of a data folder has to say."""

from dataclasses import dataclass
from typing import Literal

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
