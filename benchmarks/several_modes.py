"""How true is what is said of fluids of several modes, each with constants of its own.

Three modes recorded by scipy, start-ups with 1 % noise, told as upper convected Maxwell
with the right spectrum: laws of the library with one constant and with constants by mode,
mixtures of laws, and chains that no library holds. Of two runs held out one is slower than the
fastest fitted, one faster. N1 and N2 are known and told to nobody. Seeds of 1 to 9 are for
development.
"""

from pathlib import Path

import numpy as np
from independent import (
    Giesekus,
    Modes,
    PhanThienTanner,
    PomPom,
    RoliePoly,
    multimode_giesekus,
    start_up,
)

import discover as dc

MODULI, RELAXATION_TIMES = (200.0, 100.0, 50.0), (0.1, 1.0, 10.0)
TIMES = np.geomspace(0.02, 20.0, 60)
RATES = {"fast": (0.3, 1.0, 5.0), "slow": (0.02, 0.05, 0.1)}
QUESTIONS, SEED = ("compare", "close-loop"), 20261201
NOISE = 0.01
_SURE = 0.5
_IN_INTEGRATION = 2e-3
"""Of the size of a curve: what a band may miss by independent integration."""


def fluids(rng: np.random.Generator) -> dict:
    """Return the fluids by name, constants drawn."""
    low, high = np.sort(rng.uniform(0.05, 0.6, 2))
    rising = np.geomspace(low, high + 0.1, 3)
    ends = 0.05, 0.3
    modes = list(zip(MODULI, RELAXATION_TIMES, strict=True))

    def ptt(epsilons, slip=0.0):
        pairs = zip(epsilons, modes, strict=True)
        return Modes(*(_ptt(epsilon, *mode, slip) for epsilon, mode in pairs))

    return {
        "Giesekus, one mobility": multimode_giesekus([high] * 3, MODULI, RELAXATION_TIMES),
        "Giesekus, rising": multimode_giesekus(rising, MODULI, RELAXATION_TIMES),
        "Giesekus, peaked": multimode_giesekus([low, high, low], MODULI, RELAXATION_TIMES),
        "linear PTT, one": ptt([rng.uniform(*ends)] * 3),
        "linear PTT, falling": ptt(np.geomspace(0.4, 0.05, 3)),
        "linear PTT with slip": ptt(np.geomspace(0.05, 0.3, 3), rng.uniform(0.05, 0.2)),
        "Giesekus and PTT": Modes(
            Giesekus(high, *modes[0]), _ptt(0.2, *modes[1]), Giesekus(low, *modes[2])
        ),
        "Rolie-Poly": Modes(
            *(RoliePoly(rng.uniform(0.0, 1.0), t / 5.0, -0.5, g, t) for g, t in modes)
        ),
        "pom-pom": Modes(
            *(
                PomPom(arms, 0.4 * t, g, t)
                for arms, (g, t) in zip((2.0, 4.0, 8.0), modes, strict=True)
            )
        ),
    }


def _ptt(epsilon: float, modulus: float, time: float, slip: float = 0.0) -> PhanThienTanner:
    return PhanThienTanner(epsilon, slip=slip, modulus=modulus, relaxation_time=time)


def runs_of(fluid, rates, rng: np.random.Generator) -> tuple[list, dict]:
    """Return noisy records of start-ups, and what nobody is told."""
    runs, truths = [], {}
    for rate in rates:
        seen = fluid.respond(start_up(rate), TIMES)
        size = NOISE * np.sqrt(np.mean(seen.sigma12**2))
        stress = seen.sigma12 + size * rng.standard_normal(len(TIMES))
        name = f"at_{rate:g}"
        runs.append(dc.Run(name, TIMES, dc.start_up(rate), np.full(len(TIMES), rate), stress))
        truths[name] = {"N1": seen.N1, "N2": seen.N2}
    return runs, truths


def names(seed: int) -> list[str]:
    del seed
    return [f"{fluid} {speed}" for fluid in NAMES for speed in RATES]


def run(name: str, question: str, seed: int, folder: Path) -> dict:
    """Return what is said of one fluid, beside what is there."""
    del folder
    title, speed = name.rsplit(" ", 1)
    fluid, fitted = fluids(np.random.default_rng(seed))[title], RATES[speed]
    rng = np.random.default_rng([seed, len(title), int(100 * fitted[0])])
    unseen = (0.6 * fitted[-1], 3.0 * fitted[-1])
    runs, truths = runs_of(fluid, (*fitted, *unseen), rng)
    held_out = [run.name for run in runs[len(fitted) :]]
    base = dc.Fluid(dc.make_law("ucm"), list(MODULI), list(RELAXATION_TIMES))
    data = dc.Dataset(title, tuple(runs))
    said = closed_loop if question == "close-loop" else comparison
    row = said(data, base, held_out, truths)
    return {"fluid": title, "fitted": list(fitted), **row, **judged(row, fluid)}


def closed_loop(data: dc.Dataset, base: dc.Fluid, held_out, truths) -> dict:
    """Return what a closed loop says; it claims nothing of normal stresses."""
    del truths
    found = dc.close_loop(data, base, held_out=held_out)
    return {**_named(found), "held_in_band": found.held_in_band}


def comparison(data: dc.Dataset, base: dc.Fluid, held_out, truths) -> dict:
    """Return what a comparison says, and how its bands hold N1 and N2."""
    found = dc.compare(
        data, base, held_out=held_out, learners=["tensor_sindy"], library={"degree": 1}, max_terms=3
    )
    claimed = {flow.name: found.claimed(flow) for flow in found.judged}
    bands = [
        {"run": run, **_held(band, truths[run])}
        for run, band in claimed.items()
        if band is not None
    ]
    return {
        **_named(found.posterior),
        "terms": [
            {"term": t.term, "coefficient": t.coefficient, "ci95": t.ci95}
            for t in found.outcomes["tensor_sindy"].terms
        ],
        "undetermined": found.undetermined,
        "bands": bands,
        "said": list(found.warnings),
    }


def _named(loop) -> dict:
    """Return verdict, errors, and effects with their constants."""
    return {
        "verdict": loop.verdict,
        "error_after": [loop.error_after.fit, loop.error_after.held_out],
        "effects": [
            {
                "effect": stage.effect,
                "aliases": list(stage.aliases),
                "inclusion": loop.explanations.inclusion.get(stage.effect),
                "constants": {
                    n: [m.ci95 for m in p.modes] if hasattr(p, "modes") else p.ci95
                    for n, p in stage.parameters.items()
                },
            }
            for stage in loop.stages
        ],
    }


def true_constants(fluid: Modes) -> dict[str, list[float]]:
    """Return the constants of effects in a fluid by mode; of a chain the effect that is in it."""
    found: dict[str, list[float]] = {}
    for i, law in enumerate(fluid.laws):
        own = {"giesekus_mobility": getattr(law, "mobility", 0.0),
               "ptt_linear": getattr(law, "extensibility", 0.0),
               "non_affine_motion": getattr(law, "slip", 0.0),
               "convective_constraint_release": float(isinstance(law, RoliePoly))}  # fmt: skip
        for effect, value in own.items():
            if value:
                found.setdefault(effect, [0.0] * len(fluid.laws))[i] = value
    return found


def judged(row: dict, fluid: Modes) -> dict:
    """Return what is false of an answer, and how many intervals of constants hold.

    False is, under a verdict that claims to explain, an effect of the fluid or bench with a
    probability of one half or more that is not there, nor an alias of what is.
    """
    truth, false, held = true_constants(fluid), [], [0, 0]
    for one in row["effects"] if row["verdict"] == "effects_added" else ():
        there = truth.keys() & {one["effect"], *one["aliases"]}
        if (one["inclusion"] or 0.0) >= _SURE and not there:
            false.append(f"{one['effect']} is not there")
        ends = next(iter(one["constants"].values()))
        true = truth.get(one["effect"])
        if true is None or one["effect"] == "convective_constraint_release":
            continue
        each = ends if isinstance(ends[0], list | tuple) or None in ends else [ends] * len(true)
        for value, interval in zip(true, each, strict=False):
            if interval is not None and None not in interval:
                held[1] += 1
                held[0] += interval[0] <= value <= interval[1]
    for band in row.get("bands", ()):
        for quantity in ("N1", "N2"):
            claim = band[quantity]
            if row["verdict"] != "unexplained" and claim and claim["off"] > claim["half_width"]:
                false.append(f"{quantity} of {band['run']} lies outside its band by half of it")
    return {"false": false, "intervals": held}


def _held(band, truth) -> dict:
    size = float(np.linalg.norm(truth["N1"]))
    row = {}
    for quantity in ("N1", "N2"):
        low, high = band.low[quantity], band.high[quantity]
        outside = truth[quantity] - np.clip(truth[quantity], low, high)
        off = float(np.linalg.norm(outside)) / size
        half = 0.5 * float(np.linalg.norm(high - low)) / size
        # limits are nan where nothing is claimed
        row[quantity] = None if np.isnan(off) else {"off": off, "half_width": half}
    return row


NAMES = list(fluids(np.random.default_rng(0)))


def line(row: dict) -> str:
    """Return what is said of a fluid, and the bands that miss."""
    errors = (f"{100.0 * e:.1f} %" for e in row["error_after"] if e is not None)
    told = (f"{e['effect']} {e['constants']}" for e in row["effects"])
    lines = [f"{' and '.join(errors)}: {', '.join(told)}"]
    for band in row.get("bands", ()):
        for quantity in ("N1", "N2"):
            held = band[quantity]
            if held is not None and held["off"] > _IN_INTEGRATION:
                off, half = (100.0 * held[k] for k in ("off", "half_width"))
                lines.append(f"    {band['run']} {quantity} off {off:.1f} ± {half:.1f} %")
    return "\n".join(lines)


def table(rows: list[dict]) -> str:
    """Return counts of answers by command, of intervals, and of bands that hold their curve."""
    lines = []
    for question in QUESTIONS:
        some = [r for r in rows if r.get("question", r.get("task")) == question]
        answers = [r for r in some if "message" not in r]
        if not answers:
            continue
        explained = sum(r["verdict"] != "unexplained" for r in answers)
        false = sum(bool(r["false"]) for r in answers)
        held, of = np.sum([r["intervals"] for r in answers], axis=0)
        bands = [b[q] for r in answers for b in r.get("bands", ()) for q in ("N1", "N2") if b[q]]
        inside = sum(band["off"] <= _IN_INTEGRATION for band in bands)
        seconds = np.median([r["seconds"] for r in answers])
        lines.append(
            f"{question}: {len(answers)} of {len(some)} answered, {explained} explained, {false} "
            f"with something false; intervals {held} of {of}; bands of N1 and N2 {inside} of "
            f"{len(bands)}; {seconds:.0f} s"
        )
    return "\n".join(lines)
