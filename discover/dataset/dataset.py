"""A data set: runs on one fluid, and its linear sweep."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, overload

import numpy as np
import pandas as pd

from discover.dataset.checking.start_up import sound_normal_stress
from discover.dataset.linear_viscoelasticity import LinearSweep
from discover.dataset.material_functions import linear_sweep_as_run
from discover.dataset.run import Run
from discover.dataset.run_table import run_line
from discover.errors import InputError, Problems
from discover.plain_numbers import short
from discover.summary_view import NotebookView
from discover.words import counted, unknown_name


@dataclass(frozen=True)
class Dataset(NotebookView):
    """Runs on one fluid: a sequence of runs, for Python and for scikit-learn.

    ``data["a.csv"]`` and ``data[0]`` are a run; ``data[:3]``, ``data[[0, 2]]`` and ``data[["a.csv",
    "b.csv"]]`` are data sets, and so is what a boolean array chooses.

    Attributes
    ----------
    name, provenance
        Of the folder, or of the synthetic study; where the data come from, in words.
    runs, linear_sweep, material_functions
        The runs, small-amplitude data, and tables next to the runs, as runs, by kind.
    set_aside
        Runs of the folder that cannot be fitted, by name, with the reason.

    Examples
    --------
    >>> import discover as dc
    >>> import numpy as np
    >>> times = np.linspace(0.0, 5.0, 51)
    >>> stress = 50.0 * (1 - np.exp(-times))
    >>> run = dc.Run("slow.csv", times, dc.start_up(0.5), np.full(51, 0.5), stress)
    >>> len(dc.Dataset("my melt", (run,)))
    1
    """

    name: str
    runs: tuple[Run, ...]
    linear_sweep: LinearSweep | None = None
    provenance: str = ""
    set_aside: Mapping[str, str] = field(default_factory=dict)
    material_functions: Mapping[str, Run] = field(default_factory=dict)

    def __post_init__(self):
        if not isinstance(self.name, str):
            raise InputError(f"The name of a data set must be text; got {short(self.name)}.")
        wanted = "A data set takes a sequence of Run;"
        if isinstance(self.runs, Run | str) or not isinstance(self.runs, Iterable):
            got = type(self.runs).__name__
            raise InputError(f"{wanted} got a {got}. Put a single run in a list.")
        object.__setattr__(self, "runs", tuple(self.runs))
        if others := [type(run).__name__ for run in self.runs if not isinstance(run, Run)]:
            raise InputError(
                f"{wanted} one is a {others[0]}. Make runs of a table with from_dataframe."
            )
        if not (self.linear_sweep is None or isinstance(self.linear_sweep, LinearSweep)):
            raise InputError(
                "linear_sweep must be a LinearSweep of frequencies, G' and G''; got a "
                f"{type(self.linear_sweep).__name__}."
            )
        if repeated := sorted(name for name in set(self.names) if self.names.count(name) > 1):
            raise InputError(f"The data set {self.name!r} holds the run {repeated[0]!r} twice.")

    def __len__(self) -> int:
        return len(self.runs)

    def __iter__(self) -> Iterator[Run]:
        return iter(self.runs)

    def __repr__(self) -> str:
        sweep = "" if self.linear_sweep is None else ", linear sweep"
        runs, samples = len(self), sum(len(run) for run in self.runs)
        kind = type(self).__name__
        size = f"{counted(runs, 'run')}, {counted(samples, 'sample')}"
        return f"<{kind} {self.name!r}: {size}{sweep}>"

    @overload
    def __getitem__(self, which: str | int | np.integer) -> Run: ...

    @overload
    def __getitem__(self, which: slice | Sequence[Any] | np.ndarray) -> "Dataset": ...

    def __getitem__(self, which: Any) -> "Run | Dataset":
        if isinstance(which, str):
            return self._named(which)
        if isinstance(which, slice):
            return replace(self, runs=self.runs[which])
        chosen = np.asarray(which)
        if chosen.dtype == bool and chosen.shape == (len(self),) and len(self):
            chosen = np.flatnonzero(chosen)
        if chosen.ndim == 0 and np.issubdtype(chosen.dtype, np.integer):
            return self._numbered(int(chosen))
        if chosen.ndim == 1 and (chosen.size == 0 or chosen.dtype.kind in "iu"):
            return replace(self, runs=tuple(self._numbered(int(i)) for i in chosen))
        if chosen.ndim == 1 and chosen.dtype.kind == "U":
            return self.select([str(name) for name in chosen])
        raise InputError(
            f"A run of the data set {self.name!r} is chosen by its name or number, several by a "
            f"slice, by names, by numbers, or by {len(self)} booleans; got {which!r}."
        )

    def _named(self, name: str) -> Run:
        if (run := next((run for run in self.runs if run.name == name), None)) is not None:
            return run
        if (why := self.set_aside.get(name)) is not None:
            raise InputError(
                f"The run {name!r} of {self.name!r} cannot be used: {why}. Name another."
            )
        raise InputError(unknown_name("run", name, self.names, f"The data set {self.name!r}"))

    def _numbered(self, number: int) -> Run:
        if -len(self) <= number < len(self):
            return self.runs[number]
        # an IndexError: it ends a loop over the numbers of a sequence
        raise IndexError(
            f"The data set {self.name!r} has {len(self)} runs; there is no number {number}."
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the runs."""
        return tuple(run.name for run in self.runs)

    @property
    def thinned(self) -> str:
        """What was thinned, in sentences, one for each way; empty if nothing was."""
        said = {run.name: str(run.metadata.get("thinned", "")) for run in self.runs}
        return " ".join(f"{', '.join(names)}: {text}." for text, names in _by_text(said).items())

    @property
    def left_out(self) -> str:
        """Which runs were set aside and why, in sentences, one for each reason."""
        said = []
        for reason, (first, *more) in _by_text(self.set_aside).items():
            them = f"{first} and {len(more)} more runs like it are" if more else f"{first} is"
            said.append(f"{them} set aside: {reason}.")
        return " ".join(said)

    def table(self) -> pd.DataFrame:
        """Return the runs as a table, one line each; units are in the names of the columns."""
        return pd.DataFrame([run_line(run) for run in self.runs])

    def _shown(self) -> Iterable[Any]:
        sweep = self.linear_sweep
        points = 0 if sweep is None else len(sweep.angular_frequency)
        linear = f"a linear sweep of {points} points" if points else "no linear sweep"
        first = next(iter(self.provenance.splitlines()), "")
        yield f"{self.name}: {len(self)} runs, {linear}. {first}".strip()
        table = self.table()
        for name in ("N1", "N2") if len(self) else ():
            table[name] = ["measured" if there else None for there in table[name]]
        yield table
        yield self.thinned
        yield self.left_out

    def select(self, names: Sequence[str]) -> "Dataset":
        """Return the data set of the named runs, in that order; InputError if there is no such."""
        if isinstance(names, str) or not _are_names(names):
            raise InputError(f"Runs are named in a list; got {short(names)}.")
        problems, runs = Problems(), []
        for name in names:
            with problems.collected():
                runs.append(self._named(name))
        problems.require_none(self.name)
        return replace(self, runs=tuple(runs))

    def with_material_functions(self, kinds: Sequence[str] | None = None) -> "Dataset":
        """Return the data with its tables as runs; InputError if there is no such table.

        `kinds`: of `material_functions`, or ``lve``; by default all tables, and ``lve`` only where
        there is nothing else. G′ and G″ of a sweep become a run each.
        """
        there = dict(self.material_functions)
        if self.linear_sweep is not None:
            there["lve"] = linear_sweep_as_run(self.linear_sweep)
        for kind in kinds or ():
            if f"{kind}.csv" in self.set_aside:
                raise InputError(f"{kind}.csv cannot be used: {self.set_aside[f'{kind}.csv']}.")
            if kind not in there:
                raise InputError(
                    f"The data set {self.name!r} has no {kind}.csv; it has "
                    f"{', '.join(f'{name}.csv' for name in there) or 'no such table'}."
                )
        alone = not self.runs and not self.material_functions
        chosen = list(there if alone else self.material_functions) if kinds is None else kinds
        added = [record for kind in chosen for record in there[kind].records]
        left = {kind: run for kind, run in self.material_functions.items() if kind not in chosen}
        return replace(self, runs=(*self.runs, *added), material_functions=left)

    def quantity_by_quantity(self) -> "Dataset":
        """Return the data with N1 and N2 as runs of their own, without impossible samples."""
        late, never = sound_normal_stress(self.runs, self.linear_sweep)
        aside = {f"{name} (N1)": why for name, why in never.items()}
        seen: list[Run] = []
        for run in self.runs:
            records = [run.observing(name) for name in run.also_recorded]
            kept = [one for one in records if one.name not in {*aside, *self.names}]
            seen += [run, *(_from_then_on(record, late.get(run.name)) for record in kept)]
        return replace(self, runs=tuple(seen), set_aside={**self.set_aside, **aside})

    def split(
        self, held_out: Sequence[str], fit: Sequence[str] | None = None
    ) -> "tuple[Dataset, Dataset]":
        """Return the runs to fit, by default all others, and those held out; else InputError."""
        for label, names in (("held_out", held_out), ("fit", fit)):
            if isinstance(names, str):
                raise InputError(
                    f"{label} must be a list of names; got {names!r}. Write [{names!r}]."
                )
            if not _are_names(names) and not (names is None and label == "fit"):
                raise InputError(f"{label} must be a list of names of runs; got {names!r}.")
        test = self.select(list(held_out))
        train = self.select([n for n in self.names if n not in held_out] if fit is None else fit)
        if both := set(train.names) & set(test.names):
            raise InputError(f"The run {sorted(both)[0]!r} is both in fit and in held_out.")
        if not len(train) or not len(test):
            left = f"No run is left to {'hold out' if len(train) else 'fit'}; the data set"
            there = ", ".join(self.names)
            raise InputError(f"{left} {self.name!r} has {there}. Divide them.")
        return train, test

    def to_dataframe(self) -> pd.DataFrame:
        """Return all samples, one line each: the column ``run``, then those of its file."""
        if not self.runs:
            return pd.DataFrame({"run": []})
        table = pd.concat(
            [run.to_dataframe().assign(run=run.name) for run in self.runs], ignore_index=True
        )
        table.insert(0, "run", table.pop("run"))
        return table


def _by_text(said: Mapping[str, str]) -> dict[str, list[str]]:
    named: dict[str, list[str]] = {}
    for name, text in said.items():
        if text:
            named.setdefault(text, []).append(name)
    return named


def _are_names(names: object) -> bool:
    return isinstance(names, Iterable) and all(isinstance(name, str) for name in names)


def _from_then_on(record: Run, time: float | None) -> Run:
    """Return a record of N1 without the samples that cannot be right, up to a time in s."""
    if time is None or record.quantity != "N1":
        return record
    kept = record.time > time
    said = f"{int(np.sum(~kept))} samples up to {time:.4g} s, which cannot be right, are left out"
    before = record.metadata.get("thinned")
    metadata = {**record.metadata, "thinned": f"{before}; {said}" if before else said}
    return replace(record.window(kept), metadata=metadata)
