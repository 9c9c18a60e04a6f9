"""Fluids of hostile records that `independent` has not; a source stands with each."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from independent import (
    KBKZ,
    Flow,
    Material,
    Modes,
    Newtonian,
    RateLaw,
    Stresses,
    StressLaw,
    UpperConvectedMaxwell,
)
from independent.material import Rate, rate_tensor, stretched
from scipy.integrate import solve_ivp

ONE = np.eye(3)


def without_normal(shear: np.ndarray) -> Stresses:
    """Return stresses of a scalar theory, which knows no normal stress."""
    return Stresses(shear, np.full_like(shear, np.nan), np.full_like(shear, np.nan))


@dataclass(frozen=True)
class Inelastic(Material):
    """σ12 = K |γ̇|^(n−1) γ̇ at once, with a yield stress: Herschel & Bulkley 1926. N1 = N2 = 0."""

    consistency: float = 80.0
    exponent: float = 0.5
    yield_stress: float = 0.0

    def respond(self, flow: Flow, times: np.ndarray) -> Stresses:
        rate = np.asarray(flow.rate(times), float)
        size = np.abs(rate)
        shear = np.sign(rate) * self.consistency * size**self.exponent
        shear = shear + np.sign(rate) * self.yield_stress * -np.expm1(-50.0 * size)
        return Stresses(shear, 0.0 * shear, 0.0 * shear)


@dataclass(frozen=True)
class Rubber(Material):
    """A neo-Hookean solid with a dashpot: σ12 = G γ + η γ̇, N1 = G γ², N2 = 0."""

    modulus: float = 100.0
    viscosity: float = 10.0

    def respond(self, flow: Flow, times: np.ndarray) -> Stresses:
        strain = np.asarray(flow.strain(times), float)
        shear = self.modulus * strain + self.viscosity * np.asarray(flow.rate(times), float)
        return Stresses(shear, self.modulus * strain**2, 0.0 * strain)


@dataclass(frozen=True)
class Elastoplastic(Material):
    """Local stresses that load, yield and shake their neighbours   [Hébraud & Lequeux 1998].

    ∂P/∂t = −Gγ̇ ∂P/∂s + D ∂²P/∂s² − θ(|s| > s_c) P/τ + Γ δ(s), Γ = ∫_{|s|>s_c} P/τ, D = α s_c² Γ
    [Phys. Rev. Lett. 81, 2934, eq. 1 to 3]; finite volumes, from the steady state at rest.
    """

    coupling: float = 0.7  # α; D > 0 at rest for more than 1/2
    modulus: float = 100.0
    threshold: float = 100.0  # s_c
    time: float = 1.0  # τ
    cells: int = 120

    def respond(self, flow: Flow, times: np.ndarray) -> Stresses:
        edge = np.linspace(-4.0, 4.0, self.cells + 1)
        middle, width = (edge[1:] + edge[:-1]) / 2, edge[1] - edge[0]
        beyond = (np.abs(middle) > 1.0) / self.time
        at_zero = np.isin(np.arange(self.cells), [self.cells // 2 - 1, self.cells // 2]) / 2 / width

        def change(t, density):
            yielding = np.sum(beyond * density) * width
            padded = np.concatenate([[0.0], density, [0.0]])
            speed = self.modulus * float(flow.rate(t)) / self.threshold if t >= 0 else 0.0
            upwind = padded[:-1] if speed >= 0 else padded[1:]
            through = speed * upwind - self.coupling * yielding * np.diff(padded) / width
            through[[0, -1]] = 0.0
            return -np.diff(through) / width - beyond * density + yielding * at_zero

        start = np.exp(-(middle**2))
        start = start / np.sum(start) / width
        exact = {"method": "LSODA", "rtol": 1e-7, "atol": 1e-9}
        old = solve_ivp(change, (-300.0, -1e-9), start, **exact).y[:, -1]
        span = (0.0, float(times[-1]))
        found = solve_ivp(change, span, old, t_eval=times, max_step=0.1, **exact).y
        return without_normal(self.threshold * np.sum(middle[:, None] * found, axis=0) * width)


def fractional(exponent: float = 0.5, modulus: float = 100.0, time: float = 1.0) -> Modes:
    """Return upper-convected modes whose G(t) is that of a spring and a springpot in a row.

    G(t) = G E_a(−(t/τ)^a) has the spectrum G sin(aπ)/π / (x^a + x^−a + 2 cos aπ) of x = t/τ, per
    ln τ   [Gorenflo & Mainardi 1997]; here two modes a factor of e from e^−4 to e^5.
    """
    log, a = np.arange(-4.0, 5.01, 0.5), exponent
    share = np.sin(a * np.pi) / np.pi / (2 * np.cosh(a * log) + 2 * np.cos(a * np.pi))
    return modes(UpperConvectedMaxwell, 0.5 * modulus * share, time * np.exp(log))


class _WithLevel(RateLaw):
    """A law of a number, `level` at rest, and the stress in Pa."""

    level: float = 0.0
    modulus: float

    def rest(self) -> np.ndarray:
        return np.append(self.level, np.zeros(9))

    def scale(self) -> np.ndarray:
        return np.append(1.0, np.full(9, self.modulus))

    def stress(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        return state[1:].reshape(3, 3)


@dataclass(frozen=True)
class Heated(_WithLevel):
    """A Giesekus fluid that its own work warms: both its modulus and its time follow.

    dΘ/dt = b σ:D − Θ/t_h with σ:D the whole power, λ → λ e^−Θ, and G → G (1 + Θ/20), as of rubber.
    """

    mobility: float = 0.0
    heating: float = 0.004
    loss_time: float = 3.0
    modulus: float = 100.0
    relaxation_time: float = 1.0

    def change(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        warm, stress = state[0], state[1:].reshape(3, 3)
        power = np.sum(self.stress(state, rate) * rate_tensor(rate)) / 2
        relaxed = (stress + self.mobility / self.modulus * stress @ stress) / self.relaxation_time
        driven = self.modulus * rate_tensor(rate) + stretched(stress, rate)
        grown = self.heating * power - warm / self.loss_time
        return np.append(grown, driven - relaxed * np.exp(warm))

    def stress(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        return (1 + state[0] / 20) * state[1:].reshape(3, 3)


@dataclass(frozen=True)
class Micelles(_WithLevel):
    """σ▽ = G γ̇ − f σ/λ, f' = (1 − f)/λ_s + k (f_∞ − f) σ:D   [Bautista et al. 1999].

    [JNNFM 80, 93, eqs. 1 and 2]; f is the fluidity over that at rest, and λ = 1/(G φ_0).
    """

    breaking: float = 1e-3  # k, 1/Pa
    largest: float = 10.0  # f_∞
    structure_time: float = 2.0  # λ_s, s
    modulus: float = 100.0
    relaxation_time: float = 1.0
    level = 1.0

    def change(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        fluidity, stress = state[0], state[1:].reshape(3, 3)
        work = np.sum(stress * rate_tensor(rate)) / 2
        grown = (1 - fluidity) / self.structure_time
        grown += self.breaking * (self.largest - fluidity) * work
        own = self.modulus * rate_tensor(rate) + stretched(stress, rate)
        return np.append(grown, own - fluidity * stress / self.relaxation_time)


@dataclass(frozen=True)
class Thickening(Newtonian):
    """A viscous stress η γ̇ (1 + |γ̇|/γ̇_c), to stand among `Modes`."""

    viscosity: float = 2.0  # η, Pa s
    rate: float = 1.0  # γ̇_c, 1/s
    modulus: float = 0.0

    def stress(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        tensor = rate_tensor(rate)
        return self.viscosity * (1 + np.sqrt(np.sum(tensor**2) / 2) / self.rate) * tensor


def leonov(a: np.ndarray, gradient: np.ndarray) -> np.ndarray:
    """Return −(A·A − I)/2, in shear   [Leonov 1976, Rheol. Acta 15, 85].

    The traces of A and of its inverse are equal in plane flow, so that this is Giesekus with ½.
    """
    return -(a @ a - ONE) / 2


def drops(a: np.ndarray, gradient: np.ndarray, affinity: float) -> np.ndarray:
    """Return −(1 − f)(D·A + A·D) − (A − g I), g = 3 det A/II keeping the volume of an ellipsoid.

    [Maffettone & Minale 1998, J. Non-Newtonian Fluid Mech. 78, 227].
    """
    strain = (gradient + gradient.T) / 2
    second = (np.trace(a) ** 2 - np.trace(a @ a)) / 2
    slipping = (1 - affinity) * (strain @ a + a @ strain)
    return -slipping - (a - 3 * np.linalg.det(a) / second * ONE)


@dataclass(frozen=True)
class PartlyRetracting(StressLaw):
    """σ▽ + (2ξ/3G)(D:σ)(σ + G I) + σ/λ = 2 G D   [Larson 1984, J. Rheol. 28, 545]; ξ = 1: rods."""

    retraction: float = 0.5  # ξ
    modulus: float = 100.0
    relaxation_time: float = 1.0

    def stress_change(self, stress: np.ndarray, rate: Rate) -> np.ndarray:
        twice = rate_tensor(rate)
        work = np.sum(twice * stress) / 2
        lost = 2 * self.retraction / (3 * self.modulus) * work * (stress + self.modulus * ONE)
        return stretched(stress, rate) + self.modulus * twice - lost - stress / self.relaxation_time


@dataclass(frozen=True)
class FeneCR(RateLaw):
    """c▽ = −f (c − I)/λ, σ = G f (c − I), f = 1/(1 − tr c/b)   [Chilcott & Rallison 1988]."""

    extensibility: float = 20.0  # b
    modulus: float = 100.0
    relaxation_time: float = 1.0

    def _spring(self, c: np.ndarray) -> float:
        return (1 - 3 / self.extensibility) / (1 - np.trace(c) / self.extensibility)

    def rest(self) -> np.ndarray:
        return ONE.ravel()

    def change(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        c = state.reshape(3, 3)
        back = self._spring(c) * (c - ONE) / self.relaxation_time
        return (stretched(c, rate) - back).ravel()

    def stress(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        c = state.reshape(3, 3)
        return self.modulus * self._spring(c) * (c - ONE)


@dataclass(frozen=True)
class Acierno(_WithLevel):
    """σ▽ = 2 G x D − σ/(λ x^1.4) + (ẋ/x) σ, ẋ = (1 − x)/(λ x^1.4) − (a/λ x^1.4) x √(tr σ/(2 G x)).

    [Acierno, La Mantia, Marrucci & Titomanlio 1976, J. Non-Newtonian Fluid Mech. 1, 125]; modulus
    and relaxation time follow one structure that the stress breaks.
    """

    breakdown: float = 0.4  # a
    modulus: float = 100.0
    relaxation_time: float = 1.0
    level = 1.0

    def change(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        x, stress = state[0], state[1:].reshape(3, 3)
        time = self.relaxation_time * x**1.4
        load = np.sqrt(max(np.trace(stress), 0.0) / (2 * self.modulus * x))
        dx = (1 - x) / time - self.breakdown * x * load / time
        own = self.modulus * x * rate_tensor(rate) - stress / time + dx / x * stress
        return np.append(dx, stretched(stress, rate) + own)


@dataclass(frozen=True)
class Damped(KBKZ):
    """σ12 = ∫ m h(γ) γ dt' with a damping function h of its own, otherwise as `KBKZ`."""

    function: Callable[[np.ndarray], np.ndarray] = np.ones_like

    def damped(self, strain: np.ndarray) -> np.ndarray:
        return self.function(strain)


def of_doi_edwards(strain: np.ndarray) -> np.ndarray:
    """Return h(γ) of tubes, by the approximation of Currie 1982, JNNFM 11, 53."""
    first = 3 + strain**2
    root = np.sqrt(first + 13 / 4)
    return 5 / (first + 2 * root - 1) * (1 + 1 / root)


def modes(law: Callable[..., RateLaw], *constants) -> Modes:
    """Return modes of a law, from its constants mode by mode."""
    return Modes(*(law(*map(float, one)) for one in zip(*constants, strict=True)))
