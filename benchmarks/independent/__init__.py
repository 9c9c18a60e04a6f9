"""Simulated rheometry that shares nothing with the software under test: numpy and scipy alone.

Laws, noise, bad instruments, and the writer of data folders. Every law is in Pa and s (G and λ are
1 by default) and answers `respond(flow, times)` with σ12, N1 and N2 in simple shear from rest.
"""

from independent.fene_p import FenePeterlin
from independent.flow import Flow, of_rate, oscillation, start_up, step_strain, steps
from independent.giesekus import Giesekus, multimode_giesekus
from independent.johnson_segalman import JohnsonSegalman
from independent.k_bkz import KBKZ
from independent.material import Material, Modes, RateLaw, Stresses, StressLaw
from independent.maxwell import Newtonian, UpperConvectedMaxwell
from independent.phan_thien_tanner import PhanThienTanner
from independent.pom_pom import ExtendedPomPom, PomPom
from independent.rolie_poly import RoliePoly
from independent.rolie_poly_blend import RoliePolyBlend
from independent.soft_glass import SoftGlass
from independent.structured import Structured
from independent.thixotropic import Thixotropic
from independent.white_metzner import WhiteMetzner

__all__ = [
    "KBKZ",
    "ExtendedPomPom",
    "FenePeterlin",
    "Flow",
    "Giesekus",
    "JohnsonSegalman",
    "Material",
    "Modes",
    "Newtonian",
    "PhanThienTanner",
    "PomPom",
    "RateLaw",
    "RoliePoly",
    "RoliePolyBlend",
    "SoftGlass",
    "StressLaw",
    "Stresses",
    "Structured",
    "Thixotropic",
    "UpperConvectedMaxwell",
    "WhiteMetzner",
    "multimode_giesekus",
    "of_rate",
    "oscillation",
    "start_up",
    "step_strain",
    "steps",
]
