"""Runs that are loadings of their own: how often a command that is told so is right.

Three start-ups and an oscillation are fitted and a faster start-up judges, by scipy, with 1 % of
noise and a factor of its own on each run. Each draw has other factors and another noise.

    python benchmarks/loadings.py --draws 100 --differ 0.03
    python benchmarks/loadings.py --task compare --draws 100
    python benchmarks/loadings.py --fluid extended_pom_pom --draws 20 --effects \
        giesekus_mobility,convective_constraint_release,ptt_linear,finite_extensibility
"""

import argparse
from typing import NamedTuple

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

import discover as dc
from discover.dataset import Dataset, Run
from discover.protocols import oscillatory_shear
from discover.protocols import start_up as protocol

GROWTH, WAVE = np.linspace(0.1, 8.0, 80), np.linspace(0.1, 12.0, 120)
FLOWS = {
    "slow.csv": (start_up(0.5), protocol(0.5), GROWTH),
    "middle.csv": (start_up(1.0), protocol(1.0), GROWTH),
    "fast.csv": (start_up(2.0), protocol(2.0), GROWTH),
    "wave.csv": (oscillation(2.0, 1.0), oscillatory_shear(2.0, 1.0), WAVE),
    "held.csv": (start_up(3.0), protocol(3.0), GROWTH),
}
FLUIDS = {
    "giesekus": Giesekus(0.3, 100.0),
    "k_bkz": KBKZ(modulus=100.0),
    "pom_pom": PomPom(modulus=100.0),
    "extended_pom_pom": ExtendedPomPom(modulus=100.0),
    "linear_ptt": PhanThienTanner(0.3, "linear", modulus=100.0, relaxation_time=1.0),
}
EFFECTS = ["giesekus_mobility", "ptt_linear", "non_affine_motion", "wall_slip", "stress_gain"]
NOISE, MOBILITY = 0.01, 0.3


def drawn(exact, seed: int, differ: float, correlation: float) -> tuple[Dataset, dict[str, float]]:
    """Return records of one draw, and the factors in them."""
    lot, runs, factors = np.random.default_rng(seed), [], {}
    for name, (flow, own, times) in FLOWS.items():
        stress = exact[name]
        factors[name] = 1.0 + differ * lot.standard_normal()
        noise = lot.standard_normal(len(times))
        for i in range(1, len(noise)):
            noise[i] = correlation * noise[i - 1] + np.sqrt(1.0 - correlation**2) * noise[i]
        noise *= NOISE * np.sqrt(np.mean(stress**2))
        rates = np.asarray(flow.rate(times), float) + 0.0 * times
        runs.append(Run(name, times, own, rates, factors[name] * stress + noise))
    return Dataset("runs", tuple(runs)), factors


class Answer(NamedTuple):
    """Whether a command explains the runs, the mobility if that is all it finds, the factors."""

    explained: bool
    mobility: tuple[float, float] | None
    factors: dict[str, tuple[float, float]]


def of_loop(data: Dataset, base: dc.Fluid, loading: float | None, effects: list[str]) -> Answer:
    """Return what a closed loop answers."""
    options = {"effects": effects, "max_effects": 2, "loading": loading}
    loop = dc.close_loop(data, base, held_out=["held.csv"], **options)
    mobility = None
    if [stage.effect for stage in loop.stages] == ["giesekus_mobility"]:
        mobility = loop.stages[0].parameters["alpha"].ci95
    told = loop.remaining.get("loading", {})
    factors = {name: one["ci95"] for name, one in told.items() if one["ci95"] is not None}
    return Answer(loop.verdict != "unexplained", mobility, factors)


def of_comparison(
    data: Dataset, base: dc.Fluid, loading: float | None, effects: list[str]
) -> Answer:
    """Return what sparse regression answers, which has no candidates but terms."""
    del effects
    options = {"learners": ["tensor_sindy"], "quick": True, "loading": loading}
    found = dc.compare(data, base, held_out=["held.csv"], **options)
    terms, mobility = found.outcomes["tensor_sindy"].terms, None
    if [term.term for term in terms] == ["sigma.sigma"]:
        mobility = terms[0].ci95
    told = [] if found.loadings is None else found.loadings.found["tensor_sindy"]
    factors = {one.run: one.ci95 for one in told if one.ci95 is not None}
    return Answer(found.verdict == "explained", mobility, factors)


ANSWERS = {"loop": of_loop, "compare": of_comparison}


def main() -> None:
    """Print the shares of draws."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--task", choices=ANSWERS, default="loop")
    parser.add_argument("--fluid", choices=FLUIDS, default="giesekus")
    parser.add_argument("--draws", type=int, default=100)
    parser.add_argument("--seed", type=int, default=5000)
    parser.add_argument("--differ", type=float, default=0.03)
    parser.add_argument("--told", type=float, default=0.03, help="0 tells the loop nothing")
    parser.add_argument("--correlation", type=float, default=0.0)
    parser.add_argument("--effects", default=",".join(EFFECTS), help="candidates of the loop")
    asked = parser.parse_args()
    fluid = FLUIDS[asked.fluid]
    exact = {name: fluid.respond(flow, times).sigma12 for name, (flow, _, times) in FLOWS.items()}
    base = dc.Fluid(dc.make_law("ucm"), [100.0], [1.0])
    explained = named = held = factors_held = factors_told = 0
    for seed in range(asked.seed, asked.seed + asked.draws):
        data, factors = drawn(exact, seed, asked.differ, asked.correlation)
        answer = ANSWERS[asked.task](data, base, asked.told or None, asked.effects.split(","))
        explained += answer.explained
        print(seed, "explained" if answer.explained else "unexplained", flush=True)
        if answer.mobility is not None:
            named += 1
            low, high = answer.mobility
            held += low < MOBILITY < high
        for name, (low, high) in answer.factors.items():
            factors_told += 1
            factors_held += low < factors[name] < high
    print(f"{asked.fluid}: {explained} of {asked.draws} explained; mobility alone in {named}, its")
    print(f"interval holds {MOBILITY} in {held}; {factors_held} of {factors_told} factors held")


if __name__ == "__main__":
    main()
