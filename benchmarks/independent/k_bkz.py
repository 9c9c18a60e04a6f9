"""Integral law of Kaye and Bernstein, Kearsley & Zapas with Wagner's damping function."""

from dataclasses import dataclass

import numpy as np

from independent.flow import Flow
from independent.material import Material, Stresses

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
