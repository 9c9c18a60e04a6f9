"""Fluids and instruments of textbooks; and every case together."""

import numpy as np
from hostile_fluids_evaluators import pulled
from hostile_fluids_loud_cases import CASES as LOUD_AND_BEFORE
from hostile_fluids_materials import white
from hostile_fluids_records import (
    DAMPED,
    FITTED,
    GIESEKUS,
    SCALE,
    UCM,
    Case,
    alternating,
    changed,
    creeping,
    curve,
    only,
    recorded,
    stress_of,
    swept,
    wrong,
)
from hostile_fluids_textbook import (
    Acierno,
    Banding,
    Damped,
    FeneCR,
    PartlyRetracting,
    Waves,
    drops,
    leonov,
    of_doi_edwards,
    of_papanastasiou,
)
from independent.authors import ByAuthors
from independent.material import RateLaw

_LEONOV = {"planted": {"giesekus_mobility": {"alpha": 0.5}}, "terms": {"sigma.sigma": 0.5}}


_RETRACTING = {"same_as": ("partly_retracting_strands",)}
"""A name of `convective_constraint_release` where nothing is released: it is the same equation."""


def wobbling(columns: dict[str, np.ndarray]) -> np.ndarray:
    """Return the stress on a cone that wobbles by 5 %, once in a strain of 20."""
    step = np.diff(columns["time_s"], prepend=0.0)
    strain = np.cumsum(columns["shear_rate_1_s"] * step)
    return columns["stress_Pa"] * (1 + 0.05 * np.sin(2 * np.pi * strain / 20.0))


def _stretched(fluid: RateLaw):
    return pulled(fluid, lambda stress, times, rate: stress)


def _one(fluid: RateLaw):
    return only("held.csv", fluid)


def _case(name: str, words: str = "", records=recorded, **how) -> Case:
    truth, fluid, what = _FLUIDS[name]
    return Case(truth + words, records(fluid), **{"outside": not what, **what, **how})


_DROPS = ByAuthors(drops, {"affinity": 0.8}, SCALE["modulus"] / 0.8, SCALE["relaxation_time"])
_DAMPED = {"same_as": tuple(DAMPED), "outside": True}
"""Damped by strain, though not as e^{−nγ}: the name is right all the same."""
_FLUIDS = {
    "leonov": ("Leonov, in shear Giesekus with ½", ByAuthors(leonov, **SCALE), _LEONOV),
    "pec": ("Larson's partly retracting strands, ξ = 0.5", PartlyRetracting(), _RETRACTING),
    "rods": ("rigid rods, quadratic closure", PartlyRetracting(1.0), _RETRACTING),
    "fene_cr": ("FENE-CR, b = 20", FeneCR(), {}),
    "fene_cr_50": ("FENE-CR, b = 50", FeneCR(50.0), {}),
    "acierno": ("Acierno: modulus and time follow a structure", Acierno(), {}),
    "drops": ("drops that stay ellipsoids", _DROPS, {}),
    "doi_edwards": ("Doi–Edwards tubes", Damped(**SCALE, function=of_doi_edwards), _DAMPED),
    "psm": ("K-BKZ, h = 1/(1 + γ²/6)", Damped(**SCALE, function=of_papanastasiou), _DAMPED),
    "banding": ("Johnson–Segalman, bands across the gap", Banding(), {}),
    "waves": ("Maxwell, inertia of the fluid in the gap", Waves(), {}),
}
_ALTERNATING = ("pec", "rods", "fene_cr", "acierno", "drops")
_FITTED = ("pec", "drops", "doi_edwards", "banding", "waves", "acierno")
_PULLED = ("pec", "fene_cr", "drops", "acierno")
_CREEPING = ("pec", "fene_cr", "drops", "acierno")
TEXTBOOK = {
    **{name: _case(name) for name in _FLUIDS},
    **{f"{name}_quiet": _case(name, ", 0.3 % noise", noise=white(0.003)) for name in _FLUIDS},
    **{f"{name}_alternating": _case(name, ", in steady alternation", alternating)
       for name in _ALTERNATING},
    **{f"{name}_fitted": _case(name, ", modulus and time fitted", model=FITTED)
       for name in _FITTED},
    **{f"pulled_{name}": _case(name, " in extension", _stretched) for name in _PULLED},
    **{f"creep_{name}": _case(name, " in creep", creeping, model=wrong(solvent_viscosity_Pa_s=5.0))
       for name in _CREEPING},
    **{f"curve_{name}": _case(name, ", a flow curve", _one, tables=curve(_FLUIDS[name][1]))
       for name in ("pec", "drops", "acierno")},
    **{f"sweep_{name}": _case(name, ", an amplitude sweep", _one, tables=swept(_FLUIDS[name][1]))
       for name in ("drops", "acierno")},
    "wobble": Case("Giesekus on a cone that wobbles by 5 %",
                   changed(stress_of(wobbling), GIESEKUS), outside=True),
    "wobble_maxwell": Case("Maxwell on a cone that wobbles by 5 %",
                           changed(stress_of(wobbling), UCM), outside=True),
}  # fmt: skip

CASES: dict[str, Case] = {**LOUD_AND_BEFORE, **TEXTBOOK}
