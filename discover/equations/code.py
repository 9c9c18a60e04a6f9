"""Laws as Python text that needs nothing of this package: with numpy, or with SymPy.

The text is put together from tables and from `repr` of numbers; no name of a file or study reaches
it except in comments. Matrices of numpy and of SymPy share ``@`` and ``trace()``, so that one table
serves both.
"""

from collections.abc import Callable, Sequence
from typing import Any

from discover.equations.equation import Equation
from discover.equations.latex_file import header_lines
from discover.equations.term import EquationTerm
from tensor_library.notation import Notation, printed
from tensor_library.terms import parse_term


class _CodeNotation(Notation[str]):
    """What the numpy text and the SymPy text share."""

    def tensor(self, name: str) -> str:
        return {"I": "unit", "sigma": "s", "gammadot": "d"}[name]

    def contraction(self, tensors: Sequence[str]) -> str:
        return " @ ".join(tensors)

    def sum(self, summands: Sequence[str]) -> str:
        return f"({' + '.join(summands)})"

    def trace(self, tensor: str) -> str:
        return f"{tensor if tensor.isidentifier() else f'({tensor})'}.trace()"

    def power(self, scalar: str, exponent: int) -> str:
        return f"{scalar} ** {exponent}"

    def number(self, value: float) -> str:
        return f"({float(value)!r})" if value < 0 else repr(float(value))

    def letter(self, name: str) -> str:
        raise ValueError(f"Code needs a number for {name}.")  # every EquationTerm has one

    def exponential(self, rate: str, trace: str) -> str:
        # the cap is that of tensor_library.closed_forms: beyond it a law is absurd, not infinite
        return f"np.expm1(min({rate} * {trace}, 60.0))"

    def saturating(self, level: str, trace: str) -> str:
        return f"({trace} / (1 + {level} * abs({trace})))"

    def function(self, expression: Callable[[Any, Any], Any], trace: str, parameter: str) -> str:
        from sympy.printing.numpy import NumPyPrinter

        text, _ = printed(expression, trace, parameter, lambda e: str(NumPyPrinter().doprint(e)))
        return f"({text.replace('numpy.', 'np.')})"

    def product(self, factors: Sequence[str]) -> str:
        return " * ".join(factors)


class _SympyCodeNotation(_CodeNotation):
    def exponential(self, rate: str, trace: str) -> str:
        return f"(sympy.exp({rate} * {trace}) - 1)"

    def saturating(self, level: str, trace: str) -> str:
        return f"({trace} / (1 + {level} * sympy.Abs({trace})))"

    def function(self, expression: Callable[[Any, Any], Any], trace: str, parameter: str) -> str:
        from sympy.printing.pycode import SymPyPrinter

        text, _ = printed(expression, trace, parameter, lambda e: str(SymPyPrinter().doprint(e)))
        return f"({text})"


_NUMPY_TEMPLATE = '''"""Constitutive law, written by discover. Needs numpy only.

{header}

For every mode k, with s = stress_k / G_k, L = lambda_k * velocity_gradient and d = L + L^T,

    lambda_k / G_k * d(stress_k)/dt = d + L s + s L^T{relaxation} - h(s, d)

velocity_gradient[i, j] is the derivative of v_i by x_j; simple shear has only [0, 1] = rate.
N1 = stress[0, 0] - stress[1, 1], N2 = stress[1, 1] - stress[2, 2].
"""

import numpy as np

MODULUS_PA = np.array({modulus})
RELAXATION_TIME_S = np.array({time})
SOLVENT_VISCOSITY_PA_S = {solvent}
TESTED = {tested}


def extra_term(s, d):
    """Return h, dimensionless, shape (3, 3), of scaled stress s and scaled rate d."""
    unit = np.eye(3)
    return {extra}


def stress_rate(stress, velocity_gradient):
    """Return d(stress)/dt of every mode in Pa/s, shape (modes, 3, 3).

    stress: of every mode in Pa, shape (modes, 3, 3); zero at rest.
    velocity_gradient: in 1/s, shape (3, 3).
    """
    rate = np.empty_like(stress)
    for k, (modulus, time) in enumerate(zip(MODULUS_PA, RELAXATION_TIME_S)):
        s, gradient = stress[k] / modulus, time * velocity_gradient
        d = gradient + gradient.T
        change = d + gradient @ s + s @ gradient.T{relaxation} - extra_term(s, d)
        rate[k] = modulus / time * change
    return rate


def total_stress(stress, velocity_gradient):
    """Return the extra stress in Pa, shape (3, 3): all modes and the solvent."""
    return stress.sum(axis=0) + SOLVENT_VISCOSITY_PA_S * (velocity_gradient + velocity_gradient.T)


def simulate_shear(shear_rate, times, step=0.02):
    """Return shear stress, N1 and N2 in Pa at times in s, each of their shape.

    shear_rate: function of time in s, in 1/s. times: increasing from 0, where the fluid is at rest.
    step: of the fourth-order Runge-Kutta method, in units of the shortest relaxation time or of
    the time of unit strain. Modes much shorter than the flow need many steps.
    """

    def gradient(t):
        g = np.zeros((3, 3))
        g[0, 1] = shear_rate(t)
        return g

    def components(t, stress):
        total = total_stress(stress, gradient(t))
        return total[0, 1], total[0, 0] - total[1, 1], total[1, 1] - total[2, 2]

    t, stress = float(times[0]), np.zeros((len(MODULUS_PA), 3, 3))
    rows = [components(t, stress)]
    for end in times[1:]:
        fastest = max(1.0 / RELAXATION_TIME_S.min(), abs(shear_rate(t)), abs(shear_rate(end)))
        n = max(1, int(np.ceil((end - t) * fastest / step)))
        h = (end - t) / n
        for _ in range(n):
            k1 = stress_rate(stress, gradient(t))
            k2 = stress_rate(stress + 0.5 * h * k1, gradient(t + 0.5 * h))
            k3 = stress_rate(stress + 0.5 * h * k2, gradient(t + 0.5 * h))
            k4 = stress_rate(stress + h * k3, gradient(t + h))
            stress = stress + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
            t += h
        t = float(end)
        rows.append(components(t, stress))
    return tuple(np.array(rows).T)
'''

_SYMPY_TEMPLATE = '''"""Constitutive law in SymPy, written by discover. Needs sympy only.

{header}

`extra_term` is h, 3 by 3, in the components of the scaled stress s = stress_k / G_k and of the
scaled rate d = L + L^T with L = lambda_k * velocity_gradient. `stress_rate` is ds/dt with time in
lambda_k. Every mode obeys the same law; `modes` holds pairs of G_k in Pa and lambda_k in s.
"""

import sympy

stress_symbols = s11, s12, s13, s22, s23, s33 = sympy.symbols("s11 s12 s13 s22 s23 s33")
gradient_symbols = sympy.symbols("L11 L12 L13 L21 L22 L23 L31 L32 L33")

s = sympy.Matrix([[s11, s12, s13], [s12, s22, s23], [s13, s23, s33]])
gradient = sympy.Matrix(3, 3, gradient_symbols)
d = gradient + gradient.T
unit = sympy.eye(3)

modes = {modes}
solvent_viscosity_Pa_s = {solvent}
tested = {tested}

extra_term = {extra}
stress_rate = d + gradient @ s + s @ gradient.T{relaxation} - extra_term
'''


def numpy_code(equation: Equation) -> str:
    """Return a module with the law as a function of numpy arrays."""
    return _NUMPY_TEMPLATE.format(
        header="\n".join(header_lines(equation)) or "No record of where it was tested.",
        relaxation=" - s" if equation.linear_relaxation else "",
        modulus=_numbers(equation.modulus),
        time=_numbers(equation.relaxation_time),
        solvent=repr(float(equation.solvent_viscosity)),
        tested=_tested(equation),
        extra=_sum(equation.terms, _CodeNotation(), "np.zeros((3, 3))"),
    )


def sympy_code(equation: Equation) -> str:
    """Return a module with the law as SymPy expressions in components."""
    pairs = zip(equation.modulus, equation.relaxation_time, strict=True)
    return _SYMPY_TEMPLATE.format(
        header="\n".join(header_lines(equation)) or "No record of where it was tested.",
        relaxation=" - s" if equation.linear_relaxation else "",
        modes="[" + ", ".join(f"({float(g)!r}, {float(time)!r})" for g, time in pairs) + "]",
        solvent=repr(float(equation.solvent_viscosity)),
        tested=_tested(equation),
        extra=_sum(equation.terms, _SympyCodeNotation(), "sympy.zeros(3, 3)"),
    )


def _sum(terms: Sequence[EquationTerm], notation: _CodeNotation, nothing: str) -> str:
    if not terms:
        return nothing
    lines = [parse_term(t.term).spell(notation, t.coefficient, t.inner) for t in terms]
    return "(\n        " + "\n        + ".join(lines) + "\n    )"


def _numbers(values: Sequence[float]) -> str:
    return "[" + ", ".join(repr(float(value)) for value in values) + "]"


def _tested(equation: Equation) -> str:
    if equation.tested is None:
        return "None"
    boxes = {"learned_in": equation.tested.learned_in, "judged_in": equation.tested.judged_in}
    parts = []
    for name, box in boxes.items():
        if box is None:
            parts.append(f'"{name}": None')
        else:
            spans = (f'"Wi": {_numbers(box.weissenberg)}', f'"De": {_numbers(box.deborah)}')
            parts.append(f'"{name}": {{{", ".join(spans)}}}')
    return "{" + ", ".join(parts) + "}"
