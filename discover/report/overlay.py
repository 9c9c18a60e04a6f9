"""Curves that a study asks for in addition: a law, or what another program predicts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from jaxtyping import Float

from discover.comparison.flows import QUANTITIES, Flow, predict
from discover.dataset import Dataset
from discover.dataset.tables.table import read_table, shown
from discover.errors import InputError
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.laws import LAWS, Fluid, make_law
from discover.loop import RunRecord
from discover.study.schema import OverlayAsked, Study
from discover.words import listed

COLUMNS = ("run", "time_s", "quantity", "value")
"""What a file of curves has, as in ``predictions.csv``."""

Points = Mapping[tuple[str, str], tuple[Float[np.ndarray, " m"], Float[np.ndarray, " m"]]]
"""Times in s and values, by run and quantity."""


@dataclass(frozen=True)
class Source:
    """An overlay before anything of it is predicted."""

    label: str  # what stands in legends and tables
    asked: OverlayAsked  # what the study says of it
    points: Points | None = None  # of a file; None of a law

    def fluid(self, modes: Fluid) -> Fluid:
        """Return the law in these modes, or in those that the study gives."""
        assert self.asked.law is not None
        modulus = modes.modulus if self.asked.modulus_Pa is None else self.asked.modulus_Pa
        time = self.asked.relaxation_time_s
        time = modes.relaxation_time if time is None else time
        law = make_law(self.asked.law, self.asked.parameters)
        return Fluid(law, np.asarray(modulus), np.asarray(time), modes.solvent_viscosity)


@dataclass(frozen=True)
class Overlay:
    """A labelled curve in every run of which something is known.

    `curves`: by name of a run, or key of a flow, and by quantity, at its samples; NaN where
        unknown.
    """

    label: str  # what stands in legends and tables
    curves: Mapping[str, Mapping[str, Float[np.ndarray, " n"]]]

    def of(self, name: str, quantity: str) -> Float[np.ndarray, " n"] | None:
        """Return the curve of a quantity in a run, or None."""
        return self.curves.get(name, {}).get(quantity)


def read_overlays(study: Study) -> list[Source]:
    """Return what a study wants drawn with its own curves.

    Raises InputError if a law's parameter or a file is wrong.
    """
    sources = []
    for number, asked in enumerate(study.report.overlay, 1):
        if asked.law is not None:
            where = f"[report] overlay, entry {number}"
            try:
                make_law(asked.law, asked.parameters)
            except InputError as error:
                raise InputError(f"{where}: {error}") from None
            label = asked.label or LAWS[asked.law].described(asked.parameters)
            sources.append(Source(label, asked))
            continue
        assert asked.file is not None
        path = Path(asked.file)
        if study.path is not None:
            path = study.path.parent / path
        sources.append(Source(asked.label or path.stem, asked, _read(path)))
    labels = [source.label for source in sources]
    twice = next((label for label in labels if labels.count(label) > 1), None)
    if twice is not None:
        raise InputError(
            f"[report] overlay has two entries with the label {twice!r}. Give each its own label."
        )
    return sources


def loop_overlays(
    sources: Sequence[Source], records: Sequence[RunRecord], dataset: Dataset, modes: Fluid
) -> tuple[Overlay, ...]:
    """Return the curves at the samples of a loop's records, without effects of the instrument.

    `sources`: from `read_overlays`. `records`: runs as the loop left them. `dataset`: the data that
    they come from. `modes`: the declared fluid, whose modes and solvent a law gets that has none of
    its own.
    """
    found = []
    for source in sources:
        if source.points is not None:
            keys = [(r.name, r.name, r.quantity, r.quantity, r.time) for r in records]
            found.append(Overlay(source.label, _at_samples(source, keys)))
            continue
        fluid = source.fluid(modes)
        # the loop may have left samples out
        by_name = {run.name: run for run in dataset}
        runs = [by_name[r.name].window(np.isin(by_name[r.name].time, r.time)) for r in records]
        model = AugmentedModel(
            DeclaredModel(
                fluid.law,
                np.asarray(fluid.modulus),
                np.asarray(fluid.relaxation_time),
                float(fluid.solvent_viscosity),
            ),
            [],
        )
        predicted = model.predict(model.zero(), make_batch(runs))
        curves = {
            r.name: {r.quantity: row[: len(r.time)]}
            for r, run, row in zip(records, runs, predicted, strict=True)
            if len(run) == len(r.time)
        }
        found.append(Overlay(source.label, curves))
    return tuple(found)


def comparison_overlays(
    sources: Sequence[Source], flows: Sequence[Flow], modes: Fluid
) -> tuple[Overlay, ...]:
    """Return the curves at the samples of a comparison's flows.

    `flows`: of the comparison. One through which a law cannot be integrated has no curve of it.
    """
    drawn = [flow for flow in flows if flow.kind != "pipkin"]
    found = []
    for source in sources:
        if source.points is not None:
            keys = [
                # what a comparison calls σ12 is what was recorded, in extension too
                (f.key, f.name, written, called, f.times)
                for f in drawn
                for written, called in (
                    zip(QUANTITIES, QUANTITIES, strict=True)
                    if f.records_shear_stress
                    else [(f.protocol.quantity, "sigma12")]
                )
            ]
            found.append(Overlay(source.label, _at_samples(source, keys)))
            continue
        fluid = source.fluid(modes)
        stresses = {flow.key: predict(fluid, flow) for flow in drawn}
        curves = {key: one for key, one in stresses.items() if one is not None}
        found.append(Overlay(source.label, curves))
    return tuple(found)


def _at_samples(source: Source, keys) -> dict[str, dict[str, np.ndarray]]:
    """Return the points of a file at the samples of runs: straight between them, none beyond."""
    assert source.points is not None
    curves: dict[str, dict[str, np.ndarray]] = {}
    for key, run, written, called, times in keys:
        if (run, written) in source.points:
            at, values = source.points[run, written]
            curves.setdefault(key, {})[called] = np.interp(times, at, values, np.nan, np.nan)
    if not curves:
        known = ", ".join(dict.fromkeys(shown(run) for _, run, *_ in keys))
        raise InputError(
            f"No run of the overlay {source.label!r} is one of this study. Write in its column run "
            f"some of {known[:300]}, and in quantity what they recorded."
        )
    return curves


def _read(path: Path) -> Points:
    table = read_table(path, if_missing="Give the path relative to the study file.")
    missing = [name for name in COLUMNS if name not in table.columns]
    if missing:
        raise InputError(
            f"{table.name} has no column {listed(missing)}; an overlay has the columns "
            f"{', '.join(COLUMNS)}, as predictions.csv does. Its columns are {table.listed}."
        )
    sources = set(table.columns.get("source", ()))
    if len(sources) > 1:
        raise InputError(
            f"{table.name} holds the curves of several sources ({', '.join(sorted(sources)[:4])}). "
            "Keep the lines of one."
        )
    times, values = table.numbers("time_s"), table.numbers("value")
    runs, quantities = (pd.Series(table.columns[name]) for name in ("run", "quantity"))
    points = {}
    for run, quantity in dict.fromkeys(zip(runs, quantities, strict=True)):
        rows = np.asarray((runs == run) & (quantities == quantity))
        if np.any(np.diff(times[rows]) <= 0):
            raise InputError(
                f"time_s in {table.name} must increase within the run {shown(run)} and "
                f"{shown(quantity)}. Sort its lines."
            )
        points[run, quantity] = times[rows], values[rows]
    return points
