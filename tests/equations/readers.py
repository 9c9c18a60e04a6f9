"""What a text says, by what would run or read it: Python, UFL's own evaluation, SymPy's LaTeX."""

import functools

import numpy as np
import pytest
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
    """Return what a module defines."""
    module = {}
    exec(text, module)
    return module


def in_ufl(tensor):
    """Return the numbers of a tensor as UFL has them."""
    ufl = pytest.importorskip("ufl")
    return ufl.as_matrix(np.asarray(tensor).tolist())


def ufl_number(expression, place=()):
    """Return a component of an expression of UFL."""
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
    """Return the product of numbers and matrices, in their order."""
    product = parts[0]
    for part in parts[1:]:
        product = product @ part if np.ndim(product) and np.ndim(part) else product * part
    return product


def value(tree, letters):
    """Return the value of a tree of LaTeX, with matrices for the tensors."""
    if tree.is_Symbol:
        return letters[tree.name]
    if tree.is_number:
        return float(tree)
    parts = [value(part, letters) for part in tree.args]
    if tree.is_Add:
        assert len({np.shape(part) for part in parts}) == 1, f"scalar plus tensor in {tree}"
        return sum(parts)
    if tree.is_Mul:
        return product_of(parts)
    if tree.is_Pow:
        assert np.ndim(parts[0]) == np.ndim(parts[1]) == 0, f"power of a tensor in {tree}"
        return parts[0] ** parts[1]
    known = {"exp": np.exp, "Abs": abs, "T": np.trace, "M": max}
    return known[tree.func.__name__](*parts)
