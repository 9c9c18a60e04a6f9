"""Every test that a rheometer makes, alone and several together: what each tells of a law.

Fluids by scipy with G = 100 Pa, λ = 1 s and 1 Pa s of solvent, told as upper convected Maxwell with
the right modes and solvent, with 1 % noise. A case is a test, or a combination of tests, of a
fluid. Counted as false, under a verdict that claims to explain: an effect with a name and a
probability of a half or more that is neither there nor an alias of what is; a constant outside
three half-widths of its interval; another law where the library holds the right one; N1 of a test
alone at 2 1/s, or σ12, N1 or N2 of tests together at 3 1/s, off by more than a tenth in a start-up
that no fit saw, and yet not undetermined. N2 is measured by N1.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from independent import FenePeterlin, Giesekus, Modes, PomPom, RateLaw, RoliePoly, Stresses
from independent.material import differences
from several_records import MATERIALS, MODULUS, NOISE, SOLVENT, TESTS, TIME, Folder, followed

QUESTIONS, SEED = ("compare", "close-loop"), 0
SURE, OFF = 0.5, 0.1
TOGETHER = {
    "A": ("start_up", "creep", "flow_curve"), "B": ("laos", "uniaxial", "frequency_sweep"),
    "C": ("step_strain", "laos_stress", "amplitude_sweep"),
    "D": ("start_up", "cessation", "biaxial"),
}  # fmt: skip


@dataclass(frozen=True)
class Fluid:
    """A fluid without its solvent, and what an answer about it may say.

    Effects and terms have constants, by mode where each has its own; `whole` if they say all of it;
    the moduli in Pa and relaxation times in s of `modes` are declared.
    """

    material: RateLaw
    effects: dict[str, dict[str, float]] = field(default_factory=dict)
    terms: dict[str, float] = field(default_factory=dict)
    by_mode: dict[str, tuple[float, ...]] = field(default_factory=dict)
    whole: bool = True
    modes: tuple[tuple[float, ...], tuple[float, ...]] = ((MODULUS,), (TIME,))


_SCALE = {"modulus": MODULUS, "relaxation_time": TIME}
FLUIDS = {
    "declared": Fluid(MATERIALS["declared"]),
    "giesekus": Fluid(MATERIALS["giesekus"], {"giesekus_mobility": {"alpha": 0.3}},
                      {"sigma.sigma": 0.3}),
    "ptt": Fluid(MATERIALS["ptt"], {"ptt_linear": {"epsilon": 0.2}}, {"tr(sigma)*sigma": 0.2}),
    # in the modulus, with the exponent 1: t ds/dt = 1 − s − (γ̇/γ̇_c) s, so that k = 1/(γ̇_c t)
    "structure": Fluid(MATERIALS["structure"],
                       {"thixotropy": {"breakdown": 0.25, "build_up_time": 2.0}}),
    # release of constraints is a part of it, beside a stretch with a time of its own
    "rolie": Fluid(RoliePoly(1.0, 0.1, -0.5, MODULUS, TIME), {"convective_constraint_release": {}},
                   whole=False),
    "fene": Fluid(FenePeterlin(**_SCALE), {"finite_extensibility": {"q": 0.02}}),
    "pom": Fluid(PomPom(**_SCALE), whole=False),
    # one term, but a coefficient in each mode
    "modes": Fluid(Modes(Giesekus(0.1, 60.0, 3.0), Giesekus(0.5, 80.0, 0.4)),
                   {"giesekus_mobility": {}}, by_mode={"giesekus_mobility": (0.1, 0.5)},
                   modes=((60.0, 80.0), (3.0, 0.4)), whole=False),
}  # fmt: skip
GROUPS = {
    **{test: [f"{test} {fluid}" for fluid in MATERIALS] for test in TESTS},
    **{together: [f"{together} {fluid}" for fluid in FLUIDS] for together in TOGETHER},
}
GROUPS |= {"alone": [n for test in TESTS for n in GROUPS[test]],
           "together": [n for one in TOGETHER for n in GROUPS[one]]}  # fmt: skip


def names(seed: int) -> list[str]:
    del seed
    return [*GROUPS["alone"], *GROUPS["together"]]


def write(name: str, seed: int, path: Path) -> Path:
    """Write the records of a case, the same whatever else is asked for."""
    tests, fluid = name.split(" ")
    places, fluids = (TOGETHER, FLUIDS) if tests in TOGETHER else (TESTS, MATERIALS)
    place = 1000 * list(fluids).index(fluid) + 10 * list(places).index(tests)
    folder = Folder(path, seed + place)
    for test in TOGETHER.get(tests, (tests,)):
        TESTS[test](folder, FLUIDS[fluid].material)
    return folder.close()


def run(name: str, question: str, seed: int, folder: Path) -> dict:
    """Return the row of one case and question."""
    import discover as dc

    tests, fluid = name.split(" ")
    data = dc.load_dataset(write(name, seed, folder / "data"))
    if tests in TOGETHER or not len(data):
        data = data.with_material_functions()
    base = dc.Fluid(dc.make_law("ucm"), *map(list, FLUIDS[fluid].modes), SOLVENT)
    row = empty()
    alone = tests not in TOGETHER
    if question == "close-loop":
        loop, open_ = dc.close_loop(data, base), ["N1", "N2"]
    else:
        options = {"learners": ["tensor_sindy"], "library": {"degree": 1}}
        found = dc.compare(data, base, **options)
        loop, open_ = found.posterior, list(found.undetermined)
        row["undetermined"] = open_
    of_loop(row, FLUIDS[fluid], loop)
    try:
        said = loop.equation().fluid()
    except dc.InputError:
        said = None  # a state that no equation of stress and rate carries
    claimed = row["verdict"] == "effects_added"
    if alone and question == "close-loop":
        said = None
    if said is not None:
        exact = unseen(fluid, 2.0 if alone else 3.0)
        _unseen(row, said, *exact, claimed, ["sigma12", "N2", *open_] if alone else open_)
    return row


def empty() -> dict[str, Any]:
    """Return a row of which nothing is said yet."""
    return {"named": [], "constants": [], "false": [], "notes": [], "unseen": {}}


def of_loop(row: dict, fluid: Fluid, loop) -> None:
    """Judge names and constants of a closed loop, or of the posterior of a comparison."""
    import discover as dc

    row["verdict"], row["error"] = loop.verdict, loop.error_after.fit
    inclusion = loop.explanations.inclusion
    row["inclusion"] = dict(inclusion)
    row["none_of_these"] = loop.explanations.unexplained_probability
    claimed = loop.verdict == "effects_added"
    for stage in loop.stages:
        names, true = [stage.effect, *stage.aliases], fluid.effects.get(stage.effect, {})
        row["named"].append(names)
        # of a fluid outside, terms without a name describe; its prediction judges them
        with_name = stage.effect in dc.effects().index or fluid.whole
        sure = claimed and inclusion.get(stage.effect, 1.0) >= SURE
        if sure and with_name and not fluid.effects.keys() & set(names):
            row["false"].append(f"{stage.effect} is not there")
        for name in true.keys() - {*stage.left_open}:
            found = stage.parameters[name]
            _constant(row, name, true[name], found.value, found.ci95, claimed)
        (*_, last) = stage.parameters.values()
        pairs = zip(fluid.by_mode.get(stage.effect, ()), getattr(last, "modes", ()), strict=False)
        for value, one in pairs:
            name = f"at {one.relaxation_time_s:g} s"
            _constant(row, name, value, one.value, one.ci95, claimed)
    if loop.verdict == "no_effect_needed" and fluid.effects and row["error"] > 1.5 * NOISE:
        row["false"].append("something is needed")


def _constant(row, name: str, value: float, found: float, interval, claimed: bool) -> None:
    """Add a constant to a row, and that it is false if it is off by three half-widths."""
    low, high = (np.nan, np.nan) if interval is None else interval
    row["constants"].append([name, value, found, low, high])
    away = max(low - value, value - high)
    if claimed and np.isfinite([low, high]).all() and away > high - low:
        row["false"].append(f"{name} is {value:g} and not {low:.3g} to {high:.3g}")


def unseen(fluid: str, rate: float) -> tuple[float, np.ndarray, Stresses]:
    """Return the rate, times in s and stresses in Pa of a start-up that no fit sees."""
    times = np.linspace(0.1, 8.0, 40) if rate == 2.0 else np.linspace(0.05, 8.0, 80)
    stress = followed(FLUIDS[fluid].material, lambda t: rate, times)
    return rate, times, differences(list(stress))


def _unseen(row, said, rate, times, exact: Stresses, claimed: bool, open_) -> None:
    """Add how far a law misses a start-up that no fit saw, and that it is false where claimed."""
    import discover as dc
    from discover.simulate import SimulationError, simulate

    try:
        stress = simulate(said, dc.start_up(rate), times)
        predicted = (stress.shear_stress, stress.first_normal_stress_difference,
                     stress.second_normal_stress_difference)  # fmt: skip
    except SimulationError:  # the law runs away there
        predicted = (np.inf,) * 3
    for quantity, there in zip(("sigma12", "N1", "N2"), predicted, strict=True):
        true = getattr(exact, quantity)
        size = exact.N1 if quantity == "N2" else true  # N2 may be zero
        miss = float(np.sqrt(np.mean((np.asarray(there) - true) ** 2) / np.mean(size**2)))
        row["unseen"][quantity] = miss
        if claimed and quantity not in open_ and not miss < OFF:
            row["false"].append(f"{quantity} is off by {100 * miss:.0f} % and not open")


def line(row: dict) -> str:
    """Return one answer as it stands in a table."""
    told = ", ".join(f"{n} {v:.3g} ({a:.3g} to {b:.3g})" for n, _, v, a, b in row["constants"])
    named = ", ".join(" or ".join(f"`{one}`" for one in names[:3]) for names in row["named"])
    parts = [(named or "nothing") + (f": {told}" if told else "")]
    parts += ["*unexplained*"] if row["verdict"] == "unexplained" else []
    if row.get("undetermined"):
        parts.append(f"open: {', '.join(row['undetermined'])}")
    if row["unseen"]:
        parts.append(", ".join(f"{q} {100 * miss:.2g} %" for q, miss in row["unseen"].items()))
    return "; ".join(parts)


def counted(question: str, rows: list[dict]) -> str:
    """Return how many answers hold something false, and how many intervals their constant."""
    held = [a <= v <= b for r in rows if r["verdict"] != "unexplained"
            for _, v, _, a, b in r.get("constants", ())]  # fmt: skip
    false = sum(bool(r.get("false")) for r in rows)
    explained = sum(r["verdict"] not in ("unexplained", "no_signal") for r in rows)
    return (f"{question}: {len(rows)} answers, {explained} explained, {false} with something "
            f"false; intervals {sum(held)} of {len(held)}")  # fmt: skip


def table(rows: list[dict]) -> str:
    """Return a table for each command, and how many answers hold something false."""
    lines = []
    for question in QUESTIONS:
        some = {r["case"]: r for r in rows if r["question"] == question}
        lines += ["", counted(question, list(some.values())), ""]
        lines += [f"| test | {' | '.join(FLUIDS)} |", "|---" * (1 + len(FLUIDS)) + "|"]
        for test in (*TESTS, *TOGETHER):
            found = [some.get(f"{test} {fluid}") for fluid in FLUIDS]
            cells = [
                "" if r is None else f"*{r['verdict']}*" if "message" in r
                else "; ".join([line(r), *(f"**{one}**" for one in r["false"])])
                for r in found
            ]  # fmt: skip
            if any(cells):
                lines.append(f"| {test} | {' | '.join(cells)} |")
    return "\n".join(lines)
