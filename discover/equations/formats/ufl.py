"""Laws as UFL, the language of weak forms that FEniCSx reads."""

from discover.equations.equation import Equation
from discover.equations.formats.code import CodeNotation, filled

_TEMPLATE = '''"""Constitutive law in UFL, written by discover. Needs ufl, which comes with FEniCSx.

{header}

For every mode k, with s = stress_k / G_k, L = lambda_k * velocity_gradient and d = L + L^T,

    lambda_k / G_k * D(stress_k)/Dt = d + L s + s L^T{relaxation} - h(s, d)

with D/Dt the material derivative: the weak form of a mode is
inner(Dt(stress_k) - stress_rate(stress_k, velocity_gradient, k), test) * dx = 0. Tensors are 3 by 3
in plane flow too (the 33 component of the stress need not vanish), and velocity_gradient[i, j] is
the derivative of v_i by x_j, as ufl.grad has it; `in_space` fills up that of a plane flow.
"""

import ufl
from ufl import dot, exp, max_value, tr

MODULUS_PA = {modulus}
RELAXATION_TIME_S = {time}
SOLVENT_VISCOSITY_PA_S = {solvent}
TESTED = {tested}
N|CONSTANTS = {constants}
S|STRUCTURE = {state_constants}
S|STRUCTURE_AT_REST = {at_rest}


def extra_term(s, d{mode}{also}):
    """Return h, dimensionless, of scaled stress s and scaled rate d."""
    unit = ufl.Identity(3)
{where}    return {extra}


def stress_rate(stress, velocity_gradient, k{also}{structured}):
    """Return the material derivative of the stress of mode k, from 0, in Pa/s."""
    modulus, time = MODULUS_PA[k], {time_factor}RELAXATION_TIME_S[k]
    s, gradient = stress / modulus, time * velocity_gradient
    d = gradient + gradient.T
    change = d + dot(gradient, s) + dot(s, gradient.T){relaxation} - extra_term(s, d{of_mode}{also})
    return modulus / time * change

V|
V|def variables_rate(stress, velocity_gradient, mode, variables{structured}):
V|    """Return the material derivatives of {variables} of a mode in 1/s, a list; each is 0 at rest.
V|
V|    variables: {variables} of this mode, scalar fields of their own.
V|    """
V|    modulus, time = MODULUS_PA[mode], {time_factor}RELAXATION_TIME_S[mode]
V|    s, gradient = stress / modulus, time * velocity_gradient
V|    d, unit = gradient + gradient.T, ufl.Identity(3)
V|{where}    return [rate / time for rate in [{rates}]]
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
S|def structure_rate(stresses, velocity_gradient, structure):
S|    """Return the material derivatives of {state_names} in 1/s, a list; of the whole fluid.
S|
S|    stresses: of all modes, a list. Of the stress that counts which a shear of the same rate has
S|    that does the same work; where nothing flows, the component 12.
S|    """
S|    {state_names}, = structure
S|    d = velocity_gradient + velocity_gradient.T
S|    own = structure_factors(structure)[0] * sum(stresses[1:], stresses[0])
S|    shear_rate = ufl.sqrt(0.5 * ufl.inner(d, d))
S|    flows, moving = ufl.gt(shear_rate, 0.0), max_value(shear_rate, 1e-300)
S|    shear_stress = ufl.conditional(flows, 0.5 * ufl.inner(own, d) / moving, own[0, 1])
S|    return [{state_rates}]
S|

def total_stress(stresses, velocity_gradient{structured}):
    """Return the extra stress in Pa of the stresses of all modes, a list, and the solvent."""
    rate = velocity_gradient + velocity_gradient.T
    return SOLVENT_VISCOSITY_PA_S * rate + {modulus_factor}sum(stresses[1:], stresses[0])


def in_space(plane):
    """Return the 3 by 3 velocity gradient of a plane flow from its 2 by 2 one."""
    return ufl.as_tensor([[plane[0, 0], plane[0, 1], 0], [plane[1, 0], plane[1, 1], 0], [0, 0, 0]])
'''


class _UflNotation(CodeNotation):
    exponential_form = "(exp({rate} * {trace}) - 1)"
    printer, largest = "pycode.PythonCodePrinter", "max_value({}, {})"
    written = (r"math\.", "ufl.")

    def contraction(self, tensors):
        first, *others = tensors
        return f"dot({first}, {self.contraction(others)})" if others else first

    def trace(self, tensor: str) -> str:
        return f"tr({tensor})"


def ufl_code(equation: Equation) -> str:
    """Return a module of UFL expressions; InputError if a named law has no written form."""
    return filled(_TEMPLATE, equation, _UflNotation(), "ufl.as_tensor([[0.0] * 3] * 3)")
