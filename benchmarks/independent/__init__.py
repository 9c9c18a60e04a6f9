"""Simulated rheometry that shares nothing with the software under test: numpy and scipy alone.

Laws, noise, bad instruments, and the writer of data folders. Every law is in Pa and s (G and λ are
1 by default) and answers `respond(flow, times)` with σ12, N1 and N2 in simple shear from rest.
"""

from independent.chains import KBKZ, ExtendedPomPom, PomPom, RoliePoly, RoliePolyBlend
from independent.flow import Flow, of_rate, oscillation, start_up, step_strain, steps
from independent.laws import (
    FenePeterlin,
    Giesekus,
    JohnsonSegalman,
    Newtonian,
    PhanThienTanner,
    UpperConvectedMaxwell,
    WhiteMetzner,
    multimode_giesekus,
)
from independent.material import Material, Modes, RateLaw, Stresses, StressLaw
from independent.structures import SoftGlass, Structured, Thixotropic

__all__ = [
    "KBKZ", "ExtendedPomPom", "FenePeterlin", "Flow", "Giesekus", "JohnsonSegalman", "Material",
    "Modes", "Newtonian", "PhanThienTanner", "PomPom", "RateLaw", "RoliePoly", "RoliePolyBlend",
    "SoftGlass", "StressLaw", "Stresses", "Structured", "Thixotropic", "UpperConvectedMaxwell",
    "WhiteMetzner", "multimode_giesekus", "of_rate", "oscillation", "start_up", "step_strain",
    "steps",
]  # fmt: skip
