"""A law, its modes and its effects as an earlier result found them."""

import os
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from discover.effects import KnownEffect, known_effects
from discover.equations import Equation
from discover.equations.files import COMPARISON, LOOP, equation_from_json, read_json
from discover.errors import InputError
from discover.laws.registry import LAWS
from discover.study.run_folder import STATE_FILE, STATE_FOLDER
from discover.words import counted

_AGAIN = "Run the command that made it again with --overwrite."


@dataclass(frozen=True)
class EarlierResult:
    """What a study takes over from an earlier result."""

    file: Path  # where it was read
    equation: Equation  # the law with its modes
    effects: tuple[KnownEffect, ...]  # effects beside the law, with their values
    of_modes: tuple[
        tuple[KnownEffect, ...], ...
    ]  # values by mode of effects with constants of each
    text: str  # what was taken, in words
    # 95 % intervals of constants, by effect, or "" of the law and its modes, and name
    intervals: Mapping[tuple[str, str], tuple[float, float]]
    doubt: str  # that it did not explain its own data, in words, or empty

    def told(self, replaced: Collection[str]) -> str:
        """Return in words what was taken, but for effects that a study has itself."""
        had = ", ".join(
            f"{name}{f' of {effect}' * bool(effect)} {low:.3g} to {high:.3g}"
            for (effect, name), (low, high) in self.intervals.items()
            if effect not in replaced
        )
        open_ends = f" (95 % CI {had})" if had else ""
        exact = f" Constants count as exact: no interval here allows for theirs{open_ends}."
        return f"{self.text}{exact}{self.doubt}"


def result_file(written: str, study_file: Path | None) -> Path:
    """Return the file of an earlier result; InputError if there is none, or it is not finished.

    `written`: the folder, relative to the study file or to the working directory.
    """
    folders = [Path(written)]
    if study_file is not None:
        folders.insert(0, study_file.parent / written)
    folder = next((f for f in folders if os.path.isdir(f)), None)
    if folder is None:
        places = " or ".join(dict.fromkeys(str(f) for f in folders))
        raise InputError(
            f"[model] from: there is no folder {places}. Give the folder that discover compare or "
            "discover close-loop wrote, relative to the study file."
        )
    file = next((folder / name for name in (LOOP, COMPARISON) if (folder / name).is_file()), None)
    state = folder / STATE_FOLDER / STATE_FILE
    begun = state.is_file()
    if begun and (file is None or read_json(state).get("complete") is not True):
        raise InputError(
            f"[model] from: the result in {folder} is not finished. Run its command again, which "
            "goes on where it was."
        )
    if file is None:
        raise InputError(
            f"[model] from: {folder} holds neither {LOOP} nor {COMPARISON}. Give the folder that "
            "discover compare or discover close-loop wrote."
        )
    return file


def read_earlier(written: str, study_file: Path | None) -> EarlierResult:
    """Return what an earlier result found; InputError if it is damaged, or found nothing."""
    file = result_file(written, study_file)
    content = read_json(file)
    if not isinstance(content, dict):
        raise InputError(f"[model] from: {file} is not a result of discover. {_AGAIN}")
    if content.get("verdict") == "no_signal":
        raise InputError(
            f"[model] from: the data behind {file} hold no signal, so it found nothing that "
            "could be taken. Declare the law with law and its constants."
        )
    return _found(content, file)


def _found(content: Mapping[str, Any], file: Path) -> EarlierResult:
    """Return the declared law and effects of a loop or a comparison, and what either added."""
    task, found, of_added, of_constants = "loop", content, "stages", "declared_parameters"
    if file.name == COMPARISON:
        task, of_added, of_constants = "comparison", "effects", "constants"
        found = content.get("posterior")
    declared = content.get("declared", "")
    added = found.get(of_added) if isinstance(found, Mapping) else None
    if found is None or not isinstance(declared, dict | None) or not isinstance(added, list):
        raise InputError(
            f"[model] from: {file} does not say what its {task} started from. {_AGAIN}"
        )
    if declared is None:
        raise InputError(
            f"[model] from: the {task} of {file} found a material that does not relax, so there is "
            f"no law to go on from. Its constants stand under use in {file.name}."
        )
    if declared.get("law") is None:
        differing = ", ".join(map(str, declared.get("by_mode") or ()))
        why = f"has {differing} by mode" if differing else "is no sum of library terms"
        raise InputError(
            f"[model] from: the law that the {task} of {file} started from {why} and has no name, "
            "so it cannot be taken from a file. Declare it with law and its constants."
        )
    unexplained = content.get("verdict") == "unexplained"
    equation = equation_from_json(declared["law"], f"{file.name}: declared.law")
    with _damage(file):
        rows = [*declared.get("effects", ()), *added]
    # what was declared may be more than Maxwell's law
    if unexplained and not (rows or equation.terms or equation.named):
        raise InputError(
            f"[model] from: the {task} of {file} did not explain its data and added no effect, so "
            "there is nothing to take. Declare the law with law and its constants."
        )
    effects, of_modes = _effects(rows, file, len(equation.modulus))
    text = _text(file, f"the {task}'s declared law", equation, effects, of_modes)
    doubt = f" With them the {task} did not explain its data." if unexplained else ""
    of_law = {"effect": "", "parameters": found.get(of_constants, {})}
    return EarlierResult(
        file, equation, effects, of_modes, text, _intervals([of_law, *rows], file), doubt
    )


def _effects(
    rows: Any, file: Path, n_modes: int
) -> tuple[tuple[KnownEffect, ...], tuple[tuple[KnownEffect, ...], ...]]:
    """Return the effects, and those whose constants differ from mode to mode."""
    written: dict[str, dict[str, float]] = {}
    of_modes: dict[str, list[dict[str, float]]] = {}
    with _damage(file):
        for row in rows:
            name, parameters = str(row["effect"]), row["parameters"]
            values = {key: float(p["value"]) for key, p in parameters.items()}
            differing = {
                key: [float(mode["value"]) for mode in p["modes"]]
                for key, p in parameters.items()
                if p.get("degree")
            }
            if not differing:
                written[name] = values
                continue
            if any(len(column) != n_modes for column in differing.values()):
                raise ValueError("constants of other modes")
            of_modes[name] = [
                values | {key: column[number] for key, column in differing.items()}
                for number in range(n_modes)
            ]
    where = f"[model] from: {file.name}"
    each = ((known_effects({name: one}, where)[0] for one in of) for name, of in of_modes.items())
    return known_effects(written, where), tuple(tuple(of) for of in each)


def _intervals(rows: Any, file: Path) -> dict[tuple[str, str], tuple[float, float]]:
    found = {}
    with _damage(file):
        for row in rows:
            for name, constant in row["parameters"].items():
                if constant.get("ci95") is not None and not constant.get("degree"):
                    low, high = constant["ci95"]
                    found[str(row["effect"]), str(name)] = float(low), float(high)
    return found


@contextmanager
def _damage(file: Path) -> Iterator[None]:
    """Say of what cannot be read here that the file is damaged."""
    try:
        yield
    except (TypeError, KeyError, ValueError, AttributeError):  # an InputError is a ValueError
        raise InputError(
            f"[model] from: {file.name} is damaged where it says which effects were found. {_AGAIN}"
        ) from None


def _text(
    file: Path, law: str, equation: Equation, effects: tuple[KnownEffect, ...],
    of_modes: tuple[tuple[KnownEffect, ...], ...],
) -> str:  # fmt: skip
    n, modes = len(equation.terms), len(equation.modulus)
    named = equation.named
    below = "the Maxwell part"
    if named is not None:
        below = LAWS[named.law].described(named.constants[0])
        if named.differing:
            below = f"{LAWS[named.law].title}, {', '.join(named.differing)} by mode"
    terms = f"{counted(n, 'term')} added to {below}" if n else below
    terms = terms if n or named else "upper-convected Maxwell"
    text = f"Taken from {file.parent.name}: {law} ({terms}) with "
    text += counted(modes, "relaxation mode")
    times = equation.relaxation_time
    for of in of_modes:
        ends = (
            f"{of[k].text} at {times[k]:.3g} s"
            for k in (int(np.argmin(times)), int(np.argmax(times)))
        )
        text += f", in each mode its own {' to '.join(ends)}"
    if effects:
        text += f", and {', '.join(known.text for known in effects)}"
    return f"{text}."
