"""Are probabilities, intervals and bands those of the world? On records that share no code with it.

`independent.worlds` draws a law, an instrument, a protocol and a noise, half of the laws and some
of the flaws from outside library and dictionary, and records six runs with scipy alone. The
software is told a Maxwell fluid and given four of them; the two faster ones judge.

- ``close-loop``: verdict, probabilities of explanations, intervals, the band of the held-out runs.
- ``compare``: the verdict, and the bands of σ12, N1 and N2 in the held-out runs, of every learner
  that claims one.

Seeds of 1 to 9 are for development. Seeds that judge are written down before their first case is
run, and never used to change anything: 20261130, then 20261206 to 20261243, each since a change of
the engine (`docs/evidence.md`); answers are in `judged/` by question and seed.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from independent.folders import write_folder
from independent.worlds import MODULUS, TIME, World, draw_world
from scipy.stats import beta

import discover as dc

SEED, LIMIT = 20261130, 3600.0
HELD = "held_"
_ARITHMETIC = 1e-5
Cases = Sequence[dict]
WHOLE = 0.9
"""A run counts as held with so many of its samples in the band."""

TENTH = 0.1
"""A quantity that is said to be determined may be off by so much of N1."""


def close_loop(data: dc.Dataset, held_out: list[str], world: World) -> dict:
    """Return what a closed loop says, beside what is there."""
    base = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME)
    loop = dc.close_loop(data, base, held_out=held_out, max_effects=3)
    said = loop.explanations
    constants = [
        {"effect": effect, "parameter": name, "truth": truth, "ci95": list(interval)}
        for effect, sizes in world.constants.items()
        for name, truth in sizes.items()
        if (interval := _interval(loop, effect, name)) is not None
    ]
    judged = [r for r in loop.records if r.held_out and r.band is not None]
    return {
        "verdict": loop.verdict,
        "explanations": [
            {"members": [sorted(one) for one in e.members], "probability": e.probability}
            for e in said.likeliest_first
        ],
        "unexplained_probability": said.unexplained_probability,
        "inclusion": dict(said.inclusion),
        "free_form": [[f.slot, f.variable, f.nearest] for f in loop.free_form],
        "constants": constants,
        "errors": [loop.error_after.fit, loop.error_after.held_out],
        "bands": [_band(r.name, "sigma12", *r.band, r.measured) for r in judged],
    }


def compare(data: dc.Dataset, held_out: list[str], world: World) -> dict:
    """Return what a comparison claims of stresses in the held-out runs, beside what they were."""
    from discover.report.predictions import comparison_predictions

    base = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME)
    found = dc.compare(
        data,
        base,
        held_out=held_out,
        learners=["tensor_sindy"],
    )
    exact, lines = world.make(None), comparison_predictions(found)
    lines = lines[(lines["role"] == "held_out") & (lines["source"] != "declared")]
    bands = []
    for (source, name, quantity), part in lines.groupby(["source", "run", "quantity"]):
        run = exact[name]
        truth = run.stress if quantity == "sigma12" else getattr(run, quantity)
        at = np.abs(run.time[:, None] - part["time_s"].to_numpy()).argmin(axis=0)
        there = np.isclose(run.time[at], part["time_s"], atol=1e-9)  # flows start before
        part, truth = part[there], truth[at[there]]
        size = np.sqrt(np.mean((run.stress if quantity == "sigma12" else run.N1) ** 2))
        off = np.sqrt(np.mean((part["value"] - truth) ** 2)) / size
        band = {"source": source, "run": name, "quantity": quantity, "off": float(off)}
        if part["low95"].notna().all():
            band |= _band(name, quantity, part["low95"], part["high95"], truth, size)
        bands.append(band)
    return {
        "verdict": found.verdict,
        "undetermined": found.undetermined,
        "terms": [
            {"term": term.term, "coefficient": term.coefficient, "ci95": term.ci95}
            for term in found.outcomes["tensor_sindy"].terms
        ],
        "library_laws": list(world.library_laws),
        "bands": bands,
    }


TASKS = {"close-loop": close_loop, "compare": compare}
QUESTIONS = tuple(TASKS)


def names(seed: int) -> list[str]:
    del seed
    return [str(index) for index in range(2000)]


def run(name: str, question: str, seed: int, folder: Path) -> dict:
    """Draw one world, record it, ask, and return the answer beside the truth."""
    world = draw_world(seed, int(name))
    runs = world.make(np.random.default_rng([seed, int(name), 1]))
    data = dc.load_dataset(write_folder(folder / "data", runs))
    answer = TASKS[question](data, [n for n in data.names if n.startswith(HELD)], world)
    return {
        "index": int(name), "law": world.law, "flaw": world.flaw, "protocol": world.protocol,
        "noise": world.noise,
        "effects": None if world.effects is None else [sorted(one) for one in world.effects],
        **answer,
    }  # fmt: skip


def line(row: dict) -> str:
    return ", ".join(row[key] for key in ("law", "flaw", "protocol", "noise"))


def table(rows: list[dict]) -> str:
    """Return the tables of the questions that were asked."""
    rows = [row for row in rows if "message" not in row]
    loops, others = ([r for r in rows if ("explanations" in r) == one] for one in (True, False))
    return "\n\n".join(
        make(some) for make, some in ((loop_table, loops), (comparison_table, others)) if some
    )


def _interval(loop, effect: str, parameter: str) -> tuple[float, float] | None:
    """Return the interval of a constant in the last stage that has it, if it was found."""
    for stage in reversed(loop.to_json()["stages"]):
        if stage["effect"] == effect and parameter in stage["parameters"]:
            interval = stage["parameters"][parameter]["ci95"]
            return None if interval is None or None in interval else tuple(interval)
    return None


def _band(run: str, quantity: str, low, high, truth, size: float | None = None) -> dict:
    """Return the share of samples that a band holds, and half its width over a size."""
    low, high, truth = (np.asarray(one, float) for one in (low, high, truth))
    size = float(np.sqrt(np.mean(truth**2))) if size is None else float(size)
    # a band of no width, of a law without a constant, holds what two integrators make of it
    low, high = low - _ARITHMETIC * size, high + _ARITHMETIC * size
    half = 0.5 * np.sqrt(np.mean((high - low) ** 2))
    return {
        "run": run,
        "quantity": quantity,
        "inside": float(np.mean((low <= truth) & (truth <= high))),
        "half_width": float(half / size),
    }


# what cases add up to: how often what was said was so


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
    place, error, lines = np.minimum((said * bins).astype(int), bins - 1), 0.0, []
    for among in (place == bin_ for bin_ in np.unique(place)):
        stated, true = float(np.mean(said[among])), float(np.mean(so[among]))
        error += np.mean(among) * abs(stated - true)
        told = share(int(np.sum(so[among])), int(np.sum(among)))
        lines.append(f"  said {stated:.2f}: so in {told}")
    return float(error), lines


def loop_table(cases: Cases) -> str:
    """Return the table of what closed loops said and what was so."""
    inside = [c for c in cases if c["effects"] is not None]
    outside = [c for c in cases if c["effects"] is None]
    clean = [c for c in inside if not c["effects"]]
    planted = [c for c in inside if c["effects"]]
    open_ = ("unexplained", "no_signal")
    lines = [f"{len(cases)} closed loops, {len(inside)} of what has a name"]

    def count(what: str, so: Callable[[dict], bool], among: Cases) -> None:
        lines.append(f"{what}: {share(sum(map(so, among)), len(among))}")

    def right(c: dict) -> bool:
        return bool(c["explanations"]) and is_right(c["explanations"][0]["members"], c["effects"])

    count("what is there in the likeliest class", right, planted)
    for number in (1, 2):
        count(f"  {number} at a time", right, [c for c in planted if len(c["effects"]) == number])
    for what in ("protocol", "noise"):
        for kind in sorted({c[what] for c in planted}):
            count(f"  {what} {kind}", right, [c for c in planted if c[what] == kind])
    count("a name beside it, 50 % or more", lambda c: bool(_beside(c)), planted)
    named = "an effect named where there is none"
    count(named, lambda c: c["verdict"] == "effects_added", clean)
    count("unexplained where all has a name", lambda c: c["verdict"] == "unexplained", inside)
    count("unexplained where something has none", lambda c: c["verdict"] in open_, outside)
    missed = [c for c in outside if c["verdict"] not in open_]
    for c in missed:
        first = c["explanations"][0]
        name = f"{' + '.join(first['members'][0]) or 'nothing'} {first['probability']:.2f}"
        lines.append(f"  but: {c['index']}, {line(c)}: {c['verdict']}, {name}")
    found = [f for c in planted for f in c["constants"]]
    holds = "95 % intervals that hold the constant"
    count(holds, lambda f: f["ci95"][0] <= f["truth"] <= f["ci95"][1], found)
    for name, some in (("all has a name", inside), ("something has none", outside)):
        lines.append(_coverage(f"band of held-out runs, {name}", _bands(some)))
    said = [
        [(c["unexplained_probability"], c["effects"] is None)]
        + [(e["probability"], is_right(e["members"], c["effects"])) for e in c["explanations"]]
        for c in cases
    ]
    for what, told in (
        ("expected calibration error of all probabilities", [one for some in said for one in some]),
        ("of the likeliest answer alone", [max(one) for one in said]),
    ):
        error, diagram = calibration_error(*map(np.array, zip(*told, strict=True)))
        lines += [f"{what}: {error:.3f}", *diagram]
    return "\n".join([*lines, _seconds(cases)])


def comparison_table(cases: Cases) -> str:
    """Return the table of what comparisons claimed and what was so."""
    lines = [f"{len(cases)} comparisons"]
    in_library = [c for c in cases if c.get("library_laws")]
    found = [c for c in in_library if _law_found(c) is not None]
    lines.append(f"a law of the library, found alone: {share(len(found), len(in_library))}")
    explained = sum(c["verdict"] == "explained" for c in in_library)
    lines.append(f"  and explained: {share(explained, len(in_library))}")
    told = [(t["ci95"], (_law_found(c) or {})[t["term"]]) for c in found for t in c["terms"]]
    held = sum(ci95 is not None and ci95[0] <= truth <= ci95[1] for ci95, truth in told)
    lines.append(f"  95 % intervals that hold the coefficient: {share(held, len(told))}")
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
        off = share(len(wrong), len(said))
        lines.append(f"  N1 or N2 said to be determined, and off by a tenth: {off}")
        lines += [
            f"    {c['index']}, {line(c)}: {q} by {100 * _worst(c, q):.0f} %" for c, q in wrong
        ]
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


def _seconds(cases: Cases) -> str:
    used = [c["processor_seconds"] for c in cases]
    return f"seconds of processor a case: median {np.median(used):.0f}, mean {np.mean(used):.0f}"
