"""Records of several tests of one fluid in one folder, of fluids inside and outside the library."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from every_test_records import MATERIALS, MODULUS, SOLVENT, TESTS, TIME, Folder, followed
from independent import FenePeterlin, Giesekus, Modes, PomPom, RoliePoly
from independent.material import RateLaw, Stresses, differences

TOGETHER = {
    "A": ("start_up", "creep", "flow_curve"),
    "B": ("laos", "uniaxial", "frequency_sweep"),
    "C": ("step_strain", "laos_stress", "amplitude_sweep"),
    "D": ("start_up", "cessation", "biaxial"),
}
UNSEEN_RATE = 3.0
"""Of a start-up in shear that no fit sees, in 1/s; between the rates of the start-ups."""


@dataclass(frozen=True)
class Case:
    """A fluid, and what an answer about it may say.

    Attributes
    ----------
    material
        By scipy, without the solvent.
    effects
        What of it the loop has a name for, with the constants.
    terms
        What of it the library of degree 1 holds, with the coefficients.
    by_mode
        Of effects with a constant of each mode, what it is, in the order of the modes.
    whole
        Whether names or terms say all of it.
    modes
        Moduli in Pa and relaxation times in s that are declared.
    """

    material: RateLaw
    effects: dict[str, dict[str, float]] = field(default_factory=dict)
    terms: dict[str, float] = field(default_factory=dict)
    by_mode: dict[str, tuple[float, ...]] = field(default_factory=dict)
    whole: bool = True
    modes: tuple[tuple[float, ...], tuple[float, ...]] = ((MODULUS,), (TIME,))


FLUIDS = {
    "declared": Case(MATERIALS["declared"]),
    "giesekus": Case(
        MATERIALS["giesekus"], {"giesekus_mobility": {"alpha": 0.3}}, {"sigma.sigma": 0.3}
    ),
    "ptt": Case(MATERIALS["ptt"], {"ptt_linear": {"epsilon": 0.2}}, {"tr(sigma)*sigma": 0.2}),
    "structure": Case(
        MATERIALS["structure"], {"thixotropy": {"breakdown": 0.25, "build_up_time": 2.0}}
    ),
    # release of constraints is a part of it, beside a stretch with a time of its own
    "rolie": Case(
        RoliePoly(1.0, 0.1, -0.5, MODULUS, TIME), {"convective_constraint_release": {}}, whole=False
    ),
    "fene": Case(
        FenePeterlin(modulus=MODULUS, relaxation_time=TIME), {"finite_extensibility": {"q": 0.02}}
    ),
    "pom": Case(PomPom(modulus=MODULUS, relaxation_time=TIME), whole=False),
    # one term, but a coefficient in each mode
    "modes": Case(
        Modes(Giesekus(0.1, 60.0, 3.0), Giesekus(0.5, 80.0, 0.4)),
        {"giesekus_mobility": {}},
        by_mode={"giesekus_mobility": (0.1, 0.5)},
        modes=((60.0, 80.0), (3.0, 0.4)),
        whole=False,
    ),
}


def write_records(path: Path, together: str, fluid: str, seed: int) -> None:
    """Write the tests of one combination, each with the noise of its own."""
    place = 1000 * list(FLUIDS).index(fluid) + 10 * list(TOGETHER).index(together)
    folder = Folder(path, seed + place)
    for test in TOGETHER[together]:
        TESTS[test](folder, FLUIDS[fluid].material)
    folder.close()


def unseen(fluid: str) -> tuple[np.ndarray, Stresses]:
    """Return times in s, and stresses in Pa without noise, of the start-up that no fit sees."""
    times = np.linspace(0.05, 8.0, 80)
    stress = followed(FLUIDS[fluid].material, lambda t: UNSEEN_RATE, times)
    return times, differences(list(stress))


def declared_fluid(fluid: str):
    """Return upper convected Maxwell with the modes and the solvent of a fluid."""
    import discover as dc

    return dc.Fluid(dc.make_law("ucm"), *map(list, FLUIDS[fluid].modes), SOLVENT)
