"""A law, its modes and its effects as an earlier result found them."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from discover.effects import KnownEffect, known_effects
from discover.equations import Equation
from discover.equations.json_format import equation_from_json
from discover.equations.read import COMPARISON, LOOP, read_json
from discover.errors import InputError
from discover.laws.registry import LAWS
from discover.study.run_folder import STATE_FILE, STATE_FOLDER

_SPARSE = "tensor_sindy"
_AGAIN = "Run the command that made it again with --overwrite."


@dataclass(frozen=True)
class EarlierResult:
    """What a study takes over from an earlier result.

    Attributes
    ----------
    file
        Where it was read.
    equation
        The law with its modes.
    effects
        Effects beside the law, with their values.
    text
        What was taken, and how far it explained its own data, in words.
    """

    file: Path
    equation: Equation
    effects: tuple[KnownEffect, ...]
    text: str


def result_file(written: str, study_file: Path | None) -> Path:
    """Return the file of an earlier result, ``loop.json`` or ``comparison.json``.

    Parameters
    ----------
    written
        The folder, relative to the study file or, where it is not there, to the working directory.
    study_file
        The study file, if there is one.

    Raises
    ------
    InputError
        If there is no such folder, or it holds no finished result.
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
    """Return what an earlier result found, to be declared.

    Raises
    ------
    InputError
        If there is no finished result, it is damaged, or it found nothing that could be taken.
    """
    file = result_file(written, study_file)
    content = read_json(file)
    if not isinstance(content, dict):
        raise InputError(f"[model] from: {file} is no result of discover. {_AGAIN}")
    if content.get("verdict") == "no_signal":
        raise InputError(
            f"[model] from: the records behind {file} hold no signal, so it found nothing that "
            "could be taken. Declare the law with law and its constants."
        )
    return _of_loop(content, file) if file.name == LOOP else _of_comparison(content, file)


def _of_loop(content: Mapping[str, Any], file: Path) -> EarlierResult:
    declared = content.get("declared")
    if not isinstance(declared, dict) or not isinstance(content.get("stages"), list):
        raise InputError(
            f"[model] from: {file} does not say what its loop started from: it was written by an "
            f"earlier version. {_AGAIN}"
        )
    if declared.get("by_mode"):
        raise InputError(
            f"[model] from: in the loop of {file} {', '.join(map(str, declared['by_mode']))} "
            "differs from one relaxation mode to the next, and from takes laws that are the same "
            "in all. Declare the law in the study, with by_mode, and leave from out."
        )
    if declared.get("law") is None:
        raise InputError(
            f"[model] from: the law that the loop of {file} started from is no sum of library "
            "terms and has no name, so it cannot be taken from a file. Declare it with law and its "
            "constants."
        )
    unexplained = content.get("verdict") == "unexplained"
    if unexplained and not content["stages"]:
        raise InputError(
            f"[model] from: the loop of {file} did not explain its data and added no effect, so "
            "there is nothing to take. Declare the law with law and its constants."
        )
    equation = equation_from_json(declared["law"], f"{file.name}: declared.law")
    effects = _effects([*declared.get("effects", ()), *content["stages"]], file)
    text = _text(file, "the loop's declared law", equation, effects)
    doubt = " With them the loop did not explain its data." if unexplained else ""
    return EarlierResult(file, equation, effects, text + doubt)


def _of_comparison(content: Mapping[str, Any], file: Path) -> EarlierResult:
    learners = content.get("learners")
    sparse = learners.get(_SPARSE) if isinstance(learners, dict) else None
    if not isinstance(sparse, dict) or sparse.get("law") is None:
        raise InputError(
            f"[model] from: {file} holds no law of sparse regression, and a network cannot be "
            'written out. Run the comparison with "tensor_sindy" among [compare] learners.'
        )
    left = content.get("lack_of_fit")
    of_sparse = left.get(_SPARSE) if isinstance(left, dict) else None
    verdict = of_sparse.get("verdict") if isinstance(of_sparse, dict) else None
    equation = equation_from_json(sparse["law"], f"{file.name}: learners.{_SPARSE}.law")
    effects = _effects(sparse.get("effects", ()), file)
    # without a term the known part is the law, and may be more than Maxwell's
    bare = not (sparse.get("terms") or equation.terms or equation.named or effects)
    if verdict != "explained" and bare:
        raise InputError(
            f"[model] from: sparse regression found no term in {file} and its law does not explain "
            "the data, so there is nothing to take. Declare the law with law and its constants."
        )
    text = _text(file, "the law of sparse regression", equation, effects)
    doubt = "" if verdict == "explained" else " It did not explain the data that it was found in."
    return EarlierResult(file, equation, effects, text + doubt)


def _effects(rows: Any, file: Path) -> tuple[KnownEffect, ...]:
    written = {}
    try:
        for row in rows:
            values = {name: float(p["value"]) for name, p in row["parameters"].items()}
            written[str(row["effect"])] = values
    except (TypeError, KeyError, ValueError, AttributeError):
        raise InputError(
            f"[model] from: {file.name} is damaged where it says which effects were found. {_AGAIN}"
        ) from None
    return known_effects(written, f"[model] from: {file.name}")


def _text(file: Path, law: str, equation: Equation, effects: tuple[KnownEffect, ...]) -> str:
    n, modes = len(equation.terms), len(equation.modulus)
    named = equation.named
    below = "the Maxwell part"
    if named is not None:
        below = LAWS[named.law].described(named.constants[0])
    terms = f"{n} term{'s' if n != 1 else ''} beside {below}" if n else below
    terms = terms if n or named else "upper convected Maxwell"
    text = f"Taken from {file.parent.name}: {law} ({terms}) with {modes} relaxation mode"
    text += "s" if modes != 1 else ""
    if effects:
        text += f", and {', '.join(known.text for known in effects)}"
    return f"{text}."
