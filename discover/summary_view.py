"""Views of results that are constants with intervals: table, intervals, figure."""

import html
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import pandas as pd
from scipy.special import ndtri

from discover.errors import InputError


class NotebookView:
    """Result that shows itself in a notebook; a class says with `_shown` of which parts."""

    def _shown(self) -> Iterable[Any]:
        """Return sentences, tables and other results, in the order in which they are shown."""
        raise NotImplementedError

    def _repr_html_(self) -> str:
        return "".join(map(as_html, self._shown()))


def as_html(part: Any) -> str:
    """Return a sentence (escaped), table or view as HTML; nothing of what is empty."""
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


def table_of(results: Sequence[Any]) -> pd.DataFrame:
    """Return results of one kind as a table, by their `line()`."""
    return pd.DataFrame([dict(result.line()) for result in results])


class PageView:
    """Result with a page in the report; a class says with `_page` who writes it."""

    _page: ClassVar[str]
    """Module and function, with a colon between: from the result to the text of the page."""

    def to_html(self, path: str | Path) -> Path:
        """Write the report on this result as one self-contained file, replaced if it is there."""
        # the report stands above the results that it shows, and brings matplotlib with it: it is
        # named here, and loaded only when somebody wants a page
        module, _, function = self._page.partition(":")
        text = getattr(import_module(module), function)(self)
        path = Path(path)
        path.write_text(text, encoding="utf-8")
        return path


if TYPE_CHECKING:
    from matplotlib.figure import Figure

_HALF_95 = float(ndtri(0.975))


@dataclass(frozen=True)
class Estimate:
    """Constant that a fit gave.

    `key`: its names in the index of a summary. `ci95`: None where there is none. `unit`: ``"1"`` if
    dimensionless. `error`: standard error; None for that of a normal distribution with this
    interval. `notes`: further columns of a summary.
    """

    key: tuple[str, ...]
    value: float
    ci95: tuple[float, float] | None
    unit: str = "1"
    error: float | None = None
    notes: Mapping[str, Any] = field(default_factory=dict)

    @property
    def standard_error(self) -> float | None:
        """Standard error in its unit; None without an interval."""
        if self.error is not None or self.ci95 is None:
            return self.error
        return 0.5 * (self.ci95[1] - self.ci95[0]) / _HALF_95

    def interval(self, level: float) -> tuple[float, float] | tuple[None, None]:
        """Return the interval of another probability: each side as far as a normal one's."""
        if self.ci95 is None:
            return None, None
        share = float(ndtri(0.5 + 0.5 * level)) / _HALF_95
        low, high = (self.value + share * (end - self.value) for end in self.ci95)
        return low, high


class SummaryView(NotebookView):
    """Result with constants; a class says with `_estimates` which, and with `_figure` who draws."""

    _index: ClassVar[tuple[str, ...]] = ("constant",)
    """Names of the levels of the index."""

    _figure: ClassVar[str] = "discover.report.in_memory:curves_figure"
    """Module and function, with a colon between: from the result to a figure."""

    def _estimates(self) -> Sequence[Estimate]:
        """Return the constants, in the order of the table."""
        raise NotImplementedError

    def _interval(self, estimate: Estimate, level: float) -> tuple[Any, Any]:
        return estimate.interval(level)

    def summary(self) -> pd.DataFrame:
        """Return the constants, one line each: value, standard error, 95 % interval, unit, notes.

        Columns ``value``, ``standard_error``, ``low``, ``high``, ``unit``, and notes such as
        ``determined``.
        """
        estimates = self._estimates()
        index = self._index_of(estimates)
        values = [(one.value, one.standard_error) for one in estimates]
        numbers = pd.DataFrame(values, index=index, columns=["value", "standard_error"])
        notes = [{"unit": one.unit, **one.notes} for one in estimates]
        notes = pd.DataFrame(notes, index, None if notes else ["unit"])
        return pd.concat([numbers.astype(float), self.conf_int(), notes], axis=1)

    def conf_int(self, level: float = 0.95) -> pd.DataFrame:
        """Return confidence intervals of the constants, columns ``low`` and ``high``.

        They hold if the law is right: see ``summary``. Raises InputError unless 0 < `level` < 1.
        """
        if isinstance(level, bool) or not isinstance(level, int | float) or not 0.0 < level < 1.0:
            raise InputError(f"level must be a number between 0 and 1; got {level!r}. Try 0.95.")
        estimates = self._estimates()
        ends = [self._interval(one, level) for one in estimates]
        index = self._index_of(estimates)
        return pd.DataFrame(ends, index=index, columns=["low", "high"], dtype=float)

    def plot(self) -> "Figure":
        """Return a matplotlib figure of every run, measured and as the result has it."""
        # the report stands above the results that it shows, and brings matplotlib with it
        module, _, function = self._figure.partition(":")
        return getattr(import_module(module), function)(self)

    def _index_of(self, estimates: Sequence[Estimate]) -> pd.Index:
        if len(self._index) == 1:
            return pd.Index([one.key[0] for one in estimates], name=self._index[0], dtype=object)
        keys = [one.key for one in estimates]
        arrays = list(zip(*keys, strict=True)) or [[] for _ in self._index]
        return pd.MultiIndex.from_arrays(arrays, names=self._index)
