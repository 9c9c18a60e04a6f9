"""Data sets and fluids that a program holds, as the tasks take them from a study."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from discover.dataset import Dataset, Run
from discover.dataset.records.repeats import require_no_copies
from discover.dataset.run import require_signal
from discover.effects import known_effects
from discover.errors import InputError
from discover.laws.each_mode import differs_by_mode
from discover.laws.multimode import Fluid
from discover.laws.registry import check_law, make_law, name_of
from discover.simulate.synthetic import SyntheticDataset
from discover.study.data import StudyData, parse_study
from discover.study.declared_model import (
    MODE_CONSTANTS,
    StudyModel,
    linear_start,
    spectrum_of_modes,
)
from discover.study.schema import Study

HeldOut = Dataset | Sequence[str] | Literal["each"]
"""What only tests: a data set of its own, or names of runs of the data set."""


def data_in_memory(data: Dataset, held_out: HeldOut = ()) -> StudyData:
    """Return data divided into runs to fit and runs held out.

    `data`: of a data set without runs its tables are fitted, or its linear sweep where there is no
    other. `held_out`: a data set, names of runs of `data`, or ``"each"``. Raises InputError if a
    run is both fitted and held out, none is left to fit, or those to fit hold no signal.
    """
    if not isinstance(data, Dataset):
        raise InputError(
            f"This needs a data set; got a {type(data).__name__}. Load one with load_dataset, or "
            'make one of runs: Dataset("name", runs).'
        )
    if not data.runs and (data.material_functions or data.linear_sweep is not None):
        data = data.with_material_functions()  # as a study does where there is nothing else
    if isinstance(held_out, Dataset):
        divided = StudyData(joined(data, held_out.runs), data, held_out)
    elif not isinstance(held_out, Iterable) or (isinstance(held_out, str) and held_out != "each"):
        write = f" Write [{held_out!r}] for this run." if isinstance(held_out, str) else ""
        raise InputError(
            f"held_out must be a data set, a list of names or 'each'; got {held_out!r}.{write}"
        )
    elif held_out == "each" or not len(names := list(held_out)):
        divided = StudyData(data, data, data.select([]), each=held_out == "each")
    else:
        divided = StudyData(data, *data.split(names))
    require_signal(divided.fit.runs)
    require_no_copies(divided.fit.runs, divided.held_out.runs)
    return divided


def joined(data: Dataset, more: Sequence[Run]) -> Dataset:
    """Return a data set with further runs; InputError if a run of the same name is there."""
    both = set(data.names) & {run.name for run in more}
    if both:
        raise InputError(
            f"The run {sorted(both)[0]!r} is both fitted and held out, so it proves nothing. "
            "Divide the runs with train, test = data.split(held_out=[...])."
        )
    runs = (*data.runs, *more)
    exact = data.exact or {} if isinstance(data, SyntheticDataset) else None
    if exact is None or all(run.name in exact for run in runs):
        return replace(data, runs=runs)
    # the truth of what was added is not known
    return Dataset(data.name, runs, data.linear_sweep, data.provenance)


def declared_fluid(base: Any, data: Dataset) -> StudyModel:
    """Return a `Fluid` as the declared model of a study.

    None is that of the data's linear sweep and without a sweep one mode
    of Maxwell, which is to be fitted.
    """
    free = ()
    if base is None and data.linear_sweep is not None:
        base = Fluid.from_sweep(data.linear_sweep)
    elif base is None:
        base, free = Fluid(make_law("ucm"), *linear_start(data.runs)), MODE_CONSTANTS
    if not isinstance(base, Fluid):
        raise InputError(
            f"base must be a Fluid; got a {type(base).__name__}. Make one with "
            "Fluid(law, modulus, relaxation_time) or Fluid.from_sweep(data.linear_sweep)."
        )
    check_law(base.law)
    own = type(base.law).__name__
    if differs_by_mode(base.law):
        own = "a law with constants of its own in each mode"
    name, parameters = name_of(base.law) or (own, {})
    modulus, times = np.asarray(base.modulus), np.asarray(base.relaxation_time)
    solvent = float(base.solvent_viscosity)
    spectrum = spectrum_of_modes(data.linear_sweep, solvent, times, modulus)
    return StudyModel(base.law, name, parameters, modulus, times, free, spectrum, solvent)


def study_in_memory(data: Dataset, asked: Mapping[str, Any], where: str) -> Study:
    """Return the study that would ask for the same with files: `asked`, besides ``[data]``."""
    source: dict[str, Any] = {"folder": data.name or "data in memory"}
    if isinstance(data, SyntheticDataset) and data.truth is not None:
        found = name_of(data.truth.law)
        if found is not None:
            made = {"law": found[0], "parameters": found[1], "noise": data.noise}
            source = {"synthetic": made}
    return parse_study({"data": source, **asked}, where)


def with_known(
    declared: StudyModel,
    effects: Mapping[str, Any] | None,
    free: Sequence[str] = (),
    by_mode: Sequence[str] = (),
) -> StudyModel:
    """Return a declared model with effects known beside it, and with what more of it is fitted.

    `effects`: as ``[model] effects``. `by_mode`: which of them may differ from mode to mode. Raises
    InputError if an effect, a value or a constant is not as it should be.
    """
    for option, names in (("free", free), ("by_mode", by_mode)):
        if isinstance(names, str):
            raise InputError(f"{option} must be a list of names; got {names!r}. Write [{names!r}].")
    possible = (*declared.parameters, *MODE_CONSTANTS)
    unknown = [name for name in free if name not in possible]
    if unknown:
        raise InputError(
            f"{unknown[0]!r} cannot be fitted: the base has {', '.join(possible)}. A law without a "
            "name has no constant that could; register it with register_law."
        )
    known = known_effects({} if effects is None else effects, "known_effects")
    free = tuple(dict.fromkeys((*declared.free, *free)))
    return replace(declared, effects=known, free=free, by_mode=tuple(by_mode))
