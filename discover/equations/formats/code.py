"""Laws as Python text with numpy or SymPy alone, of tables and `repr` of numbers; base of UFL."""

import re
from collections.abc import Mapping, Sequence
from functools import reduce
from importlib import import_module
from typing import Any

from discover.equations.equation import Equation
from tensor_library.notation import Notation, printed
from tensor_library.terms import parse_term


class CodeNotation(Notation):
    """numpy, and what the other texts in Python share with it."""

    tensors = {"I": "unit", "sigma": "s", "gammadot": "d"}  # noqa: RUF012
    dot, times, powered = " @ ", " * ", "{} ** {}"
    # with the cap of the library: beyond it a law is absurd, not infinite
    exponential_form = "np.expm1(min({rate} * {trace}, 60.0))"
    saturating_form = "({trace} / (1 + {level} * abs({trace})))"

    def trace(self, tensor: str) -> str:
        return f"{tensor if tensor.isidentifier() else f'({tensor})'}.trace()"

    def digits_of(self, value: float) -> str:
        return repr(float(value))

    def letter(self, name: str) -> str:
        raise ValueError(f"Code needs a number for {name}.")

    def scalar(self, expression: Any, letters: Mapping[str, str], factor: bool = False) -> str:
        text, _ = printed(expression, letters, self._text)
        return f"({text})" if factor else text

    printer = "numpy.NumPyPrinter"  # of `sympy.printing`
    largest = "max({}, {})"  # of two numbers, not of arrays
    written = (r"numpy\.", "np.")  # how the printer names a module, and how the text does

    def _text(self, expression: Any) -> str:
        module, _, name = self.printer.partition(".")
        base = getattr(import_module(f"sympy.printing.{module}"), name)
        largest = self.largest.format

        class Printer(base):
            def _print_Max(self, expr: Any) -> str:
                return reduce(largest, map(self._print, expr.args))

        return re.sub(self.written[0], self.written[1], Printer().doprint(expression))


class _SympyCodeNotation(CodeNotation):
    exponential_form = "(sympy.exp({rate} * {trace}) - 1)"
    saturating_form = "({trace} / (1 + {level} * sympy.Abs({trace})))"
    printer, largest = "pycode.SymPyPrinter", "sympy.Max({}, {})"
    written = (r"sympy\.functions(\.\w+)+\.", "sympy.")


# Lines of templates that begin so are for laws with a name, structure variables or states alone
_MARKS: tuple[str, ...] = ("N|", "V|", "S|")

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
N|CONSTANTS = {constants}
S|STRUCTURE = {state_constants}
S|STRUCTURE_AT_REST = {at_rest}


def extra_term(s, d{mode}{also}):
    """Return h, dimensionless, shape (3, 3), of scaled stress s and scaled rate d."""
    unit = np.eye(3)
{where}    return {extra}


def stress_rate(stress, velocity_gradient{also}{structured}):
    """Return d(stress)/dt of every mode in Pa/s, shape (modes, 3, 3).

    stress: of every mode in Pa, shape (modes, 3, 3); zero at rest.
    velocity_gradient: in 1/s, shape (3, 3).
V|    variables: {variables} of every mode, dimensionless, shape (modes, number); zero at rest.
S|    structure: {state_names}, one value each for the whole fluid.
    """
    rate = np.empty_like(stress)
    for k, (modulus, time) in enumerate(zip(MODULUS_PA, {time_factor}RELAXATION_TIME_S)):
        s, gradient = stress[k] / modulus, time * velocity_gradient
        d = gradient + gradient.T
        change = d + gradient @ s + s @ gradient.T{relaxation} - extra_term(s, d{of_mode}{also_k})
        rate[k] = modulus / time * change
    return rate

V|
V|def variables_rate(stress, velocity_gradient, variables{structured}):
V|    """Return the rates of change of {variables} in 1/s, shape (modes, {count}).
V|
V|    Parameters as of `stress_rate`.
V|    """
V|    d = velocity_gradient + velocity_gradient.T
V|    return np.array([
V|        scaled_rates(stress[k] / modulus, time * d, k, variables[k]) / time
V|        for k, (modulus, time) in enumerate(zip(MODULUS_PA, {time_factor}RELAXATION_TIME_S))
V|    ])
V|
V|
V|def scaled_rates(s, d, mode, variables):
V|    """Return the rates of change of {variables}, times the relaxation time."""
V|    unit = np.eye(3)
V|{where}    return np.array([{rates}])
V|
S|
S|def structure_factors(structure):
S|    """Return the factors on the stress and on the relaxation time of every mode.
S|
S|    structure: {state_names}.
S|    """
S|    {state_names}, = structure
S|    return {on_modulus}, {on_time}
S|
S|
S|def structure_rate(stress, velocity_gradient, structure):
S|    """Return the rates of change of {state_names} in 1/s, which are of the whole fluid.
S|
S|    stress, velocity_gradient: as of `stress_rate`. Of the stress that counts which a shear of the
S|    same rate has that does the same work; where nothing flows, the component 12.
S|    """
S|    {state_names}, = structure
S|    d = velocity_gradient + velocity_gradient.T
S|    own = structure_factors(structure)[0] * stress.sum(axis=0)
S|    shear_rate = np.sqrt(0.5 * np.sum(d * d))
S|    shear_stress = 0.5 * np.sum(own * d) / shear_rate if shear_rate > 0.0 else own[0, 1]
S|    return np.array([{state_rates}])
S|

def total_stress(stress, velocity_gradient{structured}):
    """Return the extra stress in Pa, shape (3, 3): all modes and the solvent."""
    viscous = SOLVENT_VISCOSITY_PA_S * (velocity_gradient + velocity_gradient.T)
    return {modulus_factor}stress.sum(axis=0) + viscous


def simulate_shear(shear_rate, times, step=0.02):
    """Return shear stress, N1 and N2 in Pa at times in s, each of their shape.

    shear_rate: function of time in s, in 1/s. times: increasing; the fluid is at rest at 0, whether
    that is one of them or not.
    step: of the fourth-order Runge-Kutta method, in units of the shortest relaxation time or of
    the time of unit strain. Modes much shorter than the flow need many steps.
    """

    def gradient(t):
        g = np.zeros((3, 3))
        g[0, 1] = shear_rate(t)
        return g

    def change(t, state):
        stress = state[:, :9].reshape(-1, 3, 3)
V|        variables = state[:, 9:{last}]
S|        structure = state[0, {last}:]
        rates = [stress_rate(stress, gradient(t){also}{structured}).reshape(-1, 9)]
V|        rates.append(variables_rate(stress, gradient(t), variables{structured}))
S|        of_structure = structure_rate(stress, gradient(t), structure)
S|        rates.append(np.tile(of_structure, (len(stress), 1)))  # every mode carries it along
        return np.hstack(rates)

    def components(t, state):
        stress = state[:, :9].reshape(-1, 3, 3)
S|        structure = state[0, {last}:]
        total = total_stress(stress, gradient(t){structured})
        return total[0, 1], total[0, 0] - total[1, 1], total[1, 1] - total[2, 2]

    if not np.all(np.diff(times, prepend=0.0) >= 0.0):
        raise ValueError("times must increase from 0, where the fluid is at rest")
    t, state = 0.0, np.zeros((len(MODULUS_PA), {size}))
S|    state[:, {last}:] = STRUCTURE_AT_REST
    rows = []
    for end in map(float, times):
        while t < end:
S|            structure = state[0, {last}:]
            shortest = np.min({time_factor}RELAXATION_TIME_S)
            fastest = max(1.0 / shortest, abs(shear_rate(t)), abs(shear_rate(end)))
            left = max(1, int(np.ceil((end - t) * fastest / step)))
            h = (end - t) / left
            k1 = change(t, state)
            k2 = change(t + 0.5 * h, state + 0.5 * h * k1)
            k3 = change(t + 0.5 * h, state + 0.5 * h * k2)
            k4 = change(t + h, state + h * k3)
            state = state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
            t = end if left == 1 else t + h
        rows.append(components(t, state))
    return tuple(np.array(rows).T)
'''

_SYMPY_TEMPLATE = '''"""Constitutive law in SymPy, written by discover. Needs sympy only.

{header}

`extra_term` is h, 3 by 3, in the components of the scaled stress s = stress_k / G_k and of the
scaled rate d = L + L^T with L = lambda_k * velocity_gradient. `stress_rate` is ds/dt with time in
lambda_k. Every mode obeys the same law, but for constants in `values`, where there are some.
`modes` holds pairs of G_k in Pa and lambda_k in s.
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
{constants}
{where}extra_term = {extra}
stress_rate = d + gradient @ s + s @ gradient.T{relaxation} - extra_term
V|# of the structure variables, with time in lambda_k; each is 0 at rest
V|variables = [{variables}]
V|variables_rate = [{rates}]
S|
S|# states of the whole fluid, from structure_at_rest; their rates in 1/s follow the size of the
S|# rate of deformation, sqrt(d:d/2) in 1/s, and the stress in Pa of a shear of that size that does
S|# the same work. The factors are those on the stress of every mode and on every lambda_k
S|structure = {state_names}, = sympy.symbols("{state_names},", real=True)
S|structure_at_rest = {at_rest}
S|shear_rate, shear_stress = sympy.symbols("shear_rate shear_stress", real=True)
S|structure_rate = [{state_rates}]
S|modulus_factor = sympy.sympify({on_modulus})
S|time_factor = sympy.sympify({on_time})
'''


def numpy_code(equation: Equation) -> str:
    """Return a module of numpy functions; InputError if a named law has no written form."""
    return filled(_NUMPY_TEMPLATE, equation, CodeNotation(), "np.zeros((3, 3))")


def sympy_code(equation: Equation) -> str:
    """Return a module of SymPy expressions in components; InputError as for `numpy_code`."""
    named = equation.named
    constants = ""
    if named is not None and named.function.constants:
        letters = [f'"{n}": sympy.Symbol("{n}", real=True)' for n in named.function.constants]
        constants = (
            f"constant = {{{', '.join(letters)}}}\n"
            "# of each mode: stress_rate.subs(values[0])\n"
            "values = [\n    {constant[n]: v for n, v in one.items()}\n"
            f"    for one in {_constants(equation)}\n]\n"
        )
    for name in () if named is None else named.function.rates:
        constants += f'{name} = sympy.Symbol("{name}", real=True)\n'
    notation, nothing = _SympyCodeNotation(), "sympy.zeros(3, 3)"
    return filled(_SYMPY_TEMPLATE, equation, notation, nothing, constants, indent="")


def filled(
    template: str, equation: Equation, notation: CodeNotation, nothing: str,
    constants: str | None = None, indent: str = "    ",
) -> str:  # fmt: skip
    """Return a module: a template with the law in a notation.

    `constants`: of a named law, as text; by default a list with a table for each mode.
    `indent`: of what stands in functions; empty where nothing does.
    """
    named = equation.named
    pairs = zip(equation.modulus, equation.relaxation_time, strict=True)
    lines = [parse_term(t.term).spell(notation, t.coefficient, t.inner) for t in equation.terms]
    where, rates, variables = "", "", ()
    if named is not None:
        function = named.function
        variables = tuple(function.rates)
        letters = {name: f'constant["{name}"]' for name in function.constants}
        letters |= {name: name for name in (*function.where, *variables)}
        defined, changes, summands = function.spell(notation, letters)
        rates = ", ".join(text for _, text in changes)
        where = "".join(f"{indent}{name} = {value}\n" for name, value in defined)
        lines = summands + lines
        constants = _constants(equation) if constants is None else constants
        if indent:
            given = "".join(f"{indent}{n} = variables[{i}]\n" for i, n in enumerate(variables))
            where = f"{indent}constant = CONSTANTS[mode]\n" + given + where
    there = dict(zip(_MARKS, (named, variables, equation.states), strict=True))
    kept = [
        line[2:] if line[:2] in there else line
        for line in template.splitlines(keepends=True)
        if there.get(line[:2], True)
    ]
    last = 9 + len(variables)
    return "".join(kept).format(
        header="\n".join(equation.header) or "Where it was tested is not recorded.",
        relaxation=" - s" if equation.linear_relaxation else "", modulus=_numbers(equation.modulus),
        time=_numbers(equation.relaxation_time),
        modes=repr([(float(g), float(time)) for g, time in pairs]),
        solvent=repr(float(equation.solvent_viscosity)),
        tested=repr(equation.tested and equation.tested.boxes),
        constants=constants or "",
        mode=", mode" if variables else ", mode=0" if named else "", of_mode=", k" if named else "",
        also=", variables" if variables else "", also_k=", variables[k]" if variables else "",
        variables=", ".join(variables), count=len(variables), rates=rates, where=where,
        last=last, size=last + sum(len(part.names) for part in equation.states),
        extra="(\n        " + "\n        + ".join(lines) + "\n    )" if lines else nothing,
        **_of_states(equation, notation, by_name=bool(indent)),
    )  # fmt: skip


def _of_states(equation: Equation, notation: CodeNotation, by_name: bool) -> dict[str, str]:
    """Return the fields of a template that say what states of the whole fluid do."""
    constants, names, rest, rates, moduli, times = {}, [], [], [], [], []
    for part in equation.states:
        constants[part.effect] = {name: float(value) for name, value in part.values.items()}
        names += part.names
        rest += [float(value) for value in part.at_rest]
        letters = {name: name for name in (*part.names, "shear_rate", "shear_stress")}
        for name, value in part.values.items():
            held = f'STRUCTURE["{part.effect}"]["{name}"]'
            letters[name] = held if by_name else repr(float(value))
        own, modulus, time = part.spell(notation.scalar, letters)
        rates += own
        moduli += [f"({modulus})"] if modulus != "1" else []
        times += [f"({time})"] if time != "1" else []
    there = bool(names)
    return {
        "state_constants": repr(constants), "state_names": ", ".join(names), "at_rest": repr(rest),
        "state_rates": ", ".join(rates), "on_modulus": " * ".join(moduli) or "1.0",
        "on_time": " * ".join(times) or "1.0", "structured": ", structure" if there else "",
        "modulus_factor": "structure_factors(structure)[0] * " if there else "",
        "time_factor": "structure_factors(structure)[1] * " if there else "",
    }  # fmt: skip


def _constants(equation: Equation) -> str:
    """Return the constants of the named law, one table for each mode."""
    assert equation.named is not None
    each = (equation.named.of_mode(k) for k in range(len(equation.modulus)))
    return repr([{name: float(value) for name, value in one.items()} for one in each])


def _numbers(values: Sequence[float]) -> str:
    return repr([float(value) for value in values])
