"""Are probabilities, intervals and bands those of the world? On records that share no code with it.

`independent.worlds` draws a law, an instrument, a protocol and a noise, half of the laws and some
of the flaws from outside library and dictionary, and records six runs with scipy alone. The
software is told a Maxwell fluid and given four of them; the two faster ones judge.

- ``close-loop``: verdict, probabilities of explanations, intervals, the band of the held-out runs.
- ``compare``: the verdict, and the bands of σ12, N1 and N2 in the held-out runs, of every learner
  that claims one.

Seeds of 1 to 9 are for development. Seeds that judge are written down before their first case is
run, and never used to change anything: 20261130, then 20261206 to 20261220, each since a change of
the engine (`docs/evidence.md`); answers are in `judged/` by question and seed.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from calibration_tables import comparison_table, loop_table
from independent.folders import write_folder
from independent.worlds import MODULUS, TIME, World, draw_world

import discover as dc

SEED, LIMIT = 20261130, 3600.0
HELD = "held_"
_ARITHMETIC = 1e-5


def close_loop(data: dc.Dataset, world: World) -> dict:
    """Return what a closed loop says, beside what is there."""
    base = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME)
    loop = dc.close_loop(data, base, held_out=_held_out(data), max_effects=3)
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


def compare(data: dc.Dataset, world: World) -> dict:
    """Return what a comparison claims of stresses in the held-out runs, beside what they were."""
    from discover.report.predictions import comparison_predictions

    base = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME)
    found = dc.compare(data, base, held_out=_held_out(data), learners=["tensor_sindy"])
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


TASKS: dict[str, Callable[[dc.Dataset, World], dict]] = {
    "close-loop": close_loop,
    "compare": compare,
}
QUESTIONS = tuple(TASKS)


def names(seed: int) -> list[str]:
    del seed
    return [str(index) for index in range(2000)]


def run(name: str, question: str, seed: int, folder: Path) -> dict:
    """Draw one world, record it, ask, and return the answer beside the truth."""
    world = draw_world(seed, int(name))
    runs = world.make(np.random.default_rng([seed, int(name), 1]))
    answer = TASKS[question](dc.load_dataset(write_folder(folder / "data", runs)), world)
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


def _held_out(data: dc.Dataset) -> list[str]:
    return [name for name in data.names if name.startswith(HELD)]


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
