"""Results as a notebook shows them: sentences, laws and tables, one under the other."""

import html
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

import pandas as pd


class NotebookView:
    """A result that shows itself in a notebook; a class says with `_shown` of which parts."""

    def _shown(self) -> Iterable[Any]:
        """Return sentences, tables and other results, in the order in which they are shown."""
        raise NotImplementedError

    def _repr_html_(self) -> str:
        return "".join(map(as_html, self._shown()))


class SentenceAndTable(NotebookView, ABC):
    """A result that one sentence sums up and a table lays out."""

    @property
    @abstractmethod
    def text(self) -> str:
        """One sentence for a reader."""

    @abstractmethod
    def table(self) -> pd.DataFrame:
        """Return what it consists of, one line each."""

    def _shown(self) -> Iterable[Any]:
        yield self.text
        yield self.table()


def as_html(part: Any) -> str:
    """Return one part of a view as HTML; text is escaped.

    Parameters
    ----------
    part
        A sentence, a table, or what has a ``_repr_html_`` of its own. An empty table or sentence
        gives nothing, and so does a column without any entry.
    """
    if isinstance(part, str):
        return f"<p>{html.escape(part)}</p>" if part else ""
    if not isinstance(part, pd.DataFrame):
        return part._repr_html_()
    if part.empty:
        return ""
    # lines that are only counted need no number in the margin
    numbered = isinstance(part.index, pd.RangeIndex)
    with pd.option_context("display.max_colwidth", None):  # a sentence is not cut
        return part.dropna(axis="columns", how="all").to_html(
            escape=True, index=not numbered, float_format="{:.4g}".format, na_rep="–"
        )


@runtime_checkable
class HasLine(Protocol):
    """A result that is one line of a table of its kind."""

    def line(self) -> Mapping[str, Any]:
        """Return the columns of the line."""
        ...


def table_of(results: Sequence[HasLine]) -> pd.DataFrame:
    """Return results of one kind as a table, one line each."""
    return pd.DataFrame([dict(result.line()) for result in results])
