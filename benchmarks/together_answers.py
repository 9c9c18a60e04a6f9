"""What both commands say of several tests of one fluid, and whether it is false."""

from pathlib import Path
from typing import Any

import numpy as np
from together_records import FLUIDS, UNSEEN_RATE, Case, declared_fluid, unseen

SURE, OFF = 0.5, 0.1


def of_loop(folder: Path, fluid: str) -> dict[str, Any]:
    """Return what the loop says, and whether it is false."""
    import discover as dc

    loop = dc.close_loop(_data(folder), declared_fluid(fluid))
    case = FLUIDS[fluid]
    row: dict[str, Any] = _empty(loop.verdict) | {"error": loop.error_after.fit}
    sure = {name for name, p in loop.explanations.inclusion.items() if p >= SURE}
    row["inclusion"] = dict(loop.explanations.inclusion)
    row["none_of_these"] = loop.explanations.unexplained_probability
    for stage in loop.stages:
        names = [stage.effect, *stage.aliases]
        row["named"].append(names)
        held = loop.verdict == "effects_added" and stage.effect in sure
        # of a fluid outside, terms without a name describe; its prediction judges them
        with_name = stage.effect in dc.effects().index
        if held and not case.effects.keys() & set(names) and (with_name or case.whole):
            row["false"].append(f"{stage.effect} is not there")
        for name, value in case.effects.get(stage.effect, {}).items():
            found = stage.parameters[name]
            _constant(row, name, value, found.value, found.ci95, loop.verdict == "effects_added")
        for value, one in zip(case.by_mode.get(stage.effect, ()), _modes(stage), strict=False):
            name = f"at {one.relaxation_time_s:g} s"
            _constant(row, name, value, one.value, one.ci95, loop.verdict == "effects_added")
    if loop.verdict == "no_effect_needed" and case.effects:
        row["note"] = "nothing named"
    try:
        said = loop.equation().fluid()
    except dc.InputError:
        return row  # a state that no equation of stress and rate carries
    _unseen(row, fluid, said, loop.verdict == "effects_added", open_=("N1", "N2"))
    return row


def of_compare(folder: Path, fluid: str) -> dict[str, Any]:
    """Return what a comparison says, and whether it is false."""
    import discover as dc

    found = dc.compare(
        _data(folder), declared_fluid(fluid), learners=["tensor_sindy"], library={"degree": 1}
    )
    case, terms = FLUIDS[fluid], found.outcomes["tensor_sindy"].terms
    verdict = found.explanation.verdict
    row: dict[str, Any] = _empty(verdict) | {"undetermined": list(found.undetermined)}
    row["named"] = [[term.term] for term in terms]
    fits = found.explanation.lack_of_fit
    row["error"] = fits["tensor_sindy"].misfit if "tensor_sindy" in fits else None
    row["by_mode"] = None if found.by_mode is None else found.by_mode.to_json()
    by_mode(row, case)
    explained = verdict == "explained"
    for term in terms:
        if term.term in case.terms and term.ci95 is not None:
            alone = explained and len(terms) == len(case.terms)
            value = case.terms[term.term]
            _constant(row, term.term, value, term.coefficient, term.ci95, alone)
    if explained and _inside(case) and {t.term for t in terms} != case.terms.keys():
        row["false"].append("another law is called an explanation")
    _unseen(row, fluid, found.equation("tensor_sindy").fluid(), explained, row["undetermined"])
    return row


def by_mode(row: dict[str, Any], case: Case) -> None:
    """Add to a row of a comparison what its law with a constant of each mode says."""
    law = row.get("by_mode")
    if law is None or law["verdict"] != "explained":
        return
    for effect, found in law["constants"].items():
        if effect not in case.effects:
            row["false"].append(f"{effect} by mode is not there")
        for value, one in zip(case.by_mode.get(effect, ()), found["modes"], strict=False):
            name = f"at {one['relaxation_time_s']:g} s"
            _constant(row, name, value, one["value"], one["ci95"], claimed=True)


def _modes(stage) -> tuple:
    """Return the constant of each mode, none where there is one of all."""
    (*_, last) = stage.parameters.values()
    return getattr(last, "modes", ())


def _data(folder: Path):
    import discover as dc

    return dc.load_dataset(folder).with_material_functions()


def _empty(verdict: str) -> dict[str, Any]:
    return {"verdict": verdict, "named": [], "constants": [], "false": [], "unseen": {}}


def _inside(case: Case) -> bool:
    """Return whether the library of degree 1 holds the law, one coefficient for all modes."""
    return case.whole and case.effects.keys() <= {"giesekus_mobility", "ptt_linear"}


def _constant(row, name: str, value: float, found: float, interval, claimed: bool) -> None:
    """Add a constant to a row, and that it is false if it is off by three half-widths."""
    low, high = (np.nan, np.nan) if interval is None else interval
    row["constants"].append([name, value, found, low, high])
    away = max(low - value, value - high)
    if claimed and np.isfinite([low, high]).all() and away > high - low:
        row["false"].append(f"{name} is {value:g} and not {low:.3g} to {high:.3g}")


def _unseen(row, fluid: str, said, claimed: bool, open_) -> None:
    """Add how far a law misses a start-up that no fit saw, and that it is false where claimed."""
    import discover as dc
    from discover.simulate import SimulationError, simulate

    times, exact = unseen(fluid)
    try:
        stress = simulate(said, dc.start_up(UNSEEN_RATE), times)
    except SimulationError:  # the law runs away there
        predicted = dict.fromkeys(("sigma12", "N1", "N2"), np.inf)
    else:
        predicted = {
            "sigma12": stress.shear_stress,
            "N1": stress.first_normal_stress_difference,
            "N2": stress.second_normal_stress_difference,
        }
    for quantity, there in predicted.items():
        true = getattr(exact, quantity)
        # N2 may be zero, and is measured by N1
        size = exact.N1 if quantity == "N2" else true
        miss = float(np.sqrt(np.mean((np.asarray(there) - true) ** 2) / np.mean(size**2)))
        row["unseen"][quantity] = miss
        if claimed and quantity not in open_ and not miss < OFF:
            row["false"].append(f"{quantity} is off by {100 * miss:.0f} % and not open")
