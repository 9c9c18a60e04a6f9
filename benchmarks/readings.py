"""Records that were read with a small fault, draw by draw: how often an answer is right.

Runs of a Giesekus fluid of α = 0.3 and others by scipy, with 1 % noise; a faster start-up judges.

- ``loading``: a factor of its own on each run, of 3 %, which is told. Case: fluid and draw.
- ``misread``: a range that reads more above 50 Pa, or a factor, zero or growth of each run, of 0 to
  1 %, which is not told. Case: fault, size in % and draw.

Counted are answers that explain, mobilities found alone, and whether their intervals hold; of
loadings the intervals of the factors too.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from independent import (
    KBKZ,
    ExtendedPomPom,
    Giesekus,
    PhanThienTanner,
    PomPom,
    oscillation,
    start_up,
)
from independent.noise import rms

QUESTIONS, SEED, LIMIT = ("close-loop", "compare"), 5000, 600.0
GROWTH, WAVE = np.linspace(0.1, 8.0, 80), np.linspace(0.1, 12.0, 120)
FLOWS = {
    "slow.csv": (start_up(0.5), 0.5, GROWTH), "middle.csv": (start_up(1.0), 1.0, GROWTH),
    "fast.csv": (start_up(2.0), 2.0, GROWTH), "wave.csv": (oscillation(2.0, 1.0), None, WAVE),
    "held.csv": (start_up(3.0), 3.0, GROWTH),
}  # fmt: skip
MOBILITY, NOISE, DIFFER = 0.3, 0.01, 0.03
FLUIDS = {
    "giesekus": Giesekus(MOBILITY, 100.0), "k_bkz": KBKZ(modulus=100.0),
    "pom_pom": PomPom(modulus=100.0), "extended_pom_pom": ExtendedPomPom(modulus=100.0),
    "linear_ptt": PhanThienTanner(0.3, "linear", modulus=100.0, relaxation_time=1.0),
}  # fmt: skip
EFFECTS = ["giesekus_mobility", "ptt_linear", "non_affine_motion", "wall_slip", "stress_gain"]
FAULTS = {
    "range": lambda s, part, lot, size: s * (1 + size * (np.abs(s) > 50.0)),
    "factor": lambda s, part, lot, size: s * (1 + size * lot.standard_normal()),
    "zero": lambda s, part, lot, size: s + size * rms(s) * lot.standard_normal(),
    "growth": lambda s, part, lot, size: s * (1 + size * lot.standard_normal() * part),
}
SIZES, DRAWS, LOADED = (0.0, 0.5, 1.0), 18, 100
GROUPS = {
    **{fluid: [f"loading {fluid} {n}" for n in range(LOADED)] for fluid in FLUIDS},
    **{fault: [f"misread {fault} {size:g} {n}" for size in SIZES for n in range(DRAWS)]
       for fault in FAULTS},
}  # fmt: skip
GROUPS |= {"loadings": [n for f in FLUIDS for n in GROUPS[f]],
           "misreadings": [n for f in FAULTS for n in GROUPS[f]]}  # fmt: skip


def names(seed: int) -> list[str]:
    del seed
    return [*GROUPS["loadings"], *GROUPS["misreadings"]]


def exact(fluid: str = "giesekus") -> dict[str, np.ndarray]:
    """Return σ12 in Pa of each run, without noise."""
    return {n: FLUIDS[fluid].respond(flow, t).sigma12 for n, (flow, _, t) in FLOWS.items()}


def drawn(stresses, seed: int, differ: float = DIFFER, correlation: float = 0.0):
    """Return the runs of one draw, each a loading of its own, and the factors in them."""
    lot, read, factors = np.random.default_rng(seed), {}, {}
    for name, stress in stresses.items():
        factors[name] = 1.0 + differ * lot.standard_normal()
        noise = lot.standard_normal(len(stress))
        for i in range(1, len(noise)):
            noise[i] = correlation * noise[i - 1] + np.sqrt(1.0 - correlation**2) * noise[i]
        read[name] = factors[name] * stress + noise * (NOISE * np.sqrt(np.mean(stress**2)))
    return dataset(read), factors


def misread(stresses, fault: str, size: float, seed: Sequence[int]):
    """Return three runs and a judge that were read with a fault of a size."""
    lot, read = np.random.default_rng([*seed, 9]), {}
    for name in (n for n in FLOWS if n != "middle.csv"):
        times = FLOWS[name][2]
        told = FAULTS[fault](stresses[name], times / times[-1], lot, size)
        read[name] = told + NOISE * rms(told) * lot.standard_normal(len(told))
    return dataset(read)


def dataset(stresses):
    """Return runs of the product."""
    import discover as dc

    runs = []
    for name, stress in stresses.items():
        flow, rate, times = FLOWS[name]
        protocol = dc.oscillatory_shear(2.0, 1.0) if rate is None else dc.start_up(rate)
        rates = np.asarray(flow.rate(times), float) + 0.0 * times
        runs.append(dc.Run(name, times, protocol, rates, stress))
    return dc.Dataset("runs", tuple(runs))


def run(name: str, question: str, seed: int, folder: Path) -> dict:
    """Return the row of one draw."""
    import discover as dc

    del folder
    kind, what, *size, draw = name.split(" ")
    options: dict[str, Any] = {}
    factors: dict[str, float] = {}
    if kind == "loading":
        data, factors = drawn(exact(what), seed + int(draw))
        options = {"loading": DIFFER}
    else:
        data = misread(exact(), what, float(size[0]) / 100, (seed, int(draw)))
    base = dc.Fluid(dc.make_law("ucm"), [100.0], [1.0])
    if question == "close-loop":
        found = dc.close_loop(data, base, held_out=["held.csv"], effects=EFFECTS, max_effects=2,
                              **options)  # fmt: skip
    else:
        found = dc.compare(data, base, held_out=["held.csv"], learners=["tensor_sindy"],
                           quick=True, **options).posterior  # fmt: skip
    names, told = [s.effect for s in found.stages], found.remaining.get("loading", {})
    told = {run: one["ci95"] for run, one in told.items()}
    alone = names == ["giesekus_mobility"] and found.stages[0].parameters["alpha"].ci95
    explained = found.verdict != "unexplained"
    held = [
        a < factors[run] < b for run, (a, b) in told.items() if run in factors and a is not None
    ]
    return {"verdict": found.verdict, "explained": explained, "names": names,
            "mobility": alone or None, "factors": [sum(held), len(held)]}  # fmt: skip


def line(row: dict) -> str:
    return f"{', '.join(row['names']) or 'nothing'} {row['mobility'] or ''}"


def table(rows: list[dict]) -> str:
    """Return the shares of draws by case and question."""
    lines = ["| case | asked | explained | mobility alone | its interval holds | half | factors |",
             "|---" * 7 + "|"]  # fmt: skip
    kinds: dict[tuple[str, str], list[dict]] = {}
    for row in rows:
        kinds.setdefault((row["case"].rsplit(" ", 1)[0], row["question"]), []).append(row)
    for (kind, question), some in kinds.items():
        ends = [r["mobility"] for r in some if r.get("mobility")]
        held = sum(low < MOBILITY < high for low, high in ends)
        half = np.median([(b - a) / 2 for a, b in ends]) / MOBILITY if ends else np.nan
        factors = np.sum([r.get("factors", (0, 0)) for r in some], axis=0)
        explained = sum(r.get("explained", False) for r in some)
        lines.append(f"| {kind} | {question} | {explained} of {len(some)} | {len(ends)} | {held} | "
                     f"{half:.2%} | {factors[0]} of {factors[1]} |")  # fmt: skip
    return "\n".join(lines)
