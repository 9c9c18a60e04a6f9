"""A material for every law that the software has a name for, with constants of its own."""

from collections.abc import Mapping

import independent as made
from independent import authors
from independent.authors import ByAuthors
from independent.material import RateLaw

CONSTANTS: dict[str, dict[str, float]] = {
    "ucm": {},
    "johnson_segalman": {"xi": 0.2},
    "giesekus": {"alpha": 0.3},
    "ptt_linear": {"epsilon": 0.25},
    "ptt_exponential": {"epsilon": 0.2},
    "fene_p": {"L2": 50.0},
    "giesekus_non_affine": {"alpha": 0.2, "xi": 0.1},
    "ptt_linear_non_affine": {"epsilon": 0.2, "xi": 0.15},
    "ptt_exponential_non_affine": {"epsilon": 0.2, "xi": 0.15},
    "xpp": {"q": 4.0, "stretch_time_ratio": 0.25, "alpha": 0.1},
    "pom_pom": {"q": 4.0, "stretch_time_ratio": 0.3},
    "pom_pom_drag_strain": {"q": 4.0, "stretch_time_ratio": 0.3},
    "rolie_poly": {"stretch_time_ratio": 0.2, "beta": 0.7},
    "rolie_poly_fene": {"stretch_time_ratio": 0.3, "beta": 0.5, "maximum_stretch": 2.0},
    "rolie_poly_blend": {"long_fraction": 0.3, "short_time_ratio": 0.1, "stretch_time_ratio": 0.2,
                         "short_stretch_time_ratio": 0.2, "beta": 1.0},
    "saramito": {"yield_strain": 0.4},
    "white_metzner": {"k": 0.8, "n": 0.4},
}  # fmt: skip
"""By the names of study files; chosen so that every constant shows at Weissenberg numbers of 1."""


def material(
    law: str, constants: Mapping[str, float], modulus: float = 1.0, relaxation_time: float = 1.0
) -> RateLaw:
    """Return the independent material of a law with a name.

    `law`: as studies spell it. `constants`: by the names of studies; times are over the relaxation
    time. `modulus`, `relaxation_time` in Pa and s.
    """
    scale = {"modulus": modulus, "relaxation_time": relaxation_time}
    c, time = constants, relaxation_time
    match law:
        case "ucm":
            return made.UpperConvectedMaxwell(**scale)
        case "johnson_segalman":
            return made.JohnsonSegalman(c["xi"], **scale)
        case "giesekus":
            return made.Giesekus(c["alpha"], **scale)
        case "fene_p":
            return made.FenePeterlin(c["L2"], **scale)
        case "xpp":
            return made.ExtendedPomPom(c["q"], c["alpha"], c["stretch_time_ratio"] * time, **scale)
        case "pom_pom" | "pom_pom_drag_strain":
            # growth of the stretch fades over the share of q that the software documents
            stretch, drag = c["stretch_time_ratio"] * time, law == "pom_pom_drag_strain"
            return made.PomPom(c["q"], stretch, modulus, time, drag, fade=0.05)
        case "rolie_poly":
            return made.RoliePoly(c["beta"], c["stretch_time_ratio"] * time, **scale)
        case "rolie_poly_blend":
            phi, short = c["long_fraction"], c["short_time_ratio"] * time
            stretch = c["stretch_time_ratio"] * time, c["short_stretch_time_ratio"] * short
            return made.RoliePolyBlend((phi, 1 - phi), (time, short), stretch, c["beta"], modulus)
    if law.startswith("ptt_"):
        kind = law.removeprefix("ptt_").partition("_")[0]
        return made.PhanThienTanner(c["epsilon"], kind, c.get("xi", 0.0), **scale)
    return ByAuthors(getattr(authors, law), dict(c), **scale)
