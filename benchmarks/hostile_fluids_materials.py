"""Materials and noises that no other benchmark holds: no Maxwell fluid at heart, most of them."""

from dataclasses import dataclass

import numpy as np
from independent import Modes, RateLaw, UpperConvectedMaxwell
from independent.flow import Flow
from independent.material import Material, Rate, Stresses, rate_tensor, stretched
from independent.noise import rms
from scipy.integrate import solve_ivp


@dataclass(frozen=True)
class Inelastic(Material):
    """σ12 = K |γ̇|^(n−1) γ̇ at once, with a yield stress: Herschel & Bulkley 1926. N1 = N2 = 0."""

    consistency: float = 80.0
    exponent: float = 0.5
    yield_stress: float = 0.0

    def respond(self, flow: Flow, times: np.ndarray) -> Stresses:
        """Return the stresses; regularised as Papanastasiou 1987 where the rate vanishes."""
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
        """Return the stresses."""
        strain = np.asarray(flow.strain(times), float)
        shear = self.modulus * strain + self.viscosity * np.asarray(flow.rate(times), float)
        return Stresses(shear, self.modulus * strain**2, 0.0 * strain)


@dataclass(frozen=True)
class Elastoplastic(Material):
    """Local stresses that load, yield and shake their neighbours   [Hébraud & Lequeux 1998].

    ∂P/∂t = −Gγ̇ ∂P/∂s + D ∂²P/∂s² − θ(|s| > s_c) P/τ + Γ δ(s), Γ = ∫_{|s|>s_c} P/τ, D = α s_c² Γ
    [Phys. Rev. Lett. 81, 2934, eq. 1 to 3]. A scalar, so that no normal stress is known. Finite
    volumes, from the steady state at rest, which has D > 0 for α > 1/2.
    """

    coupling: float = 0.7  # α
    modulus: float = 100.0
    threshold: float = 100.0  # s_c
    time: float = 1.0  # τ
    cells: int = 120

    def respond(self, flow: Flow, times: np.ndarray) -> Stresses:
        """Return σ12 = ∫ s P ds; NaN for the normal stresses."""
        edge = np.linspace(-4.0, 4.0, self.cells + 1)
        middle, width = (edge[1:] + edge[:-1]) / 2, edge[1] - edge[0]
        beyond = (np.abs(middle) > 1.0) / self.time
        at_zero = np.isin(np.arange(self.cells), [self.cells // 2 - 1, self.cells // 2]) / 2 / width

        def change(t, density):
            yielding = np.sum(beyond * density) * width
            padded = np.concatenate([[0.0], density, [0.0]])
            speed = self.modulus * float(flow.rate(t)) / self.threshold if t >= 0 else 0.0
            upwind = padded[:-1] if speed >= 0 else padded[1:]
            spread = self.coupling * yielding * np.diff(padded) / width
            through = speed * upwind - spread
            through[[0, -1]] = 0.0
            return -np.diff(through) / width - beyond * density + yielding * at_zero

        start = np.exp(-(middle**2))
        start = start / np.sum(start) / width
        old = solve_ivp(change, (-300.0, -1e-9), start, "LSODA", rtol=1e-7, atol=1e-9).y[:, -1]
        found = solve_ivp(
            change, (0.0, float(times[-1])), old, "LSODA", times, rtol=1e-7, atol=1e-9, max_step=0.1
        ).y
        shear = self.threshold * np.sum(middle[:, None] * found, axis=0) * width
        return Stresses(shear, np.full_like(shear, np.nan), np.full_like(shear, np.nan))


def fractional(exponent: float = 0.5, modulus: float = 100.0, time: float = 1.0) -> Modes:
    """Return upper convected modes whose G(t) is that of a spring and a springpot in a row.

    G(t) = G E_a(−(t/τ)^a) has the spectrum G sin(aπ)/π / (x^a + x^−a + 2 cos aπ) of x = t/τ, per
    ln τ   [Gorenflo & Mainardi 1997]; here two modes a factor of e from e^−4 to e^5.
    """
    log = np.arange(-4.0, 5.01, 0.5)
    a = exponent
    share = np.sin(a * np.pi) / np.pi / (2 * np.cosh(a * log) + 2 * np.cos(a * np.pi))
    pairs = zip(0.5 * modulus * share, time * np.exp(log), strict=True)
    return Modes(*(UpperConvectedMaxwell(float(g), float(t)) for g, t in pairs))


@dataclass(frozen=True)
class Heated(RateLaw):
    """A Giesekus fluid that its own work warms: both its modulus and its time follow.

    dΘ/dt = b σ:D − Θ/t_h with σ:D the whole power, λ → λ e^−Θ, and G → G (1 + Θ/20), as of rubber.
    """

    mobility: float = 0.0
    heating: float = 0.004
    loss_time: float = 3.0
    modulus: float = 100.0
    relaxation_time: float = 1.0

    def rest(self) -> np.ndarray:
        """Return Θ = 0 and no stress."""
        return np.zeros(10)

    def scale(self) -> np.ndarray:
        """Return 1, and the modulus nine times."""
        return np.append(1.0, np.full(9, self.modulus))

    def change(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        """Return dΘ/dt and dσ/dt; the state holds the stress at the first modulus."""
        warm, stress = state[0], state[1:].reshape(3, 3)
        power = np.sum(self.stress(state, rate) * rate_tensor(rate)) / 2
        relaxed = (stress + self.mobility / self.modulus * stress @ stress) / self.relaxation_time
        driven = self.modulus * rate_tensor(rate) + stretched(stress, rate)
        grown = self.heating * power - warm / self.loss_time
        return np.append(grown, driven - relaxed * np.exp(warm))

    def stress(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        """Return σ."""
        del rate
        return (1 + state[0] / 20) * state[1:].reshape(3, 3)


def white(size: float):
    return lambda stress, lot: stress + size * rms(stress) * lot.standard_normal(len(stress))


def level(size: float):
    """Return white noise of a size in Pa."""
    return lambda stress, lot: stress + size * lot.standard_normal(len(stress))


def autoregressive(size: float, correlation: float, in_pascal: bool = False):
    from independent.noise import correlated

    def put(stress, lot):
        if not in_pascal:
            return correlated(stress, size, correlation, lot)
        return stress + size * correlated(np.ones(len(stress)), 1.0, correlation, lot) - size

    return put


def proportional(share: float):
    return lambda stress, lot: stress * (1 + share * lot.standard_normal(len(stress)))


def heavy(size: float):
    """Return Student's noise with two degrees of freedom: no variance."""
    return lambda stress, lot: stress + size * rms(stress) * lot.standard_t(2, len(stress))


def steps_of(share: float):
    """Return readings in steps of a share of the largest stress, with 0.1 % noise before them."""

    def read(stress, lot):
        step = share * np.max(np.abs(stress))
        return step * np.round(white(0.001)(stress, lot) / step)

    return read


def with_strays(share: float):
    def put(stress, lot):
        noisy = white(0.01)(stress, lot)
        where = lot.choice(len(stress), max(1, round(share * len(stress))), replace=False)
        noisy[where] += rms(stress) * lot.uniform(0.3, 1.0, len(where)) * lot.choice([-1, 1])
        return noisy

    return put


def wandering(size: float):
    """Return a random walk that ends some `size` of the rms away: a drifting zero, 1/f²."""

    def put(stress, lot):
        walk = np.cumsum(lot.standard_normal(len(stress))) / np.sqrt(len(stress))
        return (
            stress
            + size * rms(stress) * walk
            + 0.003 * rms(stress) * lot.standard_normal(len(stress))
        )

    return put


def walk_alone(size: float):
    return lambda stress, lot: stress + size * np.cumsum(lot.standard_normal(len(stress)))
