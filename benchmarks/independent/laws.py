"""Laws of solvents, solutions and melts on full tensors, in Pa and s; a source stands with each."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from independent.flow import Flow
from independent.material import (
    Modes,
    Rate,
    RateLaw,
    Stresses,
    StressLaw,
    differences,
    rate_tensor,
    stretched,
    velocity_gradient,
)


@dataclass(frozen=True)
class UpperConvectedMaxwell(StressLaw):
    """σ + λ σ▽ = G λ γ̇   [Oldroyd 1950, Proc. R. Soc. A 200, 523]."""

    modulus: float = 1.0  # G, Pa
    relaxation_time: float = 1.0  # λ, s

    def stress_change(self, stress: np.ndarray, rate: Rate) -> np.ndarray:
        return (
            self.modulus * rate_tensor(rate)
            + stretched(stress, rate)
            - stress / self.relaxation_time
        )

    def start_up(self, rate: float, times: np.ndarray) -> Stresses:
        """Return start-up in closed form   [Bird, Armstrong & Hassager 1987, vol. 1, ch. 7]."""
        t = np.asarray(times) / self.relaxation_time
        weissenberg = rate * self.relaxation_time
        shear = self.modulus * weissenberg * -np.expm1(-t)
        first = 2 * self.modulus * weissenberg**2 * (1 - np.exp(-t) * (1 + t))
        return Stresses(shear, first, np.zeros_like(shear))


@dataclass(frozen=True)
class Newtonian(RateLaw):
    """σ = η γ̇: a solvent, to stand among `Modes`."""

    viscosity: float = 1.0  # η, Pa s
    modulus: float = 0.0

    def rest(self) -> np.ndarray:
        return np.zeros(0)

    def change(self, state: np.ndarray, rate: float) -> np.ndarray:
        return state

    def stress(self, state: np.ndarray, rate: float) -> np.ndarray:
        return self.viscosity * rate_tensor(rate)

    def respond(self, flow: Flow, times: np.ndarray) -> Stresses:
        """Return what the rate alone tells."""
        return differences(
            [self.stress(self.rest(), rate) for rate in flow.rate(np.asarray(times))]
        )


@dataclass(frozen=True)
class Giesekus(StressLaw):
    """σ + λ σ▽ + (α/G) σ·σ = G λ γ̇   [Giesekus 1982, JNNFM 11, 69]."""

    mobility: float = 0.2  # α
    modulus: float = 1.0
    relaxation_time: float = 1.0

    def stress_change(self, stress: np.ndarray, rate: Rate) -> np.ndarray:
        relaxing = stress + self.mobility / self.modulus * stress @ stress
        production = self.modulus * rate_tensor(rate) + stretched(stress, rate)
        return production - relaxing / self.relaxation_time

    def steady_shear(self, rate: float) -> tuple[float, float, float]:
        """Return steady σ12, N1 and N2   [Bird, Armstrong & Hassager 1987, table 7.3-2]."""
        a, weissenberg = self.mobility, self.relaxation_time * rate
        root = np.sqrt(1 + 16 * a * (1 - a) * weissenberg**2)
        chi2 = (root - 1) / (8 * a * (1 - a) * weissenberg**2)
        f = (1 - np.sqrt(chi2)) / (1 + (1 - 2 * a) * np.sqrt(chi2))
        viscosity = (1 - f) ** 2 / (1 + (1 - 2 * a) * f)
        first = f * (1 - a * f) / (a * (1 - f) * weissenberg**2)
        return (
            self.modulus * weissenberg * viscosity,
            2 * self.modulus * weissenberg**2 * first,
            -self.modulus * f,
        )


class GiesekusModes(Modes):
    """Modes that each have a mobility of their own, stepped as one array."""

    def __init__(self, *laws: Giesekus):
        super().__init__(*laws)
        columns = [(law.mobility, law.modulus, law.relaxation_time) for law in laws]
        self._mobility, self._moduli, self._times = np.array(columns, float).T[..., None, None]

    def change(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        stress = state.reshape(-1, 3, 3)
        relaxing = stress + self._mobility / self._moduli * (stress @ stress)
        production = self._moduli * rate_tensor(rate) + stretched(stress, rate)
        return (production - relaxing / self._times).ravel()


def multimode_giesekus(
    mobilities: Sequence[float], moduli: Sequence[float], relaxation_times: Sequence[float]
) -> Modes:
    """Return modes that each have a mobility of their own."""
    parts = zip(mobilities, moduli, relaxation_times, strict=True)
    return GiesekusModes(*(Giesekus(*part) for part in parts))


@dataclass(frozen=True)
class PhanThienTanner(StressLaw):
    """Y(tr σ) σ + λ σ□ = G λ γ̇, σ□ = σ▽ + (ξ/2)(γ̇·σ + σ·γ̇).

    Y = 1 + (ε/G) tr σ   [Phan-Thien & Tanner 1977, JNNFM 2, 353] or
    Y = exp((ε/G) tr σ)   [Phan-Thien 1978, J. Rheol. 22, 259].
    """

    extensibility: float = 0.2  # ε
    kind: Literal["linear", "exponential"] = "linear"
    slip: float = 0.0  # ξ
    modulus: float = 1.0
    relaxation_time: float = 1.0

    def stress_change(self, stress: np.ndarray, rate: Rate) -> np.ndarray:
        argument = self.extensibility * np.trace(stress) / self.modulus
        factor = 1 + argument if self.kind == "linear" else np.exp(argument)
        deformation = rate_tensor(rate)
        product = deformation @ stress
        return (
            self.modulus * deformation
            + stretched(stress, rate)
            - 0.5 * self.slip * (product + product.T)
            - factor * stress / self.relaxation_time
        )


@dataclass(frozen=True)
class JohnsonSegalman(StressLaw):
    """σ + λ(dσ/dt − ω·σ + σ·ω − a(D·σ + σ·D)) = 2 G λ D   [Johnson & Segalman 1977, JNNFM 2, 255].

    Written with vorticity ω = (L − Lᵀ)/2, D = (L + Lᵀ)/2 and a = 1 − ξ.
    """

    slip: float = 0.4  # ξ
    modulus: float = 1.0
    relaxation_time: float = 1.0

    def stress_change(self, stress: np.ndarray, rate: Rate) -> np.ndarray:
        gradient = velocity_gradient(rate)
        vorticity = (gradient - gradient.T) / 2
        deformation = rate_tensor(rate) / 2
        turned = vorticity @ stress - stress @ vorticity
        carried = (1 - self.slip) * (deformation @ stress + stress @ deformation)
        return 2 * self.modulus * deformation + turned + carried - stress / self.relaxation_time

    def start_up(self, rate: float, times: np.ndarray) -> np.ndarray:
        """Return σ12 in start-up in closed form, in Pa.

        σ12 and N1 are a damped oscillation of frequency γ̇√(1 − a²) about steady shear.
        """
        t = np.asarray(times) / self.relaxation_time
        weissenberg = rate * self.relaxation_time
        w = weissenberg * np.sqrt(1 - (1 - self.slip) ** 2)
        steady = weissenberg / (1 + w**2)
        return self.modulus * steady * (1 - np.exp(-t) * (np.cos(w * t) - w * np.sin(w * t)))


@dataclass(frozen=True)
class WhiteMetzner(StressLaw):
    """σ + λ(γ̇) σ▽ = G λ(γ̇) γ̇, λ(γ̇) = λ/(1 + (k λ|γ̇|)^{1−n}).

    [White & Metzner 1963, J. Appl. Polym. Sci. 7, 1867; Cross's function of the rate]
    """

    exponent: float = 0.5  # n
    factor: float = 1.0  # k
    modulus: float = 1.0
    relaxation_time: float = 1.0

    def time_at(self, rate: Rate) -> float:
        """Return λ(γ̇) in s."""
        size = np.sqrt(np.sum(rate_tensor(rate) ** 2) / 2)  # |γ̇| of any flow
        thinning = (self.factor * self.relaxation_time * size) ** (1 - self.exponent)
        return self.relaxation_time / (1 + thinning)

    def stress_change(self, stress: np.ndarray, rate: Rate) -> np.ndarray:
        production = self.modulus * rate_tensor(rate) + stretched(stress, rate)
        return production - stress / self.time_at(rate)


@dataclass(frozen=True)
class FenePeterlin(RateLaw):
    """A▽ = −(f A − I)/λ, σ = G (f A − I), f = (L² − 3)/(L² − tr A).

    [Bird, Dotson & Johnson 1980, JNNFM 7, 213]; A = I at rest.
    """

    maximum_extension_squared: float = 50.0  # L²
    modulus: float = 1.0
    relaxation_time: float = 1.0

    def _tension(self, conformation: np.ndarray) -> np.ndarray:
        limit = self.maximum_extension_squared
        factor = (limit - 3) / (limit - np.trace(conformation))
        return factor * conformation - np.eye(3)

    def rest(self) -> np.ndarray:
        return np.eye(3).ravel()

    def change(self, state: np.ndarray, rate: float) -> np.ndarray:
        conformation = state.reshape(3, 3)
        relaxing = self._tension(conformation) / self.relaxation_time
        return (stretched(conformation, rate) - relaxing).ravel()

    def stress(self, state: np.ndarray, rate: float) -> np.ndarray:
        return self.modulus * self._tension(state.reshape(3, 3))
