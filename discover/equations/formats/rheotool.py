"""Laws as rheoTool's ``constant/constitutiveProperties``, where rheoTool knows the law.

Of ``constitutiveEquations``, tree ``of90`` [Pimenta & Alves 2017, JNNFM 239, 85]. Its PTT has the
slip ζ of Johnson & Segalman, which is PTT with ε = 0. Its FENE-P relaxes by (f A − a I)/λ with a =
L²/(L² − 3): here a time λ/a at the same viscosity.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from discover.equations.equation import Equation
from discover.equations.parts import EXPONENTIAL, combined
from discover.errors import InputError
from discover.laws.textbook.classical import fene_p_terms
from tensor_library.terms import parse_term

DENSITY = 1000.0
"""Density in kg/m³ where nobody gives one: shear rheometry does not measure it."""

TOLERANCE = 0.01
"""Relative deviation from a form that rheoTool has which is passed over, with a word."""

_SLIP = "sigma.gammadot+gammadot.sigma"
_LINEAR = "tr(sigma)*sigma"
_PLAIN, _STRESS, _TIME = "[0 0 0 0 0 0 0]", "[1 -1 -2 0 0 0 0]", "[0 0 1 0 0 0 0]"
_TIMES = ("lambda", "lambdaB", "lambdaS", "lambdaD", "lambdaR", "K", "L")
_DENSITY, _VISCOSITY = "[1 -3 0 0 0 0 0]", "[1 -1 -1 0 0 0 0]"
QUANTITIES = {
    "density": _DENSITY, "viscosity": _VISCOSITY, "stress": _STRESS, "time": _TIME,
    "number": _PLAIN,
}  # fmt: skip
"""Dimensions as OpenFOAM writes them."""

_DIMENSIONS = {
    "rho": _DENSITY, "etaS": _VISCOSITY, "etaP": _VISCOSITY, "tau0": _STRESS,
    **dict.fromkeys(_TIMES, _TIME),
}  # fmt: skip


@dataclass(frozen=True)
class RheoToolModel:
    """Law in rheoTool's words."""

    type: str  # entry ``type``
    options: dict[str, str]  # entries that are words
    parameters: dict[str, float]  # over time and modulus
    drive: float = 1.0  # factor on the modulus by terms ``gammadot``
    relax: float = 1.0  # factor on the relaxation rate by terms ``sigma``
    notes: tuple[str, ...] = ()  # what was passed over


_ROLIE_POLY = {"stretch_time_ratio": "lambdaR", "beta": "beta", "maximum_stretch": "chiMax"}
OF_NAME: Mapping[str, tuple[str, Mapping[str, str], Mapping[str, float], Mapping[str, str]]] = {
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


def rheotool_model(equation: Equation, tolerance: float = TOLERANCE) -> RheoToolModel:
    """Law in rheoTool's words; InputError, naming the term in the way, if rheoTool has none."""
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
        return replace(model, notes=notes)
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
    equation: Equation, density_kg_m3: float = DENSITY, tolerance: float = TOLERANCE
) -> str:
    """Return the file ``constant/constitutiveProperties``."""
    if equation.states:
        raise InputError(
            f"{', '.join(part.effect for part in equation.states)}: cannot be exported to "
            "rheoTool: it has a structure variable. Write --format python or ufl, which have its "
            "equation."
        )
    models = [rheotool_model(equation.mode(k), tolerance) for k in range(len(equation.modulus))]
    notes = dict.fromkeys(note for model in models for note in model.notes)
    modes = list(zip(equation.modulus, equation.relaxation_time, strict=True))
    lines = []
    for k, ((g, time), model) in enumerate(zip(modes, models, strict=True)):
        # rheoTool adds the solvents of the modes up
        solvent = equation.solvent_viscosity if k == 0 else 0.0
        entries = _entries(model, g, time, solvent, density_kg_m3)
        if len(modes) == 1:
            lines += entries
        else:
            lines += [f"    M{k + 1}", "    {", *(f"        {line}" for line in entries), "    }"]
    if len(modes) > 1:
        lines = ["type             multiMode;", "", "models", "(", *lines, ");"]
    return properties_file([*equation.header, *notes], lines, density_kg_m3)


def viscous_fluid(
    kind: str,
    entries: Mapping[str, tuple[str, float]],
    comments: Sequence[str],
    density_kg_m3: float = DENSITY,
) -> str:
    """File of a `kind` of fluid without elasticity; `entries`: of `QUANTITIES`, and value."""
    density = {"rho": ("density", density_kg_m3)}
    lines = [f"{'type':<17}{kind};"]
    for name, (quantity, value) in (density | dict(entries)).items():
        lines.append(_entry(name, QUANTITIES[quantity], value))
    if kind == "HerschelBulkley":
        lines.append("PapanastasiouRegularization no;")
    return properties_file(comments, lines, density_kg_m3)


def properties_file(comments: Sequence[str], lines: Sequence[str], density_kg_m3: float) -> str:
    """Return ``constitutiveProperties`` with these lines in its dictionary ``parameters``."""
    density = f"Density not given; {density_kg_m3:g} kg/m3 assumed. Replace it."
    if density_kg_m3 != DENSITY:
        density = f"Density {density_kg_m3:g} kg/m3, as given."
    found = [f"// {line}" for line in ("Written by discover.", *comments, density)]
    found += ["FoamFile", "{", "    version     2.0;", "    format      ascii;"]
    found += ["    class       dictionary;", "    object      constitutiveProperties;", "}", ""]
    found += ["parameters", "{", *(f"    {line}" if line else "" for line in lines), "}", ""]
    found += ["passiveScalarProperties", "{", "    solvePassiveScalar no;"]
    found += ["    D                D [0 2 -1 0 0 0 0] 1e-9;", "}", ""]
    return "\n".join(found)


def _entries(model: RheoToolModel, g: float, time: float, solvent: float, density: float):
    modulus, relaxation_time = g * model.drive, time / model.relax
    values: dict[str, Any] = {
        "rho": density,
        "etaS": solvent,
        "etaP": modulus * relaxation_time,
        "lambda": relaxation_time,
    }
    if "L2" in model.parameters:  # rheoTool's relaxation time over this package's
        values["lambda"] *= model.parameters["L2"] / (model.parameters["L2"] - 3.0)
    yield f"{'type':<17}{model.type};"
    units = {_TIME: relaxation_time, _STRESS: modulus}
    for name, value in model.parameters.items():
        values[name] = value * units.get(_DIMENSIONS.get(name, _PLAIN), 1.0)
    for name, value in values.items():
        yield _entry(name, _DIMENSIONS.get(name, _PLAIN), float(value))
    for name, word in model.options.items():
        yield f"{name:<24} {word};"
    yield f"{'stabilization':<17}coupling;"


def _entry(name: str, dimensions: str, value: float) -> str:
    return f"{name:<17}{name} {dimensions} {value!r};"


def _of_name(equation: Equation) -> RheoToolModel:
    named = equation.named
    assert named is not None
    if named.law not in OF_NAME:
        raise _unknown([f"the law {named.law}"], "rheoTool has no such law")
    if equation.terms:
        raise _unknown(
            [t.term for t in equation.terms], f"rheoTool cannot add terms to {named.law}"
        )
    kind, renamed, fixed, words = OF_NAME[named.law]
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
