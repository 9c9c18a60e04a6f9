"""Fluids that no library or dictionary holds, in white noise of 5 and 10 % of each record."""

from hostile_fluids_folders_cases import CASES as FOLDERS_AND_BEFORE
from hostile_fluids_materials import white
from hostile_fluids_records import POM_POM, SCALE, Case, recorded
from independent import (
    KBKZ,
    ExtendedPomPom,
    Giesekus,
    Modes,
    PomPom,
    RoliePoly,
    SoftGlass,
    WhiteMetzner,
)
from independent.named import material

_RELEASE = ("convective_constraint_release",)
_TWO = Modes(*map(Giesekus, (0.1, 0.5), (60.0, 80.0), (3.0, 0.4)))
_STRETCHED = {"stretch_time_ratio": 0.3, "beta": 0.5, "maximum_stretch": 2.0}
_FLUIDS = {
    "k_bkz": ("K-BKZ, damping 0.5", KBKZ(0.5, **SCALE), ("strain_damping",)),
    "pom_pom": ("pom-pom of five arms", POM_POM, ()),
    "pom_pom_2": ("pom-pom of two arms", PomPom(2.0, 0.3, **SCALE), ()),
    "extended": ("extended pom-pom", ExtendedPomPom(4.0, 0.1, 0.25, **SCALE), ()),
    "extended_0": ("the same without mobility", ExtendedPomPom(8.0, 0.0, 0.4, **SCALE), ()),
    "rolie_poly": ("Rolie–Poly", RoliePoly(1.0, 0.1, **SCALE), _RELEASE),
    "rolie_poly_slow": ("the same, slower stretch", RoliePoly(0.5, 0.3, **SCALE), _RELEASE),
    "rolie_poly_fene": ("Rolie–Poly of finite stretch",
                        material("rolie_poly_fene", _STRETCHED, 100.0), _RELEASE),
    "white_metzner": ("White–Metzner", WhiteMetzner(0.5, **SCALE), ()),
    "carreau": ("White–Metzner by Carreau",
                material("white_metzner", {"k": 0.8, "n": 0.4}, 100.0), ()),
    "soft_glass": ("a soft glass", SoftGlass(0.2, 0.2, **SCALE), ()),
    "two_modes": ("Giesekus in two modes", _TWO, ("relaxation_mode", "giesekus_mobility")),
}  # fmt: skip

LOUD = {
    f"loud_{percent}_{name}": Case(
        f"{truth}, {percent} % noise", recorded(fluid), white(percent / 100.0), outside=True,
        same_as=same_as,
    )
    for percent in (5, 10)
    for name, (truth, fluid, same_as) in _FLUIDS.items()
}  # fmt: skip

CASES: dict[str, Case] = {**FOLDERS_AND_BEFORE, **LOUD}
