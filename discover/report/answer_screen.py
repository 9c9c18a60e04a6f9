"""The first screen of a page: the answer as rows of a template."""

from collections.abc import Mapping
from typing import Any

from discover.answer import Answer
from discover.answer.sentences import SYMBOLS, description, expected, further, law, where
from discover.equations import Equation
from discover.equations.files import FORMATS
from discover.equations.spelling.markup import law_element
from discover.errors import InputError
from discover.plain_json import json_text
from discover.report.mathtext import formula
from discover.words import significant

_COPIED = {"rheoTool": "rheotool", "Python": "python", "LaTeX": "latex"}
"""Buttons, with the formats that they copy; JSON is that of the answer."""


def answer_screen(answer: Answer | None) -> dict[str, Any] | None:
    """Return what the template ``answer.html`` shows; None shows nothing."""
    if answer is None:
        return None
    found: dict[str, Any] = {
        "headline": law(answer),
        "quality": " ".join(filter(None, [description(answer), where(answer)])),
        "open": not answer.title or answer.adequate is False,
        "law": "", "constants": (), "expected": (), "modes": (), "solvent": "", "copies": (),
        "lines": further(answer),
        "next_test": answer.next_test,
    }  # fmt: skip
    if not answer.title:
        return found
    rows = [(symbol, answer.expected(name)) for name, symbol in SYMBOLS.items()]
    return found | {
        "law": _typeset(answer),
        "constants": answer.constants,
        "expected": [
            {
                "symbol": symbol,
                "inside": expected(one, "inside"),
                "beyond": expected(one, "beyond"),
                "known": one.is_known,
                "note": one.note,
            }
            for symbol, one in rows
        ],
        "modes": [
            (significant(mode.modulus_Pa), significant(mode.relaxation_time_s))
            for mode in answer.modes
        ],
        "solvent": significant(viscosity) if (viscosity := answer.solvent_viscosity_Pa_s) else "",
        "copies": _copies(answer),
    }


def _typeset(answer: Answer) -> str:
    if answer.equation is not None:
        return _law(answer.equation)
    written = answer.written.get("formula")
    return f'<p class="scroll">{formula(written, "answer")}</p>' if written else ""


def _law(equation: Equation) -> str:
    """Return the law typeset, in Pa and s where its modes have units; empty where it has none."""
    if equation.states:
        return ""
    plain = (equation.modulus, equation.relaxation_time) == ((1.0,), (1.0,))
    modes = 0 if plain else len(equation.modulus)
    solvent = equation.solvent_viscosity > 0.0
    try:
        return law_element(
            equation.terms, equation.linear_relaxation, equation.named, modes, solvent
        )
    except InputError:  # nobody said how a law of their own is written
        return ""


def _copies(answer: Answer) -> list[Mapping[str, str]]:
    """Return the law in every format that a button copies, or why it is not there."""
    found = []
    for name, form in _COPIED.items():
        text, reason = answer.written.get(form, ""), "This law cannot be written in this format."
        if answer.equation is not None:
            try:
                text = FORMATS[form](answer.equation)
            except InputError as error:
                reason = str(error)
        found.append({"name": name, "text": text, "reason": reason})
    return [*found, {"name": "JSON", "text": json_text(answer.to_json()), "reason": ""}]
