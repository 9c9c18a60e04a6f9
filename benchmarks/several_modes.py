"""How true is what is said of fluids of several modes, each with constants of its own.

Three modes recorded by scipy, start-ups with 1 % noise, told as upper convected Maxwell
with the right spectrum: laws of the library with one constant and with constants by mode,
mixtures of laws, and chains that no library holds. Of two runs held out one is slower than the
fastest fitted, one faster. N1 and N2 are known and told to nobody: false is a band of one that its
curve leaves by half of it. All else is judged as in `several_tests`. Seeds of 1 to 9 are for
development.
"""

from pathlib import Path

import numpy as np
import several_tests
from independent import (
    Giesekus,
    Modes,
    PhanThienTanner,
    PomPom,
    RoliePoly,
    multimode_giesekus,
    start_up,
)
from several_tests import Fluid, line  # noqa: F401 - the runner asks this module for it

import discover as dc

MODULI, RELAXATION_TIMES = (200.0, 100.0, 50.0), (0.1, 1.0, 10.0)
TIMES = np.geomspace(0.02, 20.0, 60)
RATES = {"fast": (0.3, 1.0, 5.0), "slow": (0.02, 0.05, 0.1)}
QUESTIONS, SEED = ("compare", "close-loop"), 20261201
NOISE = 0.01
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
    data, row = dc.Dataset(title, tuple(runs)), several_tests.empty()
    if question == "close-loop":
        loop = dc.close_loop(data, base, held_out=held_out)
        row["held_in_band"] = loop.held_in_band
    else:
        library = {"degree": 1}
        found = dc.compare(data, base, held_out=held_out, learners=["tensor_sindy"],
                           library=library, max_terms=3)  # fmt: skip
        loop, row["undetermined"] = found.posterior, list(found.undetermined)
        for flow in found.judged:
            if (band := found.claimed(flow)) is not None:
                of_band(row, flow.name, band, truths[flow.name], loop.verdict != "unexplained")
    several_tests.of_loop(row, as_told(fluid), loop)
    return row


def as_told(fluid: Modes) -> Fluid:
    """Return the effects in a fluid with their constants by mode; of a chain the effect in it."""
    by_mode: dict[str, list[float]] = {}
    for i, law in enumerate(fluid.laws):
        own = {"giesekus_mobility": getattr(law, "mobility", 0.0),
               "ptt_linear": getattr(law, "extensibility", 0.0),
               "non_affine_motion": getattr(law, "slip", 0.0),
               "convective_constraint_release": float(isinstance(law, RoliePoly))}  # fmt: skip
        for effect, value in own.items():
            if value:
                by_mode.setdefault(effect, [0.0] * len(fluid.laws))[i] = value
    effects: dict[str, dict[str, float]] = {effect: {} for effect in by_mode}
    by_mode.pop("convective_constraint_release", None)
    return Fluid(fluid, effects, by_mode={name: tuple(values) for name, values in by_mode.items()})


def of_band(row: dict, run: str, band, truth, claims: bool) -> None:
    """Add by how much N1 and N2 leave their bands, over N1, and half the width of the bands."""
    size = float(np.linalg.norm(truth["N1"]))
    for quantity in ("N1", "N2"):
        low, high = band.low[quantity], band.high[quantity]
        outside = truth[quantity] - np.clip(truth[quantity], low, high)
        off = float(np.linalg.norm(outside)) / size
        half = 0.5 * float(np.linalg.norm(high - low)) / size
        if not np.isnan(off):  # limits are nan where nothing is claimed
            row.setdefault("bands", []).append([run, quantity, off, half])
            if claims and off > half:
                row["false"].append(f"{quantity} of {run} lies outside its band by half of it")


NAMES = list(fluids(np.random.default_rng(0)))


def table(rows: list[dict]) -> str:
    """Return counts of answers by command, of intervals, and of bands that hold their curve."""
    lines = []
    for question in QUESTIONS:
        some = [r for r in rows if r["question"] == question and "message" not in r]
        inside = [r[2] <= _IN_INTEGRATION for one in some for r in one.get("bands", ())]
        bands = f"; bands of N1 and N2 {sum(inside)} of {len(inside)}"
        lines.append(several_tests.counted(question, some) + bands)
    return "\n".join(lines)
