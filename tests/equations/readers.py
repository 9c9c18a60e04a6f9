"""What a text says, by what would run it: Python, UFL's evaluation, SymPy's LaTeX, rheoTool."""

import functools
import json
import re

import numpy as np
import pytest
import sympy
from independent import (
    ExtendedPomPom,
    FenePeterlin,
    Giesekus,
    PhanThienTanner,
    UpperConvectedMaxwell,
)
from independent.named import material
from scipy.integrate import solve_ivp
from sympy.parsing.latex import parse_latex

# what SymPy's reader of LaTeX knows: letters and functions of one letter; \left and \right only
# size a bracket
_WORDS = (
    (r"\dot{\boldsymbol{\gamma}}", r"\gamma"), (r"\boldsymbol{\sigma}", r"\sigma"),
    (r"\boldsymbol{I}", "I"), (r"\operatorname{tr}", "T"), (r"\max", "M"),
    (r"\left|\sigma_\mathrm{d}\right|", "D"), (r"\Lambda_\mathrm{m}", r"\Omega"),
    ("L^{2}", "N"), ("_{k}", ""), (r"\left", ""), (r"\right", ""),
    (r" \, ", r" \cdot "),
)  # fmt: skip


def module_of(text):
    module = {}
    exec(text, module)
    return module


def sum_of_spelled(terms, stress, rate):
    """Return the sum of terms (spelling, coefficient, inner), with the precedence of Python."""
    names = {"sigma": stress, "gammadot": rate, "I": np.eye(3)}
    names |= {"tr": np.trace, "exp": np.exp, "abs": abs}
    total = np.zeros((3, 3))
    for spelling, coefficient, inner in terms:
        text = spelling.replace(".", " @ ").replace("^", "**")
        total = total + coefficient * eval(text, names | dict(inner))
    return total


def in_ufl(tensor):
    ufl = pytest.importorskip("ufl")
    return ufl.as_matrix(np.asarray(tensor).tolist())


def ufl_number(expression, place=()):
    pytest.importorskip("ufl")
    from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering
    from ufl.utils.stacks import StackDict

    return float(apply_algebra_lowering(expression).evaluate((), {}, place, StackDict()))


@functools.cache
def read_latex(text):
    """Return the tree that SymPy reads; the arguments of its products stand as written."""
    for old, new in _WORDS:
        text = text.replace(old, new)
    return parse_latex(text, strict=True)


def product_of(parts):
    product = parts[0]
    for part in parts[1:]:
        product = product @ part if np.ndim(product) and np.ndim(part) else product * part
    return product


def value(tree, letters, of_tensors=False):
    """Return the value of a tree of SymPy, with matrices for the tensors.

    `of_tensors`: whether its powers may be of tensors, as in expressions, and not in LaTeX.
    """
    if tree.is_Symbol:
        return letters[tree.name]
    if tree.is_number:
        return float(tree)
    parts = [value(part, letters, of_tensors) for part in tree.args]
    if tree.is_Add:
        assert len({np.shape(part) for part in parts}) == 1, f"scalar plus tensor in {tree}"
        return sum(parts)
    if tree.is_Mul:
        return product_of(parts)
    if tree.is_Pow and of_tensors and np.ndim(parts[0]):
        return np.linalg.matrix_power(parts[0], int(parts[1]))
    if tree.is_Pow:
        assert np.ndim(parts[0]) == np.ndim(parts[1]) == 0, f"power of a tensor in {tree}"
        return parts[0] ** parts[1]
    known = {"exp": np.exp, "Abs": abs, "T": np.trace, "Trace": np.trace, "M": max}
    return known[tree.func.__name__](*parts)


def followed(rate, start, gradient, times, rtol=1e-8, atol=1e-8):
    """Return the states at the times of state' = rate(state, gradient), by scipy."""
    shape = np.shape(start)
    found = solve_ivp(
        lambda t, y: np.ravel(rate(y.reshape(shape), gradient)),
        (0, times[-1]), np.ravel(start), "LSODA", times, rtol=rtol, atol=atol,
    )  # fmt: skip
    return found.y.T.reshape(-1, *shape)


def shear_quantities(stress):
    """Return σ12, N1 and N2 of stresses, shape (3, n)."""
    s = np.asarray(stress)
    return np.array([s[:, 0, 1], s[:, 0, 0] - s[:, 1, 1], s[:, 1, 1] - s[:, 2, 2]])


def states(number=3, seed=1):
    """Return stresses of fluids that flow, I + σ positive definite, and gradients without trace."""
    generator = np.random.default_rng(seed)
    for _ in range(number):
        root = 0.6 * generator.normal(size=(3, 3)) + np.eye(3)
        gradient = generator.normal(size=(3, 3))
        yield root @ root.T - np.eye(3), gradient - np.trace(gradient) / 3.0 * np.eye(3)


# What a text says of one mode: `rates(mode, stress, variables, gradient)`, both in Pa and s.


def by_python(text, variables=0):
    """Return the rates by the functions of the text."""
    module = module_of(text)
    modes = len(module["MODULUS_PA"])

    def rates(k, stress, y, gradient):
        stresses, levels = np.zeros((modes, 3, 3)), np.zeros((modes, variables))
        stresses[k], levels[k] = stress, y
        if not variables:
            return module["stress_rate"](stresses, gradient)[k], y
        asked = stresses, gradient, levels
        return module["stress_rate"](*asked)[k], module["variables_rate"](*asked)[k]

    return rates


def by_sympy(text):
    """Return the rates by the expressions of the text."""
    module = module_of(text)
    symbols = [*module["stress_symbols"], *module["gradient_symbols"], *module.get("variables", ())]
    told = [*module["stress_rate"], *module.get("variables_rate", ())]
    functions = [
        sympy.lambdify(symbols, [one.subs(values) for one in told], "math", cse=True)
        for values in module.get("values", [{}] * len(module["modes"]))
    ]

    def rates(k, stress, y, gradient):
        modulus, time = module["modes"][k]
        s = stress / modulus
        components = (s[0, 0], s[0, 1], s[0, 2], s[1, 1], s[1, 2], s[2, 2])
        found = functions[k](*components, *(time * gradient).ravel(), *y)
        return modulus / time * np.reshape(found[:9], (3, 3)), np.array(found[9:]) / time

    return rates


def by_json(text):
    """Return the rates by the spelling of the terms."""
    content = json.loads(text)
    terms = [(term["term"], term["coefficient"], term["inner"]) for term in content["terms"]]

    def rates(k, stress, y, gradient):
        modulus, time = content["modes"][k].values()
        s, scaled = stress / modulus, time * gradient
        d = scaled + scaled.T
        extra = sum_of_spelled(terms, s, d)
        return modulus / time * (d + scaled @ s + s @ scaled.T - s - extra), y

    return rates


def integrated(rates, gradient, times, modes=2, variables=0, tolerance=1e-8):
    """Return the stress of all modes at the times, from rest, of the rates of each."""
    total = 0.0
    for k in range(modes):
        found = followed(
            lambda y, flow, k=k: np.append(*rates(k, y[:9].reshape(3, 3), y[9:], flow)),
            np.zeros(9 + variables), gradient, times, tolerance, tolerance,
        )  # fmt: skip
        total = total + found[:, :9].reshape(-1, 3, 3)
    return total


def rheotool_law(entries, block):
    """Return the law that rheoTool's sources have for the entries of a mode.

    Of Oldroyd_B.C, Giesekus.C, PTT.C, XPomPom.C, WhiteMetznerCY.C, Saramito.C, RoliePoly.C and
    FENE_P.C, term by term; the last has its springs over those at rest, a, in modulus and time.
    """
    e, kind = entries, entries["type"]
    time = e[{"Rolie-Poly": "lambdaD", "XPomPom": "lambdaB"}.get(kind, "lambda")]
    mode = e["etaP"] / time, time
    match kind:
        case "Oldroyd-B":
            return UpperConvectedMaxwell(*mode)
        case "Giesekus":
            return Giesekus(e["alpha"], *mode)
        case "PTT":
            return PhanThienTanner(e["epsilon"], e["destructionFunctionType"], e["zeta"], *mode)
        case "FENE-P":
            a = e["L2"] / (e["L2"] - 3)
            return FenePeterlin(e["L2"], a * mode[0], time / a)
        case "XPomPom":
            return ExtendedPomPom(e["q"], e["alpha"], e["lambdaS"], *mode)
        case "WhiteMetznerCY":
            assert (e["K"], e["n"], e["a"]) == (e["L"], e["m"], e["b"])
            assert e["a"] == 2.0
            return material("white_metzner", {"k": e["K"] / time, "n": e["n"]}, *mode)
        case "Saramito":
            assert e["PTTfunction"] == "none"
            assert "(1 1 1);" in block
            return material("saramito", {"yield_strain": e["tau0"] / mode[0]}, *mode)
    assert (kind, e["delta"]) == ("Rolie-Poly", -0.5)
    known = {"stretch_time_ratio": e["lambdaR"] / time, "beta": e["beta"]}
    if e["chiMax"] > 1.0:
        return material("rolie_poly_fene", known | {"maximum_stretch": e["chiMax"]}, *mode)
    return material("rolie_poly", known, *mode)


def rheotool_modes(text):
    """Return entries and law of each mode of a ``constitutiveProperties`` dictionary."""
    number, modes = re.compile(r"-?[\d.]+(e-?\d+)?"), []
    blocks = re.findall(r"M\d+\s*\{(.*?)\}", text, re.S)
    for block in blocks or [text[text.index("parameters\n") :]]:
        found = dict(re.findall(r"^\s*(\w+)\s.*?(\S+);$", block, re.M))
        entries = {n: float(v) if number.fullmatch(v) else v for n, v in found.items()}
        modes.append((entries, rheotool_law(entries, block)))
    return modes


def by_rheotool(text, gradient, times):
    """Return the stress of all modes and the solvents at the times, from rest."""
    twice = gradient + gradient.T
    return sum(
        law.held(gradient, times) + entries["etaS"] * twice for entries, law in rheotool_modes(text)
    )
