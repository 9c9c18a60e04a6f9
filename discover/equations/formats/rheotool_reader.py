"""rheoTool's ``constant/constitutiveProperties`` read back, where this package has the law."""

import math
import re
from collections.abc import Callable
from typing import Any

from discover.equations.equation import Equation
from discover.equations.formats.rheotool import OF_NAME, extension_factor, unit_of
from discover.equations.parts import NamedPart, law_parts
from discover.errors import InputError

_COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.S)
_TOKEN = re.compile(r"[{}()\[\];]|[^\s{}()\[\];]+")
_DEEPEST = 20


def read_rheotool(text: str) -> Equation:
    """Return the law of a ``constitutiveProperties`` dictionary; macros and code are not run.

    Raises InputError if the text is no such dictionary, or its law is not one that `rheotool_text`
    writes.
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
    laws, constants, moduli, times, solvents = zip(*map(_mode, modes), strict=True)
    if len(set(laws)) > 1:
        raise InputError("The modes have different laws; this package takes one law for all.")
    named, terms = NamedPart(laws[0], constants), ()
    if not named.differing:
        # what is a sum of terms is written as one
        named, found = law_parts(named.built())
        terms = tuple(t for t in found if t.coefficient and t.inner.get("epsilon") != 0.0)
    return Equation(
        terms, moduli, times, solvent_viscosity=sum(solvents),
        title="rheoTool constitutiveProperties", named=named,
    )  # fmt: skip


def _mode(entries: dict[str, Any]) -> tuple[str, dict[str, float], float, float, float]:
    """Return law, constants, modulus, relaxation time and solvent viscosity of a mode."""
    kind = " ".join(_words(entries, "type"))
    limit = _number(entries, "L2") if kind == "FENE-P" else None
    if limit is not None and limit <= 3.0:
        raise InputError(f"L2 must be larger than 3; got {limit:g}.")
    viscosity, time = _number(entries, "etaP"), _number(entries, "lambda")
    time = time / extension_factor(limit)
    if viscosity <= 0 or time <= 0:
        raise InputError("etaP and lambda must be positive.")
    modulus = viscosity / time

    def value(name: str) -> float:
        # without the last digits, so that what was the same in all modes still is
        return float(f"{_number(entries, name) / unit_of(name, modulus, time):.14g}")

    found: tuple[str, dict[str, float]] | None
    if kind == "Oldroyd-B":
        found = "ucm", {}
    elif kind == "Giesekus":
        found = "giesekus", {"alpha": value("alpha")}
    elif kind == "PTT":
        found = _ptt_read(entries)
    elif limit is not None:
        found = "fene_p", {"L2": limit}
    else:
        found = _law_of_type(kind, value)
    if found is None:
        raise InputError(
            f"The type {kind[:60]!r} is not one of Oldroyd-B, Giesekus, PTT, FENE-P, Rolie-Poly, "
            "XPomPom, WhiteMetznerCY, Saramito, multiMode."
        )
    law, constants = found
    return law, constants, modulus, time, _number(entries, "etaS")


def _ptt_read(entries: dict[str, Any]) -> tuple[str, dict[str, float]]:
    function = " ".join(_words(entries, "destructionFunctionType"))
    if function not in ("linear", "exponential"):
        raise InputError(f"destructionFunctionType {function[:60]!r} is not linear or exponential.")
    constants = {"epsilon": _number(entries, "epsilon"), "xi": _number(entries, "zeta")}
    return f"ptt_{function}_non_affine", constants


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


def _law_of_type(kind: str, value: Callable[[str], float]) -> tuple[str, dict[str, float]] | None:
    """Return the law with a name that a type of rheoTool's is, with its constants.

    `value`: returns an entry, times over the relaxation time and stresses over the modulus. Raises
    InputError if an entry that is fixed here has another value.
    """
    for law, (name, renamed, fixed, _) in OF_NAME.items():
        if name != kind or (law == "rolie_poly" and value("chiMax") > 1.0):
            continue
        for key, wanted in fixed.items():
            if key != "chiMax" and abs(value(key) - wanted) > 1e-9:
                raise InputError(
                    f"{key} of {kind} must be {wanted:g} (times over the relaxation time); got "
                    f"{value(key):g}, which is another law than {law}."
                )
        constants = {}
        for ours, theirs in renamed.items():
            if theirs in fixed:
                continue
            values = {value(key) for key in theirs.split()}
            if max(values) - min(values) > 1e-9 * abs(max(values)):
                raise InputError(f"{theirs.replace(' ', ' and ')} of {kind} must be the same.")
            constants[ours] = values.pop()
        return law, constants
    return None
