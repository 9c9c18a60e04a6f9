"""What both commands say of one test of one material, and whether it is false."""

from pathlib import Path

import numpy as np
from every_test_records import NOISE, true_n1

PLANTED = {
    "declared": {},
    "giesekus": {"giesekus_mobility": {"alpha": 0.3}},
    "ptt": {"ptt_linear": {"epsilon": 0.2}},
    # in the modulus, with the exponent 1: t ds/dt = 1 − s − (γ̇/γ̇_c) s, so that k = 1/(γ̇_c t)
    "structure": {"thixotropy": {"breakdown": 0.25, "build_up_time": 2.0}},
}
TERMS = {"giesekus": {"sigma.sigma": 0.3}, "ptt": {"tr(sigma)*sigma": 0.2}}


def data_of(folder: Path):
    """Return the data of a folder, tables as the runs that they are."""
    import discover as dc

    data = dc.load_dataset(folder)
    return data if len(data) else data.with_material_functions()


def of_loop(folder: Path, material: str, base) -> dict:
    """Return what the loop says, and whether it is false."""
    import discover as dc

    loop = dc.close_loop(data_of(folder), base)
    planted = PLANTED[material]
    row = {"verdict": loop.verdict, "named": [], "constants": [], "false": []}
    for stage in loop.stages:
        names = {stage.effect, *stage.aliases}
        row["named"].append([stage.effect, *stage.aliases])
        if loop.verdict == "effects_added" and not names & planted.keys():
            row["false"].append(f"{stage.effect} is not there")
        true = planted.get(stage.effect, {})
        told = [
            (name, value, stage.parameters[name])
            for name, value in true.items()
            if name not in stage.left_open
        ]
        for one in stage.told_together if true else ():
            first, second = (true[name] for name in one.constants)
            told.append((one.name, first / second if one.is_ratio else first * second, one))
        for name, value, found in told:
            row["constants"].append([name, value, found.value, *found.ci95])
            low, high = found.ci95
            away = max(low - value, value - high)
            if np.isfinite([low, high]).all() and away > high - low:
                row["false"].append(f"{name} is {value:g} and not {low:.3g} to {high:.3g}")
    if loop.verdict == "no_effect_needed" and planted and loop.error_after.fit > 1.5 * NOISE:
        row["false"].append("something is needed")
    return row


def of_compare(folder: Path, material: str, base) -> dict:
    """Return what a comparison says, and whether it is false."""
    import discover as dc
    from discover.simulate import simulate

    found = dc.compare(data_of(folder), base, learners=["tensor_sindy"], library={"degree": 1})
    terms = found.outcomes["tensor_sindy"].terms
    row = {
        "verdict": found.explanation.verdict,
        "named": [[term.term] for term in terms],
        "constants": [],
        "undetermined": list(found.undetermined),
        "false": [],
    }
    planted = TERMS.get(material, {})
    for term in terms:
        if term.term in planted and term.ci95 is not None:
            low, high = term.ci95
            value = planted[term.term]
            row["constants"].append([term.term, value, term.coefficient, low, high])
            explained = row["verdict"] == "explained" and len(terms) == len(planted)
            if explained and max(low - value, value - high) > high - low:
                row["false"].append(f"{term.term} is {value:g} and not {low:.3g} to {high:.3g}")
    if row["verdict"] == "explained" and "N1" not in row["undetermined"]:
        times = np.linspace(0.1, 8.0, 40)
        fluid = found.equation("tensor_sindy").fluid()
        said = simulate(fluid, dc.start_up(2.0), times).first_normal_stress_difference
        exact = true_n1(material)
        miss = float(np.sqrt(np.mean((np.asarray(said) - exact) ** 2) / np.mean(exact**2)))
        row["n1_miss"] = miss
        if miss > 0.1:
            row["false"].append(f"N1 is off by {100 * miss:.0f} % and counts as determined")
    return row
