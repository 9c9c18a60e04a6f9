"""States of the whole fluid in exported Python; their fields are empty where a law has none."""

from typing import Any

from discover.equations.equation import Equation

_FACTORS = '''
def structure_factors(structure):
    """Return the factors on the stress and on the relaxation time of every mode.

    structure: {names}.
    """
    {taken} = structure
    return {modulus}, {time}

'''

_NUMPY = '''STRUCTURE = {constants}
STRUCTURE_AT_REST = {at_rest}

{factors}
def structure_rate(stress, velocity_gradient, structure):
    """Return the rates of change of {names} in 1/s, which are of the whole fluid.

    stress, velocity_gradient: as of `stress_rate`. Of the stress that counts which a shear of the
    same rate has that does the same work; where nothing flows, the component 12.
    """
    {taken} = structure
    d = velocity_gradient + velocity_gradient.T
    own = structure_factors(structure)[0] * stress.sum(axis=0)
    shear_rate = np.sqrt(0.5 * np.sum(d * d))
    shear_stress = 0.5 * np.sum(own * d) / shear_rate if shear_rate > 0.0 else own[0, 1]
    return np.array([{rates}])

'''

_UFL = '''STRUCTURE = {constants}
STRUCTURE_AT_REST = {at_rest}

{factors}
def structure_rate(stresses, velocity_gradient, structure):
    """Return the material derivatives of {names} in 1/s, a list; fields of the whole fluid.

    stresses: of all modes, a list. Of the stress that counts which a shear of the same rate has
    that does the same work; where nothing flows, the component 12.
    """
    {taken} = structure
    d = velocity_gradient + velocity_gradient.T
    own = structure_factors(structure)[0] * sum(stresses[1:], stresses[0])
    shear_rate = ufl.sqrt(0.5 * ufl.inner(d, d))
    flows, moving = ufl.gt(shear_rate, 0.0), max_value(shear_rate, 1e-300)
    shear_stress = ufl.conditional(flows, 0.5 * ufl.inner(own, d) / moving, own[0, 1])
    return [{rates}]

'''

_SYMPY = """
# states of the whole fluid, from structure_at_rest; their rates in 1/s follow the size of the rate
# of deformation, sqrt(d:d/2) in 1/s, and the stress in Pa of a shear of that size that does the
# same work. The factors are those on the stress of every mode and on every lambda_k, here and above
structure = {taken}, = sympy.symbols("{symbols},", real=True)
structure_at_rest = {at_rest}
shear_rate, shear_stress = sympy.symbols("shear_rate shear_stress", real=True)
structure_rate = [{rates}]
modulus_factor = sympy.sympify({modulus})
time_factor = sympy.sympify({time})
"""

NOTHING = {
    "structure": "",
    "structured": "",
    "times": "RELAXATION_TIME_S",
    "time_factor": "",
    "structure_of": "",
    "sum_of_all": "sum(stresses, SOLVENT_VISCOSITY_PA_S * rate)",
}
"""Fields of a law without a state."""


def structure_fields(equation: Equation, notation: Any, language: str) -> dict[str, str]:
    """Return the fields of a template that say what states do."""
    if not equation.states:
        return NOTHING
    constants, names, rest, rates, moduli, times = {}, [], [], [], [], []
    for part in equation.states:
        constants[part.effect] = {name: float(value) for name, value in part.values.items()}
        names += part.names
        rest += part.at_rest
        letters = {name: name for name in (*part.names, "shear_rate", "shear_stress")}
        for name, value in part.values.items():
            inner = f'STRUCTURE["{part.effect}"]["{name}"]'
            letters[name] = repr(float(value)) if language == "sympy" else inner
        own, modulus, time = part.spell(notation.scalar, letters)
        rates += own
        moduli += [f"({modulus})"] if modulus != "1" else []
        times += [f"({time})"] if time != "1" else []
    modulus, time = (" * ".join(factors) or "1.0" for factors in (moduli, times))
    told = {
        "names": ", ".join(names),
        "taken": f"{', '.join(names)}," if language != "sympy" else ", ".join(names),
        "symbols": ", ".join(names),
        "at_rest": repr([float(value) for value in rest]),
        "rates": ", ".join(rates),
        "modulus": modulus,
        "time": time,
    }
    factors = _FACTORS.format(**told).strip("\n") + "\n\n"
    text = {"numpy": _NUMPY, "ufl": _UFL, "sympy": _SYMPY}[language]
    return {
        "structure": text.format(**told, constants=repr(constants), factors=factors),
        "structured": ", structure",
        "times": "structure_factors(structure)[1] * np.array(RELAXATION_TIME_S)",
        "time_factor": "structure_factors(structure)[1] * ",
        "sum_of_all": "SOLVENT_VISCOSITY_PA_S * rate "
        "+ structure_factors(structure)[0] * sum(stresses[1:], stresses[0])",
        "structure_of": f"\n    structure: {', '.join(names)}, one value each for the whole fluid.",
    }


def stepped(equation: Equation, variables: int) -> dict[str, str]:
    """Return the fields of the integrator in the text of numpy."""
    levels = sum(len(part.names) for part in equation.states)
    last, viscous = (
        9 + variables,
        "SOLVENT_VISCOSITY_PA_S * (velocity_gradient + velocity_gradient.T)",
    )
    given = f", state[:, 9:{last if levels else ''}]" if variables else ""
    also = ", structure" if levels else ""
    parts = [f"stress_rate(stress, gradient(t){given}{also}).reshape(-1, 9)"]
    if variables:
        parts.append(f"variables_rate(stress, gradient(t){given}{also})")
    if not levels:
        change = parts[0]
        if variables:
            change = "np.hstack([\n            " + ",\n            ".join(parts) + ",\n        ])"
        return {
            "change": change,
            "size": str(last),
            "taken": "",
            "last": "",
            "begun": "",
            "fastest": "1.0 / RELAXATION_TIME_S.min()",
            "total": f"stress.sum(axis=0) + {viscous}",
        }
    # every mode carries the states of the whole fluid along
    parts.append("np.tile(structure_rate(stress, gradient(t), structure), (len(stress), 1))")
    return {
        "change": "np.hstack([\n            " + ",\n            ".join(parts) + ",\n        ])",
        "size": str(last + levels),
        "taken": f"\n        structure = state[0, {last}:]",
        "last": f", state[0, {last}:]",
        "begun": f"\n    state[:, {last}:] = STRUCTURE_AT_REST",
        "fastest": f"1.0 / (structure_factors(state[0, {last}:])[1] * RELAXATION_TIME_S).min()",
        "total": f"structure_factors(structure)[0] * stress.sum(axis=0) + {viscous}",
    }
