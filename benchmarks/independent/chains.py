"""Laws of entangled chains and of integrals over strain, in Pa and s; a source stands with each."""

from dataclasses import dataclass

import numpy as np

from independent.flow import Flow
from independent.material import (
    Material,
    Rate,
    RateLaw,
    Stresses,
    StressLaw,
    rate_tensor,
    stretched,
    velocity_gradient,
)


@dataclass(frozen=True)
class RoliePoly(RateLaw):
    """A▽ = −(A − I)/τ_d − (2/τ_R)(1 − √(3/tr A))(A + β (tr A/3)^δ (A − I)), σ = G (A − I).

    Without stretch (τ_R = 0): A▽ = −(A − I)/τ_d − (2/3)(L:A)(A + β (A − I)), which keeps tr A = 3.
    [Likhtman & Graham 2003, JNNFM 114, 1, eqs. 11 and 12]
    """

    release: float = 1.0  # β
    stretch_time: float = 0.1  # τ_R, s; 0: no stretch
    exponent: float = -0.5  # δ
    modulus: float = 1.0
    relaxation_time: float = 1.0  # τ_d, s

    def rest(self) -> np.ndarray:
        return np.eye(3).ravel()

    def change(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        a, one = state.reshape(3, 3), np.eye(3)
        change = stretched(a, rate) - (a - one) / self.relaxation_time
        if self.stretch_time == 0.0:
            retraction = 2 / 3 * np.sum(velocity_gradient(rate) * a)
            return (change - retraction * (a + self.release * (a - one))).ravel()
        trace = max(np.trace(a), 1e-12)  # below 3 only in trial steps
        retraction = 2 / self.stretch_time * (1 - np.sqrt(3 / trace))
        released = self.release * (trace / 3) ** self.exponent
        return (change - retraction * (a + released * (a - one))).ravel()

    def stress(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        return self.modulus * (state.reshape(3, 3) - np.eye(3))


@dataclass(frozen=True)
class RoliePolyBlend(RateLaw):
    """Four conformations A_ij of chains i along entanglements with chains j, 1 long and 2 short.

    A_ij▽ = −(A_ij − I)/(2 τ_d,i) − (2/τ_s,i)((Λ_i − 1)/Λ_i) A_ij
            − [1/(2 τ_d,j) + β (2/τ_s,j)((Λ_j − 1)/Λ_j) Λ_i^{−1}] (A_ij − I),
    Λ_i² = tr A_i/3, A_i = Σ φ_j A_ij, σ = G (Σ φ_i A_i − I)
    [Boudara, Peterson, Leal & Read 2019, J. Rheol. 63, 71, with β_th = 1].
    """

    share: tuple[float, float] = (0.3, 0.7)
    relaxation_time: tuple[float, float] = (1.0, 0.1)  # τ_d, s
    stretch_time: tuple[float, float] = (0.1, 0.02)  # τ_s, s
    release: float = 1.0  # β
    modulus: float = 1.0

    def rest(self) -> np.ndarray:
        return np.tile(np.eye(3), (2, 2, 1, 1)).ravel()

    def change(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        a, one = state.reshape(2, 2, 3, 3), np.eye(3)
        stretch, out = [], np.zeros((2, 2, 3, 3))
        for i in range(2):
            of_chain = self.share[0] * a[i, 0] + self.share[1] * a[i, 1]
            stretch.append(np.sqrt(max(np.trace(of_chain) / 3.0, 1e-12)))
        drawn = [2.0 / t * (x - 1.0) / x for t, x in zip(self.stretch_time, stretch, strict=True)]
        for i in range(2):
            for j in range(2):
                lost = 0.5 / self.relaxation_time[i] + 0.5 / self.relaxation_time[j]
                lost += self.release * drawn[j] / stretch[i]
                out[i, j] = stretched(a[i, j], rate) - lost * (a[i, j] - one) - drawn[i] * a[i, j]
        return out.ravel()

    def stress(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        weights = np.outer(self.share, self.share)
        mean = np.tensordot(weights, state.reshape(2, 2, 3, 3), axes=2)
        return self.modulus * (mean - np.eye(3))


@dataclass(frozen=True)
class PomPom(RateLaw):
    """A▽ = −(A − I/3)/τ_b, S = A/tr A, Λ' = Λ (L:S) − (Λ − 1) e^{2(Λ−1)/(q−1)}/τ_s.

    σ = 3 G Λ² S − G I   [McLeish & Larson 1998, J. Rheol. 42, 81, differential approximation; the
    exponential of Blackwell, McLeish & Harlen 2000, J. Rheol. 44, 121, which the first have not].
    Λ grows no further than q; growth fades on the way there, so that an integrator can follow.
    """

    arms: float = 5.0  # q
    stretch_time: float = 0.4  # τ_s, s
    modulus: float = 1.0
    relaxation_time: float = 1.0  # τ_b, s
    drag_strain: bool = True  # whether there is the exponential
    fade: float = 0.02  # share of q over which growth fades

    def rest(self) -> np.ndarray:
        return np.append(np.eye(3).ravel() / 3, 1.0)

    def change(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        a, stretch = state[:9].reshape(3, 3), state[9]
        turned = stretched(a, rate) - (a - np.eye(3) / 3) / self.relaxation_time
        drawn = stretch * np.sum(velocity_gradient(rate) * a) / np.trace(a)
        # far outside (0, q) only in trial steps of the integrator
        fast = np.exp(min(2 / (self.arms - 1) * (stretch - 1), 50.0)) if self.drag_strain else 1.0
        grown = drawn - (stretch - 1) * fast / self.stretch_time
        if grown > 0.0:
            grown *= min(max((self.arms - stretch) / (self.fade * self.arms), 0.0), 1.0)
        return np.append(turned.ravel(), grown)

    def stress(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        a = state[:9].reshape(3, 3)
        return self.modulus * (3 * state[9] ** 2 * a / np.trace(a) - np.eye(3))


@dataclass(frozen=True)
class ExtendedPomPom(StressLaw):
    """σ▽ + [(α/G) σ·σ + f σ + G (f − 1) I]/λ_b = G γ̇.

    f = 2 (λ_b/λ_s) e^{2(Λ−1)/q} (1 − 1/Λ) + (1 − α tr(σ·σ)/(3 G²))/Λ², Λ² = 1 + tr σ/(3G)
    [Verbeeten, Peters & Baaijens 2001, J. Rheol. 45, 823, single-equation form].
    """

    arms: float = 5.0  # q
    anisotropy: float = 0.1  # α
    stretch_time: float = 0.4  # λ_s, s
    modulus: float = 1.0
    relaxation_time: float = 1.0  # λ_b, s

    def stress_change(self, stress: np.ndarray, rate: Rate) -> np.ndarray:
        g, a = self.modulus, self.anisotropy
        square = stress @ stress
        stretch = np.sqrt(max(1 + np.trace(stress) / (3 * g), 1e-12))
        fast = np.exp(min(2 / self.arms * (stretch - 1), 50.0))
        f = 2 * self.relaxation_time / self.stretch_time * fast * (1 - 1 / stretch)
        f += (1 - a * np.trace(square) / (3 * g**2)) / stretch**2
        relaxing = a / g * square + f * stress + g * (f - 1) * np.eye(3)
        return g * rate_tensor(rate) + stretched(stress, rate) - relaxing / self.relaxation_time


_PANELS_PER_TIME = 12
_STRAIN_PER_PANEL = 0.15
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)


@dataclass(frozen=True)
class KBKZ(Material):
    """σ12 = ∫ m(t − t') h(|γ|) γ dt', N1 the same with γ², N2 = ψ N1; γ = γ(t) − γ(t').

    m(s) = (G/λ) e^{−s/λ}, h = e^{−n|γ|}   [Kaye 1962; Bernstein, Kearsley & Zapas 1963, Trans. Soc.
    Rheol. 7, 391; Wagner 1976, Rheol. Acta 15, 136]; n = 0 is Lodge's rubberlike liquid. From rest:
    the fluid before t = 0 counts with its whole memory, G e^{−t/λ}.
    """

    damping: float = 0.2  # n
    normal_ratio: float = -0.15  # ψ
    modulus: float = 1.0
    relaxation_time: float = 1.0

    def damped(self, strain: np.ndarray) -> np.ndarray:
        """Return h(γ)."""
        return np.exp(-self.damping * np.abs(strain))

    def respond(self, flow: Flow, times: np.ndarray) -> Stresses:
        """Return the stresses in a flow from rest, by Gauss–Legendre quadrature between knots."""
        times = np.asarray(times, float)
        end, lam = float(times[-1]), self.relaxation_time
        fine = np.linspace(0.0, end, 2001)
        path = np.sum(np.abs(np.diff(np.asarray(flow.strain(fine), float))))
        panels = int(np.ceil(max(_PANELS_PER_TIME * end / lam, path / _STRAIN_PER_PANEL, 8)))
        knots = np.unique([*np.linspace(0.0, end, panels + 1), *times, *flow.jumps, 0.0])
        knots = knots[knots <= end]
        middle, half = (knots[1:] + knots[:-1]) / 2, np.diff(knots) / 2
        past = (middle[:, None] + half[:, None] * _NODES).ravel()
        weight = (half[:, None] * _WEIGHTS).ravel()
        strain_then = np.asarray(flow.strain(past), float)
        shear, first = np.empty_like(times), np.empty_like(times)
        for i, (time, now) in enumerate(zip(times, flow.strain(times), strict=True)):
            seen = past < time
            strain = np.append(now - strain_then[seen], now)
            memory = np.append(
                weight[seen] / lam * np.exp(-(time - past[seen]) / lam), np.exp(-time / lam)
            )
            kernel = self.modulus * memory * self.damped(strain) * strain
            shear[i], first[i] = np.sum(kernel), np.sum(kernel * strain)
        return Stresses(shear, first, self.normal_ratio * first)
