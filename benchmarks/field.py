"""A benchmark of the field: σ12 of eight fluids whose law is not told.

Fluids and flows are of scipy simulators that share nothing with a contestant. A contestant is told
five records, the linear fluid (G = 1 Pa, λ = 1 s) and a seed, and returns a law; judged is how far
it is off in flows that none of them saw. What others, classical fits and an upper-convected
Maxwell fluid make of the same records is settled and stands in `docs/evidence.md`.
"""

import time
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import independent
import numpy as np

QUESTIONS, SEED, LIMIT, FRESH = ("learn",), 1, 300.0, 1
QUANTITIES = {"sigma12": "σ12", "N1": "N1", "N2": "N2", "tensile": "extension"}
NOISE = 0.01
"""Standard deviation over the root-mean-square of a record."""
FLUIDS: dict[str, tuple[str | None, independent.RateLaw]] = {
    "Giesekus": ("giesekus", independent.Giesekus(0.3)),
    "linear PTT": ("ptt_linear", independent.PhanThienTanner(0.3)),
    "exponential PTT": ("ptt_exponential", independent.PhanThienTanner(0.3, "exponential")),
    "Johnson–Segalman": ("johnson_segalman", independent.JohnsonSegalman(0.3)),
    "Rolie–Poly": (None, independent.RoliePoly(1.0, 0.1)),
    "extended pom-pom": (None, independent.ExtendedPomPom(5.0, 0.1, 0.4)),
    "White–Metzner": (None, independent.WhiteMetzner(0.5, 1.0)),
    # seen as one mode it has the same modulus and viscosity: 1 Pa and 1 Pa s
    "two-mode Giesekus": (None, independent.multimode_giesekus((0.1, 0.7), (0.5, 0.5), (1.3, 0.7))),
}
"""Right name, or None where no list holds the fluid; and its law."""


@dataclass(frozen=True)
class Flow:
    """A homogeneous flow from rest, of shear or Hencky rate `amplitude` · cos(`frequency` · t).

    In 1/s and rad/s, at times in s, shape (n,), from 0 on; a frequency of 0 is a start-up.
    """

    name: str
    amplitude: float
    frequency: float
    times: np.ndarray
    kind: Literal["shear", "uniaxial"] = "shear"

    def rate(self, time):
        return self.amplitude * np.cos(self.frequency * np.asarray(time, float))


@dataclass(frozen=True)
class Answer:
    """What a contestant makes of the records.

    `predict`: from a flow to ``sigma12``, ``N1`` and ``N2`` in shear, ``tensile`` (σ11 − σ22) in
        extension, each of shape (n,) in Pa; a quantity that it says nothing of is left out, and
        ArithmeticError raised where its equation runs away.
    `law`: as studies spell it, or None. `words`: the equation, as short as it can be said.
    """

    predict: Callable[[Flow], Mapping[str, np.ndarray]]
    law: str | None = None
    words: str = ""


Records = list[tuple[Flow, np.ndarray]]
"""Flows, and σ12 in Pa with noise."""
_TIMES = np.linspace(0.0, 12.0, 121)
TRAINING = (
    *(Flow(f"laos_{a:g}_{f:g}", a, f, _TIMES) for f in (0.5, 1.0) for a in (1.0, 2.0)),
    Flow("startup_1", 1.0, 0.0, _TIMES),
)
UNSEEN = (
    Flow("laos_3_1.5", 3.0, 1.5, _TIMES),
    Flow("startup_2.5", 2.5, 0.0, _TIMES),
    *(Flow(f"extension_{r:g}", r, 0.0, np.linspace(0.0, 3.0, 61), "uniaxial") for r in (0.5, 1.0)),
)


def training(fluid: str, seed: int) -> Records:
    """Return the records of a fluid."""
    lot, records = np.random.default_rng([seed, zlib.crc32(fluid.encode())]), []
    for flow in TRAINING:
        exact = truth(fluid, flow)["sigma12"]
        drawn = lot.standard_normal((len(exact), 3, 3))[:, 0, 1]
        records.append((flow, exact + NOISE * np.sqrt(np.mean(exact**2)) * drawn))
    return records


def truth(fluid: str, flow: Flow) -> dict[str, np.ndarray]:
    """Return what a fluid does in a flow, in Pa."""
    law = FLUIDS[fluid][1]
    if flow.kind == "uniaxial":
        return {"tensile": law.pull(flow.amplitude, flow.times)}
    shear = independent.oscillation(flow.amplitude, flow.frequency) if flow.frequency else (
        independent.start_up(flow.amplitude))  # fmt: skip
    return dict(vars(law.respond(shear, flow.times)))


# contestants

NAMES = {
    (): "ucm", ("sigma.sigma",): "giesekus",
    ("sigma.gammadot+gammadot.sigma",): "johnson_segalman",
    # the same σ12 and N1 in every shear: see docs/identifiability.md
    ("tr(sigma)*gammadot",): "johnson_segalman",
    ("tr(sigma)*sigma",): "ptt_linear", ("(exp(epsilon*tr(sigma))-1)*sigma",): "ptt_exponential",
}  # fmt: skip
"""The name of a law beyond upper-convected Maxwell by its terms."""


def _ours(model, records: Records):
    """Return a learner of this package after the records, and the predictions of its fluid."""
    import discover as dc
    from discover.simulate import SimulationError, simulate

    def protocol(flow: Flow):
        if flow.frequency:
            return dc.oscillatory_shear(flow.amplitude, flow.frequency)
        return dc.in_flow(dc.start_up(flow.amplitude), flow.kind)

    def predict(flow: Flow) -> dict:
        try:
            found = simulate(model.fluid_, protocol(flow), flow.times)
        except SimulationError as error:
            raise ArithmeticError(str(error)) from error
        first = found.first_normal_stress_difference
        if flow.kind == "uniaxial":
            return {"tensile": first}
        second = found.second_normal_stress_difference
        return {"sigma12": found.shear_stress, "N1": first, "N2": second}

    model.fit([dc.Run(f.name, f.times, protocol(f), f.rate(f.times), read) for f, read in records])
    return model, predict


def tensor_sindy(records: Records, seed: int) -> Answer:
    """Return the law of the sparse learner, with the library that a study has by default."""
    import discover as dc

    library = dc.build_library(degree=1, closed_forms=("exp",))
    model = dc.TensorSINDy(library=library, random_state=seed)
    model, predict = _ours(model, records)
    words = " + ".join(f"{term.coefficient:.3g} {term.term}" for term in model.terms_)
    return Answer(predict, NAMES.get(tuple(term.term for term in model.terms_)), words)


def tensor_basis_network(records: Records, seed: int) -> Answer:
    import discover as dc

    model = dc.TBNNUDE(random_state=seed)
    return Answer(_ours(model, records)[1], words="a network")


TITLES = {
    "tensor_basis_network": "network in the equation (this package)",
    "tensor_sindy": "sparse regression (this package)",
}
"""Contestants, which are functions of this module, as the table calls them."""
GROUPS = {name: [f"{name} {fluid}" for fluid in FLUIDS] for name in TITLES}


def run(name: str, question: str, seed: int, folder: Path) -> dict:
    """Return what a contestant makes of a fluid."""
    from discover.compilation_cache import enable_compilation_cache
    from discover.first_use import enable_x64

    enable_x64()
    enable_compilation_cache()
    contestant, fluid = name.split(" ", 1)
    return judged(globals()[contestant], fluid, seed)


def judged(contestant: Callable[[Records, int], Answer], fluid: str, seed: int) -> dict:
    """Return one result: processor seconds, law, words, and the largest error of each quantity."""
    given = training(fluid, seed)
    started = time.process_time()  # a shared machine does not slow this clock
    answer = contestant(given, seed)
    seconds = time.process_time() - started
    errors = worst_errors(answer, fluid)
    return {"law": answer.law, "words": answer.words, "errors": errors, "learning": seconds}


def worst_errors(answer: Answer, fluid: str) -> dict[str, float | None]:
    """Return the largest relative error over the unseen flows by quantity.

    In the L2 norm, relative to the truth, that of N2 to the truth's N1. None where nothing is
    predicted, infinite where the equation runs away.
    """
    worst: dict[str, float | None] = dict.fromkeys(QUANTITIES)
    for flow in UNSEEN:
        true = truth(fluid, flow)
        try:
            said = answer.predict(flow)
        except ArithmeticError:
            said = dict.fromkeys(true, np.full(len(flow.times), np.inf))
        for name in true.keys() & said.keys():
            size = np.linalg.norm(true["N1" if name == "N2" else name])
            error = float(np.linalg.norm(said[name] - true[name]) / size)
            worst[name] = max(worst[name] or 0.0, error if np.isfinite(error) else np.inf)
    return worst


def line(row: dict) -> str:
    return row["words"][:90]


def percent(error: float | None) -> str:
    """Return an error in percent; a dash where nothing is predicted."""
    if error is None:
        return "–"
    if not np.isfinite(error):
        return "runs away"
    return f"{100 * error:.2g} %" if error < 0.995 else f"{100 * error:.0f} %"


def _middle(errors: list[float | None]) -> str:
    """Return the median and, in brackets, the largest of the errors."""
    said = [error for error in errors if error is not None]
    return f"{percent(float(np.median(said)))} ({percent(max(said))})" if said else "–"


def table(rows: list[dict]) -> str:
    """Return the table of all contestants."""
    results = {tuple(row["case"].split(" ", 1)): row for row in rows}
    heads = [*QUANTITIES.values(), "right", "wrong", "seconds"]
    lines = [f"| | {' | '.join(heads)} |", "|---" * (len(heads) + 1) + "|"]
    for name, title in TITLES.items():
        of = {fluid: results.get((name, fluid), {"message": "not run"}) for fluid in FLUIDS}
        done = {fluid: row for fluid, row in of.items() if "errors" in row}
        if not done:
            lines.append(
                f"| {title} | {next(iter(of.values()))['message']} |" + " |" * (len(heads) - 1)
            )
            continue
        cells = [_middle([row["errors"][q] for row in done.values()]) for q in QUANTITIES]
        right = [row["law"] == FLUIDS[fluid][0] for fluid, row in done.items() if row["law"]]
        cells += [str(sum(right)), str(len(right) - sum(right))] if right else ["–", "–"]
        cells.append(f"{np.median([row['learning'] for row in done.values()]):.0f}")
        missing = "" if len(done) == len(FLUIDS) else f" ({len(done)} of {len(FLUIDS)} fluids)"
        lines.append(f"| {title}{missing} | {' | '.join(cells)} |")
    return "\n".join(lines)
