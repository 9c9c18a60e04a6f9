"""rheoTool's ``constitutiveProperties`` as an equation: simulate here what a case ran with."""

import math
import re
from typing import Any

from discover.equations.equation import Equation
from discover.equations.from_law import EXPONENTIAL
from discover.equations.rheotool import extension_factor
from discover.equations.term import EquationTerm
from discover.errors import InputError
from discover.laws.fene_p import fene_p_terms

_COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.S)
_TOKEN = re.compile(r"[{}()\[\];]|[^\s{}()\[\];]+")
_DEEPEST = 20


def read_rheotool(text: str) -> Equation:
    """Return the law of a ``constitutiveProperties`` dictionary.

    Parameters
    ----------
    text
        The file. Of macros, includes and code streams nothing is carried out.

    Raises
    ------
    InputError
        If the text is no such dictionary, or its law is not one that `rheotool_text` writes.
    """
    tokens = _TOKEN.findall(_COMMENT.sub(" ", text))
    content, _ = _dictionary(tokens, 0, 0)
    parameters = content.get("parameters")
    if not isinstance(parameters, dict):
        raise InputError("A constitutiveProperties file needs a dictionary parameters { ... }.")
    if parameters.get("type") == ["multiMode"]:
        models = parameters.get("models")
        modes = list(models.values()) if isinstance(models, dict) else []
        if not modes or not all(isinstance(mode, dict) for mode in modes):
            raise InputError("multiMode needs models ( NAME { ... } ... );.")
    else:
        modes = [parameters]
    read = [_mode(mode) for mode in modes]
    terms = read[0][0]
    if any(other != terms for other, *_ in read):
        raise InputError("The modes have different laws; this package takes one law for all.")
    return Equation(
        terms,
        tuple(modulus for _, modulus, _, _ in read),
        tuple(time for _, _, time, _ in read),
        solvent_viscosity=sum(solvent for *_, solvent in read),
        title="rheoTool constitutiveProperties",
    )


def _mode(entries: dict[str, Any]) -> tuple[tuple[EquationTerm, ...], float, float, float]:
    kind = " ".join(_words(entries, "type"))
    limit = _number(entries, "L2") if kind == "FENE-P" else None
    if limit is not None and limit <= 3.0:
        raise InputError(f"L2 must be larger than 3; got {limit:g}.")
    viscosity, time = _number(entries, "etaP"), _number(entries, "lambda")
    time = time / extension_factor(limit)
    if viscosity <= 0 or time <= 0:
        raise InputError("etaP and lambda must be positive.")
    terms: tuple[EquationTerm, ...]
    if kind == "Oldroyd-B":
        terms = ()
    elif kind == "Giesekus":
        terms = (EquationTerm("sigma.sigma", _number(entries, "alpha")),)
    elif kind == "PTT":
        terms = _ptt(entries)
    elif limit is not None:
        terms = tuple(EquationTerm(*share) for share in fene_p_terms(1.0 / limit))
    else:
        raise InputError(
            f"The type {kind[:60]!r} is not one of Oldroyd-B, Giesekus, PTT, FENE-P, multiMode."
        )
    return terms, viscosity / time, time, _number(entries, "etaS")


def _ptt(entries: dict[str, Any]) -> tuple[EquationTerm, ...]:
    epsilon, zeta = _number(entries, "epsilon"), _number(entries, "zeta")
    function = " ".join(_words(entries, "destructionFunctionType"))
    if function not in ("linear", "exponential"):
        raise InputError(f"destructionFunctionType {function[:60]!r} is not linear or exponential.")
    terms = []
    if epsilon and function == "linear":
        terms.append(EquationTerm("tr(sigma)*sigma", epsilon))
    elif epsilon:
        terms.append(EquationTerm(EXPONENTIAL, 1.0, {"epsilon": epsilon}))
    if zeta:
        terms.append(EquationTerm("sigma.gammadot+gammadot.sigma", 0.5 * zeta))
    return tuple(terms)


def _words(entries: dict[str, Any], key: str) -> list[str]:
    value = entries.get(key)
    if not isinstance(value, list) or not value:
        raise InputError(f"The entry {key!r} is missing.")
    return value


def _number(entries: dict[str, Any], key: str) -> float:
    last = _words(entries, key)[-1]
    try:
        value = float(last)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"The entry {key!r} must end in a number; got {last[:60]!r}.")
    return value


def _dictionary(tokens: list[str], at: int, depth: int) -> tuple[dict[str, Any], int]:
    """Return entries up to the closing bracket; values are lists of words, or dictionaries."""
    if depth > _DEEPEST:
        raise InputError("The dictionary is nested too deeply to be constitutiveProperties.")
    content: dict[str, Any] = {}
    words: list[str] = []
    while at < len(tokens):
        token = tokens[at]
        at += 1
        if token in "{(":
            inner, at = _dictionary(tokens, at, depth + 1)
            content[words[0] if words else ""] = inner
            words = []
        elif token in "})":
            return content, at
        elif token == ";":
            if words:
                content[words[0]] = words[1:]
            words = []
        else:
            words.append(token)
    if depth:
        raise InputError("A bracket of the dictionary is never closed.")
    return content, at
