"""From a study to its data and their split."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from discover._version import __version__
from discover.dataset import Dataset
from discover.dataset.load import files_of, load_dataset, resolve_folder
from discover.dataset.material_functions import TABLES
from discover.dataset.records.repeats import require_no_copies
from discover.dataset.run import require_signal
from discover.dataset.run_table import temperature_of
from discover.dataset.tables.table import read_bytes, read_toml
from discover.errors import InputError
from discover.laws.multimode import Fluid
from discover.protocols.kinematics import MODULI
from discover.simulate.synthetic import SyntheticDataset, synthetic_dataset
from discover.study.from_result import result_file
from discover.study.schema import Data, Study
from discover.validation import validated
from discover.words import unknown_name


@dataclass(frozen=True)
class StudyData:
    """The data of a study, split into runs that fits may see and runs that only test."""

    dataset: Dataset
    fit: Dataset
    held_out: Dataset
    each: bool = False  # whether every fitted run is also to be held out in turn

    @property
    def truth(self) -> Fluid | None:
        """The fluid that made synthetic data, or None."""
        return self.dataset.truth if isinstance(self.dataset, SyntheticDataset) else None


def temperature(study: Study, dataset: Dataset) -> float | None:
    """Return the temperature of moduli and times in °C; None where nobody gave it."""
    given = study.data.temperature_C
    return temperature_of(dataset) if given is None else given


def load_study_data(study: Study, seed: int | None = None) -> StudyData:
    """Divide a study into runs to fit and held out; InputError if a file or name is wrong."""
    data = study.data
    if data.synthetic is not None:
        made = data.synthetic
        noise = made.noise, made.seed if seed is None else seed
        dataset: Dataset = synthetic_dataset(
            made.law, made.parameters, made.protocol, *noise, made.samples
        )
    else:
        dataset = load_dataset(
            str(data.folder), data.clock_factor, study.path and study.path.parent,
            data.rate == "measured", data.rate_before, data.sequence, data.amplitude_sweep_rad_s,
        )  # fmt: skip
    each = data.held_out == "each"
    dataset, roles = _with_tables(dataset, data)
    judges = (name for name, role in roles.items() if role == "judge")
    named = list(dict.fromkeys([*(() if data.held_out == "each" else data.held_out), *judges]))
    beside = (name for name, role in roles.items() if role == "fit")
    fit = list(dict.fromkeys([*(data.fit or dataset.names), *beside]))
    fit_names = [name for name in fit if name not in named]
    if data.observe is not None:
        dataset.select([*named, *fit_names])  # names that do not exist are refused
        asked = fit if data.fit else ()
        dataset, named, fit_names = _observed(dataset, data.observe, named, fit_names, asked)
    held_out = dataset.select(named)
    if not len(dataset):
        raise InputError(
            f"The data set {dataset.name!r} has no run, and no table that could be fitted in place "
            "of one. Add runs.csv with one line a run, or one of "
            f"{', '.join(f'{kind}.csv' for kind in TABLES)} or lve.csv."
        )
    if not fit_names:
        raise InputError("Every run is held out; leave at least one run to fit.")
    if each and len(fit_names) < 2:
        raise InputError(
            f'held_out = "each" needs at least 2 runs, one to leave out and one to fit; got '
            f"{len(fit_names)}. Leave held_out out."
        )
    fit = dataset.select(fit_names)
    require_signal(fit.runs)
    require_no_copies(fit.runs, held_out.runs)
    return StudyData(dataset, fit, held_out, each)


def _with_tables(dataset: Dataset, data: Data) -> tuple[Dataset, dict[str, str]]:
    """Add the tables beside the runs, and return their roles: by default to test, if runs are."""
    kinds = (*TABLES, "lve")
    asked = {kind: role for kind in kinds if (role := getattr(data, kind)) is not None}
    dataset.with_material_functions(list(asked))  # those that are not there are refused
    there = list(dataset.material_functions)
    # the linear sweep gives the modes, and is no test unless it is asked for
    if "lve" in asked or (dataset.linear_sweep is not None and not there and not len(dataset)):
        there.append("lve")
    roles = {kind: asked.get(kind, "judge" if len(dataset) else "fit") for kind in there}
    if data.held_out == "each":
        # each run tests in turn, and nothing beside them
        roles = {kind: role for kind, role in roles.items() if role == "fit" or kind in asked}
    whole = dataset.with_material_functions(list(roles))
    of_tables = whole.runs[len(dataset) :]
    return whole, {run.name: roles[run.source.removesuffix(".csv")] for run in of_tables}


def _observed(
    dataset: Dataset, observe: Sequence[str], held_out: Sequence[str], fit: Sequence[str],
    asked: Sequence[str],
) -> tuple[Dataset, list[str], list[str]]:  # fmt: skip
    """Return every quantity as a record, those held out, those fitted; `asked` must have some."""
    whole = dataset.quantity_by_quantity()
    missing = set(observe) - {run.quantity for run in whole}
    if missing:
        there, its = sorted({run.quantity for run in whole}), f"the data set {dataset.name!r}"
        left = f" {whole.left_out}" if whole.left_out else ""
        raise InputError(
            f"[data] observe: {unknown_name('quantity', sorted(missing)[0], there, its)}{left}"
        )
    by_name = {run.name: [] for run in dataset}
    for run in whole:
        by_name[run.name if run.quantity in MODULI else run.source].append(run)
    # both moduli of a sweep are fitted, unless one of them is named
    observed = set(observe) if set(observe) & set(MODULI) else {*observe, *MODULI}
    for name in asked:
        if not any(run.quantity in observed for run in by_name[name]):
            raise InputError(
                f"[data] fit names {name!r}, which recorded nothing that is in observe = "
                f"{list(observe)}. Leave the run out of fit, or add what it recorded to observe."
            )
    fitted = [run.name for name in fit for run in by_name[name] if run.quantity in observed]
    beside = [run.name for name in (*held_out, *fit) for run in by_name[name]]
    return whole, [name for name in beside if name not in fitted], fitted


def read_study(path: str | Path) -> Study:
    """Return the study in a TOML file; InputError names an unknown key or a wrong value."""
    path = Path(path)
    content, text = read_toml(path, "study file", "Write it like those in studies/.")
    study = parse_study(content, str(path))
    study._path, study._text = path, text
    return study


def parse_study(content: dict, where: str = "the study") -> Study:
    """Return a study from nested dictionaries, as TOML gives them; InputError names a wrong key."""
    return validated(Study, content, where)


def fingerprint(study: Study, *extra: object) -> str:
    """Return a hash of everything that decides a study's results, `extra` too."""
    digest = hashlib.sha256(study.model_dump_json().encode())
    for item in (__version__, *extra):
        digest.update(f"|{item!r}".encode())
    if study.data.folder is not None:
        # what else lies there decides nothing, and may be a result of this very study
        for path in files_of(resolve_folder(study.data.folder, study.path and study.path.parent)):
            digest.update(path.name.encode("utf-8", "surrogateescape"))
            digest.update(read_bytes(path, path.name))
    if study.model.from_ is not None:
        earlier = result_file(study.model.from_, study.path)
        digest.update(read_bytes(earlier, earlier.name))
    return digest.hexdigest()[:16]
