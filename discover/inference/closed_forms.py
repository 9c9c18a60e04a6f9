"""Stresses in closed form: fluids without elasticity, an elastic solid, Maxwell modes.

Newton's law, and that of Carreau & Yasuda 1972, AIChE J. 18, 1068 [Yasuda 1979, MIT thesis],

    σ12 = (η∞ + (η0 − η∞) (1 + (k |γ̇|)^a)^((n − 1)/a)) γ̇,

that of Herschel & Bulkley 1926, Kolloid-Z. 39, 291, whose yield stress sets in at a rate 1/m
[Papanastasiou 1987, J. Rheol. 31, 385],

    σ12 = sign(γ̇) (τ_y (1 − exp(−m |γ̇|)) + K |γ̇|^n),

the same without a yield stress [Ostwald 1925, Kolloid-Z. 36, 99], the solid of Kelvin & Voigt,
σ12 = G γ + η γ̇, and one Maxwell mode with a Newtonian solvent, or two without   [Tschoegl 1989,
The Phenomenological Theory of Linear Viscoelastic Behavior, ch. 3].
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from scipy.integrate import cumulative_trapezoid

from discover.dataset import Run
from discover.protocols import strains
from discover.protocols.kinematics import MODULI
from discover.statistics.noise_model import first_order

NEWTONIAN, CARREAU_YASUDA = "newtonian", "carreau_yasuda"
HERSCHEL_BULKLEY, POWER_LAW = "herschel_bulkley", "power_law"
KELVIN_VOIGT = "kelvin_voigt"
MAXWELL, TWO_MODES = "maxwell", "two_modes"

_AT_REST = 1e-100
"""Rate in 1/s of which a viscosity is finite, and the stress none."""

Constants = Sequence[float] | Float[np.ndarray, " k"]


def viscosity(
    law: str, constants: Constants, rate: Float[np.ndarray, " n"]
) -> Float[np.ndarray, " n"]:
    """Return the viscosity in Pa s at shear rates in 1/s.

    `constants`: η; K and n; η0, η∞, k, n and a; or τ_y, K, n and m, without which a yield stress
    is there at once.
    """
    if law == NEWTONIAN:
        return np.full(np.shape(rate), constants[0])
    size = np.maximum(np.abs(rate), _AT_REST)
    if law in (POWER_LAW, HERSCHEL_BULKLEY):
        without_yield = (0.0,) if law == POWER_LAW else ()
        yield_stress, consistency, index, *sharpness = (*without_yield, *constants)
        set_in = -np.expm1(-sharpness[0] * size) if sharpness else 1.0
        return (yield_stress * set_in + consistency * size**index) / size
    zero, infinite, time, index, sharpness = constants
    thinned = (1.0 + (time * np.abs(rate)) ** sharpness) ** ((index - 1.0) / sharpness)
    return infinite + (zero - infinite) * thinned


def recorded(law: str, constants: Constants, run: Run) -> Float[np.ndarray, " n"]:
    """Return what a law records: moduli or σ12 in shear at a given rate, in Pa; strain in creep.

    `constants`: as of `viscosity`; G and η of a solid; G, λ and η_s of one mode; or G and λ of each
    of two. What remembers takes runs from rest.
    """
    modes, solvent = _modes(law, constants)
    if run.protocol.control == "oscillation":
        storage, omega = run.quantity == MODULI[0], run.angular_frequency
        if law == KELVIN_VOIGT:
            return np.full(len(run), constants[0]) if storage else constants[1] * omega
        if law == NEWTONIAN:
            return (0.0 if storage else constants[0]) * omega
        whole = np.zeros(len(run)) if storage else solvent * omega
        for modulus, time in modes:
            x = omega * time
            whole = whole + modulus * (x**2 if storage else x) / (1.0 + x**2)
        return whole
    if run.protocol.control == "stress":
        return _crept(law, constants, run)
    if law == KELVIN_VOIGT:
        return constants[0] * strain_of(run) + constants[1] * run.rate
    if law in (MAXWELL, TWO_MODES):
        each = [g * _relaxing(run.time, run.rate, time) for g, time in modes]
        return np.sum(each, axis=0) + solvent * run.rate
    return viscosity(law, constants, run.rate) * run.rate


def _crept(law: str, constants: Constants, run: Run) -> Float[np.ndarray, " n"]:
    """Return the strain of a viscous fluid or a solid at a given stress, from rest."""
    knots = np.asarray(run.protocol.table_times)
    time = np.union1d(knots, run.time)
    stress = np.interp(time, knots, np.asarray(run.protocol.table_rates))
    if law == NEWTONIAN:
        whole = cumulative_trapezoid(stress, time, initial=0.0)
    else:  # G γ + η γ̇ = σ relaxes as a Maxwell mode does, within η/G
        whole = _relaxing(time - time[0], stress, constants[1] / constants[0])
    return whole[np.searchsorted(time, run.time)] / constants[-1]


def _modes(law: str, constants: Constants) -> tuple[list[tuple[float, float]], float]:
    """Return modulus and time of each Maxwell mode of a law, and the solvent's viscosity."""
    if law == TWO_MODES:
        return [(constants[0], constants[1]), (constants[2], constants[3])], 0.0
    return ([(constants[0], constants[1])], constants[2]) if law == MAXWELL else ([], 0.0)


def strain_of(run: Run) -> Float[np.ndarray, " n"]:
    """Return the strain since rest: as recorded, or the integral of the rate."""
    return integrated_rate(run) if run.strain is None else run.strain


def integrated_rate(run: Run) -> Float[np.ndarray, " n"]:
    """Return the strain at each sample, from rest, of the rate as it was recorded.

    A step of strain before the record counts; a flow that had gone on does not.
    """
    time, rate = np.asarray(run.time), np.asarray(run.rate)
    begins = np.array([float(run.protocol.begins)])
    step = -float(strains(run.protocol, begins)[0]) if run.after_step else 0.0
    return step + rate[0] * time[0] + cumulative_trapezoid(rate, time, initial=0.0)


def _relaxing(
    times: Float[np.ndarray, " n"], rates: Float[np.ndarray, " n"], time: float
) -> Float[np.ndarray, " n"]:
    """Return the stress over the modulus of a Maxwell mode, exact for a rate linear in steps."""
    step = np.diff(times, prepend=0.0)
    before = np.concatenate([rates[:1], rates[:-1]])
    kept, lost = np.exp(-step / time), -np.expm1(-step / time)
    slope = np.divide(rates - before, step, out=np.zeros(len(step)), where=step > 0.0)
    return first_order(kept, time * (before * lost + slope * (step - time * lost)))
