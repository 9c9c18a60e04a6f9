"""Are the loop's probabilities and bands those of the world? On records that share no code with it.

A law and an instrument are drawn, half of the laws and some of the flaws from outside library and
dictionary, and recorded by `independent` (scipy alone). The loop is told a Maxwell fluid. Two
faster flows are held out. Results are appended to a file of JSON lines, so a stopped run goes on.

Seed 0 served for development. The seeds that judge, written down before they were run: 20261124,
and 20261125 after the bands were widened.

    python benchmarks/explanations.py --seed 20261125 --cases 16 --out explanations.jsonl
"""

import argparse
import json
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from independent.fene_p import FenePeterlin
from independent.flow import Flow, oscillation, start_up
from independent.folders import write_folder
from independent.giesekus import Giesekus
from independent.instruments import Instrument
from independent.johnson_segalman import JohnsonSegalman
from independent.k_bkz import KBKZ
from independent.material import Material
from independent.maxwell import UpperConvectedMaxwell
from independent.phan_thien_tanner import PhanThienTanner
from independent.pom_pom import ExtendedPomPom, PomPom
from independent.rolie_poly import RoliePoly
from independent.white_metzner import WhiteMetzner

import discover as dc

MODULUS, TIME, NOISE, SAMPLES = 100.0, 1.0, 0.01, 120
FITTED: dict[str, tuple[Flow, float]] = {
    "up.csv": (start_up(1.0), 6.0),
    "fast_up.csv": (start_up(3.0), 5.0),
    "swing.csv": (oscillation(2.0, 1.0), 12.0),
    "wide.csv": (oscillation(3.0, 0.5), 14.0),
}
HELD_OUT: dict[str, tuple[Flow, float]] = {
    "faster_up.csv": (start_up(5.0), 4.0),
    "faster_swing.csv": (oscillation(5.0, 1.5), 8.0),
}


@dataclass(frozen=True)
class Planted:
    """What is in the records: the names that are right, none of them if nothing the loop knows is.

    Attributes
    ----------
    name
        In words.
    material, instrument
        What makes the records.
    right
        For each effect that is there, the names that are right; None if one is in no dictionary.
    """

    name: str
    material: Material
    instrument: Instrument
    right: tuple[frozenset[str], ...] | None


def inside(draw) -> list[tuple[str, Material, tuple[frozenset[str], ...]]]:
    """Return laws that the loop knows."""

    def names(*spelled: str) -> tuple[frozenset[str], ...]:
        return (frozenset(spelled),)

    # in shear σ12 alone tells no one of these from its twins
    affine = ("non_affine_motion", "tr(sigma)*gammadot", "sigma.gammadot+gammadot.sigma")
    return [
        ("Maxwell", UpperConvectedMaxwell(MODULUS, TIME), ()),
        (
            "Giesekus",
            Giesekus(draw(0.1, 0.5), MODULUS, TIME),
            names("giesekus_mobility", "sigma.sigma"),
        ),
        ("Johnson-Segalman", JohnsonSegalman(draw(0.1, 0.4), MODULUS, TIME), names(*affine)),
        (
            "linear PTT",
            PhanThienTanner(draw(0.1, 0.4), "linear", 0.0, MODULUS, TIME),
            names("ptt_linear", "tr(sigma)*sigma"),
        ),
        (
            "exponential PTT",
            PhanThienTanner(draw(0.1, 0.4), "exponential", 0.0, MODULUS, TIME),
            names("ptt_exponential"),
        ),
        (
            "FENE-P",
            FenePeterlin(draw(20.0, 60.0), MODULUS, TIME),
            names("finite_extensibility"),
        ),
    ]


def outside(draw) -> list[tuple[str, Material]]:
    """Return laws that it does not know."""
    return [
        ("Rolie-Poly", RoliePoly(draw(0.5, 1.0), draw(0.05, 0.2), -0.5, MODULUS, TIME)),
        ("pom-pom", PomPom(draw(3.0, 6.0), draw(0.2, 0.6), MODULUS, TIME)),
        ("White-Metzner", WhiteMetzner(draw(0.4, 0.7), draw(0.5, 1.5), MODULUS, TIME)),
        ("K-BKZ", KBKZ(draw(0.1, 0.3), -0.15, MODULUS, TIME)),
        ("extended pom-pom", ExtendedPomPom(modulus=MODULUS, relaxation_time=TIME)),
    ]


def instruments(draw) -> list[tuple[str, Instrument, tuple[frozenset[str], ...] | None]]:
    """Return instruments, most without a flaw, and the names of their flaws."""
    one = [
        ("sound", Instrument(), ()),
        ("gain", Instrument(gain=draw(0.05, 0.15)), (frozenset({"stress_gain", "rate_gain"}),)),
        (
            "lag",
            Instrument(lag=draw(0.05, 0.15)),
            (frozenset({"transducer_lag", "time_delay", "rate_rise_time"}),),
        ),
        ("saturated", Instrument(limit=draw(0.6, 0.8)), None),
    ]
    return [one[0]] * 5 + one[1:]


def planted(index: int, seed: int) -> Planted:
    """Return one case; odd ones have a law from outside."""
    generator = np.random.default_rng([seed, index])

    def draw(low: float, high: float) -> float:
        return float(generator.uniform(low, high))

    kinds = instruments(draw)
    flaw, instrument, flaws = kinds[int(generator.integers(len(kinds)))]
    if index % 2:
        found = outside(draw)
        name, material = found[(index // 2) % len(found)]
        if flaw == "saturated" or isinstance(material, KBKZ):  # one unknown thing is enough
            flaw, instrument = "sound", Instrument()
        return Planted(f"{name}, {flaw}", material, instrument, None)
    known = inside(draw)
    name, material, right = known[(index // 2) % len(known)]
    if flaw == "saturated":
        flow, end = FITTED["fast_up.csv"]
        largest = np.max(material.respond(flow, np.linspace(0.0, end, 200)).sigma12)
        instrument = replace(instrument, limit=instrument.limit * float(largest))
    return Planted(
        f"{name}, {flaw}", material, instrument, None if flaws is None else right + flaws
    )


def run_case(index: int, seed: int) -> dict:
    """Close the loop on one case and return what it said, beside what is there."""
    case, generator = planted(index, seed), np.random.default_rng([seed, index, 1])
    runs = {}
    for name, (flow, end) in {**FITTED, **HELD_OUT}.items():
        run = case.instrument.record(case.material, flow, np.linspace(0.02, end, SAMPLES))
        noise = NOISE * np.sqrt(np.mean(run.stress**2)) * generator.standard_normal(SAMPLES)
        runs[name] = replace(run, stress=run.stress + noise)
    with tempfile.TemporaryDirectory() as folder:
        data = dc.load_dataset(write_folder(Path(folder) / "data", runs))
        base = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME)
        started = time.perf_counter()
        loop = dc.close_loop(data, base, held_out=list(HELD_OUT), max_effects=3)
    told = loop.explanations
    first = told.likeliest_first[0]
    held = [r for r in loop.records if r.held_out and r.band is not None]
    return {
        "index": index,
        "case": case.name,
        "inside": case.right is not None,
        "verdict": loop.verdict,
        "likeliest": [list(one) for one in first.members],
        "probability": first.probability,
        "right": case.right is not None
        and any(_is_right(one, case.right) for one in first.members),
        "unexplained": told.unexplained_probability,
        "errors": [loop.error_after.fit, loop.error_after.held_out],
        "held": [float(np.mean((r.band[0] <= r.measured) & (r.measured <= r.band[1])))
                 for r in held],
        "half_width": [float(0.5 * np.sqrt(np.mean((r.band[1] - r.band[0]) ** 2)
                                           / np.mean(r.measured**2))) for r in held],
        "seconds": time.perf_counter() - started,
    }  # fmt: skip


def _is_right(effects: tuple[str, ...], right: tuple[frozenset[str], ...]) -> bool:
    """Whether every effect that is there is named, once, and nothing else."""
    found = [next((i for i, names in enumerate(right) if e in names), None) for e in effects]
    return None not in found and sorted(found) == list(range(len(right)))


def summary(cases: list[dict]) -> str:
    """Return the table of what was said and what was so."""
    lines = []
    for where in (True, False):
        some = [c for c in cases if c["inside"] is where]
        if not some:
            continue
        held = np.concatenate([c["held"] for c in some])
        width = np.concatenate([c["half_width"] for c in some])
        lines += [
            f"{'inside' if where else 'outside'} library and dictionary: {len(some)} cases",
            f"  probability of none of the explanations, mean "
            f"{np.mean([c['unexplained'] for c in some]):.2f}; verdict unexplained in "
            f"{sum(c['verdict'] == 'unexplained' for c in some)}",
            f"  samples of held-out runs in the band {100 * np.mean(held):.0f} %, runs held to 90 %"
            f" of their samples {sum(held >= 0.9)} of {len(held)}, median half-width "
            f"{100 * np.median(width):.0f} %",
        ]
        if where:
            lines.append(f"  likeliest explanation right in {sum(c['right'] for c in some)}")
    said = np.array([c["probability"] for c in cases])
    right = np.array([c["right"] for c in cases], float)
    error = 0.0
    for low in np.arange(0.0, 1.0, 0.2):
        among = (said >= low) & (said < low + 0.2)
        if np.any(among):
            error += np.mean(among) * abs(np.mean(said[among]) - np.mean(right[among]))
            lines.append(
                f"said {np.mean(said[among]):.2f}, so in {np.mean(right[among]):.2f} of "
                f"{np.count_nonzero(among)}"
            )
    lines.append(f"expected calibration error {error:.2f}")
    lines.append(f"seconds a case, median {np.median([c['seconds'] for c in cases]):.0f}")
    return "\n".join(lines)


def main() -> None:
    """Run the cases that are not there yet, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--cases", type=int, default=12)
    parser.add_argument("--out", type=Path, default=Path("explanations.jsonl"))
    options = parser.parse_args()
    lines = options.out.read_text().splitlines() if options.out.exists() else []
    cases = [json.loads(line) for line in lines]
    there = {case["index"] for case in cases}
    for index in range(options.cases):
        if index in there:
            continue
        case = run_case(index, options.seed)
        cases.append(case)
        with options.out.open("a") as file:
            file.write(json.dumps(case) + "\n")
        print(f"{index + 1} of {options.cases}: {case['case']}: {case['verdict']}, "
              f"{case['likeliest'][0]} {case['probability']:.2f}, none {case['unexplained']:.2f}, "
              f"held {case['held']}", flush=True)  # fmt: skip
    print(summary(cases))


if __name__ == "__main__":
    main()
