"""Every named law, fitted to every measured set: error fitted and held out, before any effect.

    DISCOVER_DATA=... python benchmarks/laws_on_measured.py [STUDY...] [--out DIR] [--laws NAME...]

Takes each study (by default those of `DEFAULT`) with its split, modes and known effects, fits one
law after the other with all its constants, and prints a table. One small file in DIR holds each
pair of study and law: what is there is not fitted again, so that the table grows over several
calls. Where a study holds out each run in turn, a law is fitted once without each of them. A
constant at an end of its range stands in brackets: the runs ask for a value outside it. One that
moves no prediction by a thousandth when halved and doubled stands in square brackets: the runs do
not determine it, and the value is where the fit began.
"""

import argparse
import json
import tempfile
import time
import tomllib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from independent.folders import write_study

from discover.compilation_cache import enable_compilation_cache
from discover.dataset import Run
from discover.errors import InputError
from discover.forward import AugmentedModel, DeclaredModel, data_scales, make_batch
from discover.laws import LAWS
from discover.loop.loop import Task, with_law
from discover.loop.runs import MOST_SAMPLES, split_runs
from discover.precision import enable_x64
from discover.study.atomic import write_text
from discover.study.data import load_study_data
from discover.study.declared_model import declared_model, forward_model
from discover.study.read import read_study

# others bring a spectrum of their own, and are fitted where they are named
ONE_MODE = [name for name, law in LAWS.items() if law.is_one_mode]
STUDIES = Path(__file__).parents[1] / "studies"
DEFAULT = (
    "polyisoprene-laws", "ldpe-shear", "ldpe-shear-and-extension", "gel-laos", "blood-steps",
    "polymer-flow-curve",
)  # fmt: skip


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
    """Return constants, errors and seconds of processor, compilation included, of one law."""
    started = time.process_time()
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
            return {"error": None, "seconds": time.process_time() - started}
        found = next(one for one in tried if one.law == law)
        if found.error is None:
            return {"error": None, "seconds": time.process_time() - started}
        if left_out:
            unseen.append(np.nan if found.error.held_out is None else found.error.held_out)
    held_out = float(np.mean(unseen)) if unseen else None
    return {
        "error": {"fit": found.error.fit, "held_out": held_out},
        "parameters": dict(found.parameters),
        "at_end": list(found.at_end),
        "open": open_constants(with_law(declared, law, found.parameters), parts[0]),
        "seconds": time.process_time() - started,
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


def row(law: str, found: dict) -> str:
    """Return the line of one law."""
    title, seconds = LAWS[law].title, f"{found['seconds']:.0f}"
    if found["error"] is None:
        return f"| {title} | | did not converge | | {seconds} |"
    marks = dict.fromkeys(found["open"], "[{}]") | dict.fromkeys(found["at_end"], "({})")
    constants = ", ".join(
        marks.get(name, "{}").format(f"{name} = {value:.3g}")
        for name, value in found["parameters"].items()
    )
    errors = (percent(found["error"][key]) for key in ("fit", "held_out"))
    return f"| {title} | {constants} | {' | '.join(errors)} | {seconds} |"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table of each study."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("studies", nargs="*", type=Path)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--laws", nargs="+", default=ONE_MODE, choices=list(LAWS))
    given = parser.parse_args(arguments)
    enable_x64()
    enable_compilation_cache()
    out = given.out or Path(tempfile.mkdtemp())
    for study in given.studies or [STUDIES / f"{name}.toml" for name in DEFAULT]:
        folder = out / study.stem
        folder.mkdir(parents=True, exist_ok=True)
        made = write_study(folder / "study.toml", without_law(study))
        found = {}
        for law in given.laws:
            kept = folder / f"{law}.json"
            if not kept.exists():
                write_text(kept, json.dumps(fit_law(made, law)))
            found[law] = json.loads(kept.read_text(encoding="utf-8"))
        print(f"\n{study.stem}\n")
        print("| law | constants | fitted, % | held out, % | seconds of processor |")
        print("|---|---|---|---|---|")
        told = [law for law in found if found[law]["error"] is not None]
        told.sort(key=lambda law: found[law]["error"]["fit"])
        for law in (*told, *(law for law in found if law not in told)):
            print(row(law, found[law]), flush=True)


if __name__ == "__main__":
    main()
