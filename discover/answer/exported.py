"""A simple material as a folder of results holds it, written as text for other programs."""

from pathlib import Path
from typing import Any

from discover.answer.answer import Answer
from discover.answer.parts import ExpectedError, Range
from discover.answer.simple_material import material_of
from discover.equations.files import read_result
from discover.equations.formats.rheotool import DENSITY
from discover.errors import InputError
from discover.inference.engine.simple_materials import SimpleFit
from discover.plain_numbers import json_text
from discover.words import unknown_name


def simple_material_text(folder: str | Path, form: str, density_kg_m3: float | None) -> str | None:
    """Return a yield-stress fluid, a viscous fluid or a solid as text; None for another law.

    `form`: ``python``, ``latex``, ``rheotool`` or ``json``. Raises InputError if there is no
    result, it is damaged, or the format has no such material.
    """
    content, name = read_result(folder)
    use = content.get("use") if isinstance(content, dict) else None
    if not isinstance(use, dict):
        return None
    try:
        answer, written = _written(use, density_kg_m3 or DENSITY)
    except KeyError as error:
        if error.args == (use.get("law"),):  # no simple material
            return None
        raise InputError(f"{name}: `use` lacks {error}. Run again with --overwrite.") from None
    except (TypeError, ValueError, AttributeError, ArithmeticError):
        raise InputError(f"{name}: `use` is damaged. Run again with --overwrite.") from None
    texts = written | {"json": json_text(use)}
    if form not in texts:
        raise InputError(unknown_name("format", form, texts, f"A {answer.title}"))
    return texts[form]


def _written(use: dict[str, Any], density: float) -> tuple[Answer, dict[str, str]]:
    constants: list[Any] = list(dict(use["constants"]).values())
    values = tuple(float(one["value"]) for one in constants)
    both = ((one["ci95"] or (one["value"],) * 2) for one in constants)
    ends = tuple((float(low), float(high)) for low, high in both)
    material = material_of(SimpleFit(use["law"], values, ends, 0.0, 0.0))
    rates = use["range"]["rate_1_s"]
    found = Range(rate_1_s=None if rates is None else (float(rates[0]), float(rates[1])))
    error = use["expected_error"]["sigma12"]
    expected = {} if error is None else {"sigma12": ExpectedError(float(error))}
    answer = Answer(
        material.title, material.law, material.constants, range=found, expected_error=expected
    )
    slowest = 0.0 if found.rate_1_s is None else found.rate_1_s[0]
    return answer, material.written(answer.lines, slowest, density)
