"""What the cases of `calibration` add up to: how often what was said was so."""

from collections.abc import Sequence

import numpy as np
from scipy.stats import beta

Cases = Sequence[dict]
WHOLE = 0.9
"""A run counts as held with so many of its samples in the band."""

TENTH = 0.1
"""A quantity that is said to be determined may be off by so much of N1."""


def share(hits: int, of: int) -> str:
    """Return a count with its 95 % interval   [Clopper & Pearson 1934, Biometrika 26, 404]."""
    if not of:
        return "0 of 0"
    low = beta.ppf(0.025, hits, of - hits + 1) if hits else 0.0
    high = beta.ppf(0.975, hits + 1, of - hits) if hits < of else 1.0
    return f"{hits} of {of} ({100 * low:.0f} to {100 * high:.0f} %)"


def is_right(members: Sequence[Sequence[str]], effects: Sequence[Sequence[str]] | None) -> bool:
    """Whether one set of a class of twins names each effect that is there once, and no other."""
    if effects is None:
        return False
    for names in members:
        found = [next((i for i, right in enumerate(effects) if n in right), None) for n in names]
        if None not in found and sorted(found) == list(range(len(effects))):
            return True
    return False


def calibration_error(said: np.ndarray, so: np.ndarray, bins: int = 10) -> tuple[float, list[str]]:
    """Return the expected calibration error, and the lines of a reliability diagram.

    `said`: probabilities, shape (n,). `so`: whether each was so, shape (n,). `bins`: of equal
    width.
    """
    place = np.minimum((said * bins).astype(int), bins - 1)
    error, lines = 0.0, []
    for bin_ in range(bins):
        among = place == bin_
        if not np.any(among):
            continue
        stated, true = float(np.mean(said[among])), float(np.mean(so[among]))
        error += np.mean(among) * abs(stated - true)
        count = int(np.count_nonzero(among))
        lines.append(f"  said {stated:.2f}: so in {share(int(np.sum(so[among])), count)}")
    return float(error), lines


def loop_table(cases: Cases) -> str:
    """Return the table of what closed loops said and what was so."""
    inside = [c for c in cases if c["effects"] is not None]
    outside = [c for c in cases if c["effects"] is None]
    clean = [c for c in inside if not c["effects"]]
    planted = [c for c in inside if c["effects"]]
    lines = [f"{len(cases)} closed loops, {len(inside)} of what has a name"]
    first = [c["explanations"][0]["members"] if c["explanations"] else [] for c in planted]
    right = [is_right(m, c["effects"]) for m, c in zip(first, planted, strict=True)]
    lines.append(f"what is there in the likeliest class: {share(sum(right), len(right))}")
    for number in (1, 2):
        some = [r for r, c in zip(right, planted, strict=True) if len(c["effects"]) == number]
        lines.append(f"  {number} at a time: {share(sum(some), len(some))}")
    for what in ("protocol", "noise"):
        for kind in sorted({c[what] for c in planted}):
            some = [r for r, c in zip(right, planted, strict=True) if c[what] == kind]
            lines.append(f"  {what} {kind}: {share(sum(some), len(some))}")
    beside = sum(bool(_beside(c)) for c in planted)
    lines.append(f"a name beside it, 50 % or more: {share(beside, len(planted))}")
    named = sum(c["verdict"] == "effects_added" for c in clean)
    lines.append(f"an effect named where there is none: {share(named, len(clean))}")
    open_ = sum(c["verdict"] == "unexplained" for c in inside)
    lines.append(f"unexplained where all has a name: {share(open_, len(inside))}")
    met = sum(c["verdict"] in ("unexplained", "no_signal") for c in outside)
    lines.append(f"unexplained where something has none: {share(met, len(outside))}")
    missed = [c for c in outside if c["verdict"] not in ("unexplained", "no_signal")]
    lines += [f"  but: {_case(c)}: {c['verdict']}, {_first(c)}" for c in missed]
    found = [f for c in planted for f in c["constants"]]
    held = sum(f["ci95"][0] <= f["truth"] <= f["ci95"][1] for f in found)
    lines.append(f"95 % intervals that hold the constant: {share(held, len(found))}")
    for name, some in (("all has a name", inside), ("something has none", outside)):
        lines.append(_coverage(f"band of held-out runs, {name}", _bands(some)))
    said = [
        (e["probability"], is_right(e["members"], c["effects"]))
        for c in cases
        for e in c["explanations"]
    ]
    said += [(c["unexplained_probability"], c["effects"] is None) for c in cases]
    error, diagram = calibration_error(*map(np.array, zip(*said, strict=True)))
    lines += [f"expected calibration error of all probabilities: {error:.3f}", *diagram]
    top = [
        max(
            [(c["unexplained_probability"], c["effects"] is None)]
            + [(e["probability"], is_right(e["members"], c["effects"])) for e in c["explanations"]]
        )
        for c in cases
    ]
    error, diagram = calibration_error(*map(np.array, zip(*top, strict=True)))
    lines += [f"of the likeliest answer alone: {error:.3f}", *diagram]
    return "\n".join([*lines, _seconds(cases)])


def comparison_table(cases: Cases) -> str:
    """Return the table of what comparisons claimed and what was so."""
    lines = [f"{len(cases)} comparisons"]
    in_library = [c for c in cases if c.get("library_laws")]
    found = [c for c in in_library if _law_found(c) is not None]
    lines.append(f"a law of the library, found alone: {share(len(found), len(in_library))}")
    explained = sum(c["verdict"] == "explained" for c in in_library)
    lines.append(f"  and explained: {share(explained, len(in_library))}")
    held = [_holds(t["ci95"], (_law_found(c) or {})[t["term"]]) for c in found for t in c["terms"]]
    lines.append(f"  95 % intervals that hold the coefficient: {share(sum(held), len(held))}")
    others = [c for c in cases if not c.get("library_laws")]
    for name, some in (
        ("a law of the library, sound instrument", in_library),
        ("another law or a flaw, all with a name", [c for c in others if c["effects"] is not None]),
        ("something has none", [c for c in others if c["effects"] is None]),
    ):
        explained = sum(c["verdict"] == "explained" for c in some)
        lines.append(f"{name}: explained in {share(explained, len(some))}")
        said = [(c, q) for c in some for q in ("N1", "N2") if q not in c.get("undetermined", ())]
        wrong = [(c, q) for c, q in said if _worst(c, q) > TENTH]
        lines.append(
            f"  N1 or N2 said to be determined, and off by a tenth: {share(len(wrong), len(said))}"
        )
        lines += [f"    {_case(c)}: {q} by {100 * _worst(c, q):.0f} %" for c, q in wrong]
        for source in sorted({b["source"] for c in some for b in c["bands"]}):
            for quantity in ("sigma12", "N1", "N2"):
                bands = [b for b in _bands(some) if b["quantity"] == quantity and "inside" in b]
                bands = [b for b in bands if b["source"] == source]
                lines.append(_coverage(f"  {source}, {quantity}", bands))
    return "\n".join([*lines, _seconds(cases)])


def _beside(case: dict) -> list[str]:
    """Return names of a half or more in the answer that are no name of what is there."""
    right = {name for names in case["effects"] for name in names}
    return [name for name, p in case["inclusion"].items() if p >= 0.5 and name not in right]


def _bands(cases: Cases) -> list[dict]:
    return [band for case in cases for band in case["bands"]]


def _law_found(case: dict) -> dict[str, float] | None:
    """Return the right law of just the terms that were found; None if there is none."""
    names = {term["term"] for term in case["terms"]}
    return next((law for law in case["library_laws"] if {*law} == names), None)


def _holds(interval: Sequence[float] | None, truth: float) -> bool:
    return interval is not None and interval[0] <= truth <= interval[1]


def _worst(case: dict, quantity: str) -> float:
    """Return how far the answer's curve is off in a run held out, N2's over N1."""
    answer = [b for b in case["bands"] if b["source"] == "posterior"]
    return max((b.get("off", 0.0) for b in answer if b["quantity"] == quantity), default=0.0)


def _coverage(what: str, bands: list[dict]) -> str:
    if not bands:
        return f"{what}: no band"
    inside = np.array([b["inside"] for b in bands])
    width = np.median([b["half_width"] for b in bands])
    return (
        f"{what}: {100 * np.mean(inside):.1f} % of the samples, runs held to 90 % "
        f"{share(int(np.sum(inside >= WHOLE)), len(bands))}, median half-width {100 * width:.2g} %"
    )


def _case(case: dict) -> str:
    return f"{case['index']}, {case['law']}, {case['flaw']}, {case['protocol']}, {case['noise']}"


def _first(case: dict) -> str:
    first = case["explanations"][0]
    return f"{' + '.join(first['members'][0]) or 'nothing'} {first['probability']:.2f}"


def _seconds(cases: Cases) -> str:
    used = [c["processor_seconds"] for c in cases]
    return f"seconds of processor a case: median {np.median(used):.0f}, mean {np.mean(used):.0f}"
