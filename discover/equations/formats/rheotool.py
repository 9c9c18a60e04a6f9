"""Laws as rheoTool's ``constant/constitutiveProperties``, where rheoTool knows the law.

Names and equations are those of rheoTool's library ``constitutiveEquations``, tree ``of90``
[Pimenta & Alves 2017, JNNFM 239, 85; github.com/fppimenta/rheoTool]: ``Oldroyd-B``, ``Giesekus``
(``alpha``), ``PTT`` (``epsilon``, ``zeta``, ``destructionFunctionType`` linear or exponential),
``FENE-P`` (``L2``), ``Rolie-Poly``, ``XPomPom``, ``WhiteMetznerCY``, ``Saramito``, and
``multiMode`` over them, each mode with constants of its own. Its PTT carries the slip parameter ζ
of Johnson & Segalman, ½ζ(τ·γ̇ + γ̇·τ), so that law is PTT with ε = 0.

rheoTool's FENE-P relaxes the conformation by (f A − a I)/λ with a = L²/(L² − 3); in the stress
form of this package that is a relaxation time λ/a at the same zero-shear viscosity.
"""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from discover.equations.equation import Equation
from discover.equations.formats.latex_file import header_lines
from discover.equations.parts import EXPONENTIAL, NamedPart, combined, law_parts
from discover.errors import InputError
from discover.laws.textbook.classical import fene_p_terms
from tensor_library.terms import parse_term

TOLERANCE = 0.01
"""Relative deviation from a form that rheoTool has which is passed over, with a word."""

_SLIP = "sigma.gammadot+gammadot.sigma"
_LINEAR = "tr(sigma)*sigma"
_PLAIN, _STRESS, _TIME = "[0 0 0 0 0 0 0]", "[1 -1 -2 0 0 0 0]", "[0 0 1 0 0 0 0]"
_TIMES = ("lambda", "lambdaB", "lambdaS", "lambdaD", "lambdaR", "K", "L")
_DIMENSIONS = {
    "rho": "[1 -3 0 0 0 0 0]",
    "etaS": "[1 -1 -1 0 0 0 0]",
    "etaP": "[1 -1 -1 0 0 0 0]",
    "tau0": _STRESS,
    **dict.fromkeys(_TIMES, _TIME),
}


@dataclass(frozen=True)
class RheoToolModel:
    """A law in rheoTool's words.

    `parameters`: parameters by rheoTool's name, times over the relaxation time and stresses over
        the modulus.
    `drive`, `relax`: factors on modulus and relaxation rate that the terms ``gammadot`` and
        ``sigma`` amount to.
    """

    type: str  # entry ``type``
    options: dict[str, str]  # entries that are words
    parameters: dict[str, float]
    drive: float = 1.0
    relax: float = 1.0
    notes: tuple[str, ...] = ()  # what was passed over


_ROLIE_POLY = {"stretch_time_ratio": "lambdaR", "beta": "beta", "maximum_stretch": "chiMax"}
_OF_NAME: Mapping[str, tuple[str, Mapping[str, str], Mapping[str, float], Mapping[str, str]]] = {
    # rheoTool's δ is the power of Λ²; up to 1, a greatest stretch is none
    "rolie_poly": ("Rolie-Poly", _ROLIE_POLY, {"lambdaD": 1.0, "delta": -0.5, "chiMax": 0.0}, {}),
    "rolie_poly_fene": ("Rolie-Poly", _ROLIE_POLY, {"lambdaD": 1.0, "delta": -0.5}, {}),
    "xpp": (
        "XPomPom",
        {"stretch_time_ratio": "lambdaS", "alpha": "alpha", "q": "q"},
        {"lambdaB": 1.0, "n": 0.0},
        {},
    ),
    # viscosity and time fall alike (Carreau's a = b = 2), so that the modulus is constant
    "white_metzner": ("WhiteMetznerCY", {"k": "K L", "n": "n m"}, {"a": 2.0, "b": 2.0}, {}),
    "saramito": (
        "Saramito",
        {"yield_strain": "tau0"},
        {"epsilon": 0.0, "zeta": 0.0, "n": 1.0},
        # the deviator is that of three dimensions
        {"dims": "(1 1 1)", "PTTfunction": "none"},
    ),
}
"""By law: rheoTool's type, its names of our constants, what is fixed, and what is a word."""


def rheotool_law(kind: str, value: Callable[[str], float]) -> tuple[str, dict[str, float]] | None:
    """Return the law with a name that a type of rheoTool's is, with its constants.

    `value`: returns an entry, times over the relaxation time and stresses over the modulus. Raises
    InputError if an entry that is fixed here has another value.
    """
    for law, (name, renamed, fixed, _) in _OF_NAME.items():
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


def rheotool_model(equation: Equation, tolerance: float = TOLERANCE) -> RheoToolModel:
    """Return the law in rheoTool's words.

    Terms ``sigma`` and ``gammadot`` are another relaxation time and modulus, and are written so.

    `tolerance`: relative deviation from a form of rheoTool's that is passed over. Raises InputError
    if rheoTool has no such law; says which term is in the way.
    """
    if equation.named is not None:
        below = equation.named.built().as_terms()
        if below is None:
            return _of_name(equation)
        equation = replace(equation, named=None, terms=combined(below + equation.terms))
    coefficients: dict[str, float] = {}
    inner: dict[str, float] = {}
    for term in equation.terms:
        if term.inner and term.term in coefficients:
            raise _unknown([term.term], "it stands there twice with different inner parameters")
        coefficients[term.term] = coefficients.get(term.term, 0.0) + term.coefficient
        inner.update(term.inner)
    relax = coefficients.pop("sigma", 0.0) + (1.0 if equation.linear_relaxation else 0.0)
    drive = 1.0 - coefficients.pop("gammadot", 0.0)
    if relax <= 0 or drive <= 0:
        raise InputError(
            "rheoTool's laws relax to rest and have a positive viscosity; this law has not "
            f"(relaxation {relax:.3g}, modulus {drive:.3g}, both relative). Use --format python."
        )
    found = {
        name: value * drive ** (_order(name, "sigma") - 1) * relax ** (_order(name, "gammadot") - 1)
        for name, value in coefficients.items()
        if value != 0.0
    }
    names = set(found)
    if not names:
        return RheoToolModel("Oldroyd-B", {}, {}, drive, relax)
    if names == {"sigma.sigma"}:
        alpha = _within(found["sigma.sigma"], 0.0, 1.0, "sigma.sigma", "the mobility alpha")
        return RheoToolModel("Giesekus", {}, {"alpha": alpha}, drive, relax)
    if names <= {_SLIP, _LINEAR}:
        return _ptt("linear", found.get(_LINEAR, 0.0), found, drive, relax)
    if EXPONENTIAL in names and names <= {_SLIP, EXPONENTIAL}:
        factor = found[EXPONENTIAL]
        if abs(factor - 1.0) > tolerance:
            raise _unknown(
                [EXPONENTIAL],
                f"its coefficient over the relaxation rate is {factor:.4g}, and rheoTool's "
                f"exponential PTT has 1 (tolerance {tolerance:g})",
            )
        notes = () if factor == 1.0 else (f"The factor {factor:.6g} was taken as 1.",)
        model = _ptt("exponential", inner["epsilon"] * drive, found, drive, relax)
        return RheoToolModel(model.type, model.options, model.parameters, drive, relax, notes)
    pattern = _finitely_extensible(found, tolerance)
    if pattern is not None:
        limit, exact = pattern
        notes = () if exact else (f"Six terms were taken as those of L2 = {limit:.6g}.",)
        return RheoToolModel("FENE-P", {}, {"L2": limit}, drive, relax, notes)
    known = {"sigma.sigma", _SLIP, _LINEAR, EXPONENTIAL}
    culprits = sorted(names - known) or sorted(names)
    why = "no law of rheoTool has it" if len(culprits) == 1 else "no law of rheoTool has these"
    raise _unknown(culprits, why if names - known else "no law of rheoTool has these together")


def rheotool_text(
    equation: Equation, density_kg_m3: float = 1000.0, tolerance: float = TOLERANCE
) -> str:
    """Return the file ``constant/constitutiveProperties``.

    `density_kg_m3`: rheoTool's solvers want a density; shear rheometry does not measure it.
    """
    if equation.states:
        raise InputError(
            f"{', '.join(part.effect for part in equation.states)} gives the whole fluid a state: "
            "rheoTool has it not. Write --format python or --format ufl, which have its equation."
        )
    models = [rheotool_model(equation.mode(k), tolerance) for k in range(len(equation.modulus))]
    lines = [f"// {line}" for line in ("Written by discover.", *header_lines(equation))]
    lines += [f"// {note}" for note in dict.fromkeys(n for model in models for n in model.notes)]
    lines.append(f"// Nobody measured the density, {density_kg_m3:g} kg/m3: set it to the fluid's.")
    lines += ["FoamFile", "{", "    version     2.0;", "    format      ascii;"]
    lines += ["    class       dictionary;", "    object      constitutiveProperties;", "}", ""]
    lines += ["parameters", "{"]
    modes = list(zip(equation.modulus, equation.relaxation_time, strict=True))
    single = len(modes) == 1
    if not single:
        lines += ["    type             multiMode;", "", "    models", "    ("]
    for k, ((g, time), model) in enumerate(zip(modes, models, strict=True)):
        # rheoTool adds the solvents of the modes up
        solvent = equation.solvent_viscosity if k == 0 else 0.0
        entries = _entries(model, g, time, solvent, density_kg_m3)
        if single:
            lines += [f"    {line}" for line in entries]
        else:
            lines += [f"        M{k + 1}", "        {"]
            lines += [f"            {line}" for line in entries]
            lines += ["        }"]
    if not single:
        lines.append("    );")
    lines += ["}", "", "passiveScalarProperties", "{", "    solvePassiveScalar no;"]
    lines += ["    D                D [0 2 -1 0 0 0 0] 1e-9;", "}", ""]
    return "\n".join(lines)


def _entries(model: RheoToolModel, g: float, time: float, solvent: float, density: float):
    modulus, relaxation_time = g * model.drive, time / model.relax
    values: dict[str, Any] = {
        "rho": density,
        "etaS": solvent,
        "etaP": modulus * relaxation_time,
        "lambda": relaxation_time * extension_factor(model.parameters.get("L2")),
    }
    yield f"{'type':<17}{model.type};"
    for name, value in model.parameters.items():
        values[name] = value * unit_of(name, modulus, relaxation_time)
    for name, value in values.items():
        dimensions = _DIMENSIONS.get(name, _PLAIN)
        yield f"{name:<17}{name} {dimensions} {float(value)!r};"
    for name, word in model.options.items():
        yield f"{name:<24} {word};"
    yield f"{'stabilization':<17}coupling;"


def unit_of(name: str, modulus: float, relaxation_time: float) -> float:
    """Return in what an entry is counted in a mode: its modulus in Pa, its time in s, or 1."""
    units = {_TIME: relaxation_time, _STRESS: modulus}
    return units.get(_DIMENSIONS.get(name, _PLAIN), 1.0)


def extension_factor(limit: float | None) -> float:
    """Return a = L²/(L² − 3), rheoTool's relaxation time over this package's; 1 without L²."""
    return 1.0 if limit is None else limit / (limit - 3.0)


def _of_name(equation: Equation) -> RheoToolModel:
    named = equation.named
    assert named is not None
    if named.law not in _OF_NAME:
        raise _unknown([f"the law {named.law}"], "rheoTool has it not")
    if equation.terms:
        raise _unknown(
            [t.term for t in equation.terms], f"rheoTool cannot add terms to {named.law}"
        )
    kind, renamed, fixed, words = _OF_NAME[named.law]
    parameters = dict(fixed)
    for ours, value in named.constants[0].items():
        parameters |= dict.fromkeys(renamed[ours].split(), value)
    return RheoToolModel(kind, dict(words), parameters)


def _ptt(function: str, epsilon: float, found: dict[str, float], drive: float, relax: float):
    zeta = _within(2.0 * found.get(_SLIP, 0.0), 0.0, 2.0, _SLIP, "the slip parameter zeta")
    term = _LINEAR if function == "linear" else EXPONENTIAL
    epsilon = _within(epsilon, 0.0, float("inf"), term, "epsilon")
    options = {"destructionFunctionType": function}
    return RheoToolModel("PTT", options, {"epsilon": epsilon, "zeta": zeta}, drive, relax)


def _finitely_extensible(found: dict[str, float], tolerance: float) -> tuple[float, bool] | None:
    growth = -found.get("tr(sigma.gammadot)*I", 0.0)
    if growth <= 0.0:
        return None
    inverse = growth / (1.0 + 3.0 * growth)  # k = q/(1 − 3q)
    wanted = {term.term: term.coefficient for term in fene_p_terms(inverse)}
    if set(found) != set(wanted):
        return None
    deviation = max(abs(found[name] / value - 1.0) for name, value in wanted.items())
    return (1.0 / inverse, deviation < 1e-9) if deviation <= tolerance else None


def _order(name: str, tensor: str) -> int:
    """Return how many factors of a tensor a term holds; closed forms count none."""
    term = parse_term(name)
    spelling = name if term.form is None else name.removeprefix(term.form.spelling)
    total = 0
    for factor in spelling.split("*"):
        base, _, power = factor.partition("^")
        one = base.strip("()").split("+")[0]  # the summands of an anticommutator are alike
        total += one.count(tensor) * int(power or 1)
    return total


def _within(value: float, low: float, high: float, term: str, name: str) -> float:
    if low <= value <= high:
        return value
    raise _unknown([term], f"{name} would be {value:.4g}, and must be {low:g} to {high:g}")


def _unknown(terms: list[str], why: str) -> InputError:
    return InputError(
        f"rheoTool cannot take this law because of {', '.join(terms)}: {why}. It knows Oldroyd-B, "
        "Giesekus, PTT (linear and exponential, with slip), FENE-P, Rolie-Poly, XPomPom, "
        "White-Metzner and Saramito. Use --format python, sympy, ufl, latex or json."
    )


_COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.S)
_TOKEN = re.compile(r"[{}()\[\];]|[^\s{}()\[\];]+")
_DEEPEST = 20


def read_rheotool(text: str) -> Equation:
    """Return the law of a ``constitutiveProperties`` dictionary.

    `text`: the file. Of macros, includes and code streams nothing is carried out. Raises InputError
    if the text is no such dictionary, or its law is not one that `rheotool_text` writes.
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
        terms,
        moduli,
        times,
        solvent_viscosity=sum(solvents),
        title="rheoTool constitutiveProperties",
        named=named,
    )


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
        found = rheotool_law(kind, value)
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
