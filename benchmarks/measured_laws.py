"""Every named law, fitted to every measured set: error fitted and held out, before any effect.

Takes each study with its split, modes and known effects, and fits one law with all its constants.
DISCOVER_DATA is the folder of the data, which are no part of this project. Where a study holds out
each run in turn, a law is fitted once without each of them. A
constant at an end of its range stands in brackets: the runs ask for a value outside it. One that
moves no prediction by a thousandth when halved and doubled stands in square brackets: the runs do
not determine it, and the value is where the fit began.
"""

import tomllib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from independent.folders import write_study

from discover.compilation_cache import enable_compilation_cache
from discover.dataset import Run
from discover.errors import InputError
from discover.first_use import enable_x64
from discover.forward import AugmentedModel, DeclaredModel, data_scales, make_batch
from discover.laws import LAWS
from discover.loop.loop import Task, with_law
from discover.loop.runs import MOST_SAMPLES, split_runs
from discover.study.data import load_study_data, read_study
from discover.study.declared_model import declared_model, forward_model

# others bring a spectrum of their own, and are fitted where they are named
ONE_MODE = [name for name, law in LAWS.items() if law.is_one_mode]
STUDIES = Path(__file__).parents[1] / "studies"
DEFAULT = (
    "polyisoprene-laws", "ldpe-shear", "ldpe-shear-and-extension", "gel-laos", "blood-steps",
    "polymer-flow-curve",
)  # fmt: skip
QUESTIONS, SEED = ("fit",), 0
GROUPS = {study: [f"{study} {law}" for law in ONE_MODE] for study in DEFAULT}


def names(seed: int) -> list[str]:
    del seed
    return [name for group in GROUPS.values() for name in group]


def run(name: str, question: str, seed: int, folder: Path) -> dict:
    """Return the row of one study and law."""
    enable_x64()
    enable_compilation_cache()
    study, law = name.split(" ")
    sections = without_law(STUDIES / f"{study}.toml")
    return fit_law(write_study(folder / "study.toml", sections), law)


def without_law(study: Path) -> dict:
    """Return the sections of a study that leaves its law open and adds nothing."""
    sections = tomllib.loads(study.read_text(encoding="utf-8"))
    model = {
        key: value
        for key, value in sections.get("model", {}).items()
        if key not in ("parameters", "by_mode", "known_relaxation")
    }
    loop = {"max_effects": 0}
    loop |= {key: value for key, value in sections.get("loop", {}).items() if key == "strain"}
    return {"data": sections["data"], "model": model | {"law": "any"}, "loop": loop}


def fit_law(made: Path, law: str) -> dict:
    """Return constants, and errors of one law."""
    study = read_study(made)
    data = load_study_data(study, None)
    declared = forward_model(declared_model(study, data.dataset))
    names = list(data.fit.names)
    held = [[name] for name in names] if data.each else [list(data.held_out.names)]
    unseen: list[float] = []
    if data.each:
        held.append([])  # the constants shown are those of all runs
    for left_out in held:
        fitted = [name for name in names if name not in left_out]
        parts = split_runs(data.dataset, fitted, left_out, study.loop.strain, MOST_SAMPLES)[:2]
        try:
            task = Task((), *parts, None, 0.0, 0, lambda line: None)
            tried = task.lines(task.choose(declared, [law])[1])
        except InputError:
            return {"error": None, "verdict": "no fit"}
        found = next(one for one in tried if one.law == law)
        if found.error is None:
            return {"error": None, "verdict": "no fit"}
        if left_out:
            unseen.append(np.nan if found.error.held_out is None else found.error.held_out)
    held_out = float(np.mean(unseen)) if unseen else None
    return {
        "error": {"fit": found.error.fit, "held_out": held_out},
        "parameters": dict(found.parameters),
        "at_end": list(found.at_end),
        "open": open_constants(with_law(declared, law, found.parameters), parts[0]),
        "verdict": "fitted",
    }


def open_constants(declared: DeclaredModel, runs: Sequence[Run]) -> list[str]:
    """Return the constants of a fitted law that no prediction depends on."""
    model, batch = AugmentedModel(declared, [], data_scales(runs)), make_batch(runs)
    theta = np.array(model.zero())

    def predicted(at: int, factor: float) -> np.ndarray:
        moved = theta.copy()
        moved[at] *= factor
        return np.concatenate([np.ravel(one) for one in model.predict(moved, batch)])

    found = []
    for at, constant in enumerate(declared.free_parameters, start=2):
        here = predicted(at, 1.0)
        moved = [np.max(np.abs(predicted(at, factor) - here)) for factor in (0.5, 2.0)]
        if theta[at] > 0.0 and max(moved) < 1e-3 * np.sqrt(np.mean(here**2)):
            found.append(constant.name)
    return found


def percent(value: float | None) -> str:
    """Return a share in percent; a dash where there is none, "runs away" where it is no number."""
    if value is None:
        return "–"
    if not np.isfinite(value) or value > 100.0:
        return "runs away"
    return f"{100 * value:.3g}" if value < 1.0 else f"{100 * value:.0f}"


def line(row: dict) -> str:
    """Return the line of one law."""
    title = LAWS[row["case"].split(" ")[1]].title
    if row.get("error") is None:
        return f"| {title} | | did not converge | | {row['processor_seconds']:.0f} |"
    marks = dict.fromkeys(row["open"], "[{}]") | dict.fromkeys(row["at_end"], "({})")
    constants = ", ".join(
        marks.get(name, "{}").format(f"{name} = {value:.3g}")
        for name, value in row["parameters"].items()
    )
    errors = " | ".join(percent(row["error"][key]) for key in ("fit", "held_out"))
    return f"| {title} | {constants} | {errors} | {row['processor_seconds']:.0f} |"


def table(rows: list[dict]) -> str:
    """Return the table of each study, the best law first."""
    lines = []
    for study, members in GROUPS.items():
        some = [row for row in rows if row["case"] in members]
        some.sort(key=lambda row: row["error"]["fit"] if row.get("error") else np.inf)
        lines += ["", study, "", "| law | constants | fitted, % | held out, % | seconds |"]
        lines += ["|---" * 5 + "|", *map(line, some)]
    return "\n".join(lines)
