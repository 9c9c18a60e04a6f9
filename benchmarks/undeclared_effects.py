"""How often the closed loop names what it was not told.

Flaws of drawn kind and size are planted in the records of a base law; the loop is told the base
law alone. Results are appended to a file of JSON lines, so a stopped run goes on where it stopped.

    python benchmarks/undeclared_effects.py --cases 60 --out undeclared
"""

import argparse
import json
import time
from collections import Counter, defaultdict
from itertools import pairwise
from pathlib import Path

import numpy as np
from planting import OUTSIDE, Noise, PlantedCase, Planter

from discover.compilation_cache import enable_compilation_cache
from discover.effects import named_effects
from discover.errors import InputError
from discover.loop import LoopResult, run_loop
from discover.precision import enable_x64

# one round of kinds; with ten cases each kind has been met
KINDS = (
    "one", "outside", "one", "clean", "two", "one", "one", "outside", "two", "wrong_law",
)  # fmt: skip
LAWS = ("ucm", "giesekus")
NOISE, CORRELATION = 0.01, 0.6
SMALLEST, LARGEST = 0.05, 0.30
HONEST = 1.5
"""An alias predicts held-out runs if it misses them by no more than this many times the noise."""

_planters: dict[str, Planter] = {}


def planter(law: str) -> Planter:
    """Return the planter of a base law, made once."""
    if law not in _planters:
        _planters[law] = Planter(law)
    return _planters[law]


def draw_case(index: int, seed: int) -> tuple[str, str, PlantedCase]:
    """Return kind, base law and case number `index`; the same for the same seed."""
    generator = np.random.default_rng([seed, index])
    kind = KINDS[index % len(KINDS)]
    law = LAWS[int(generator.integers(len(LAWS)))]
    noise = Noise(NOISE, CORRELATION if generator.random() < 1 / 3 else 0.0)
    # what the base law has already is not undeclared
    own = {"giesekus": "giesekus_mobility"}.get(law)
    # nor is what the loop tries on request alone among its answers
    names = [n for n, effect in named_effects().items() if n != own and not effect.on_request]
    while True:
        options = {"noise": noise, "seed": int(generator.integers(2**31))}
        size = float(np.exp(generator.uniform(np.log(SMALLEST), np.log(LARGEST))))
        try:
            if kind == "clean":
                return kind, law, planter(law).plant(**options)
            if kind == "outside":
                mechanism = str(generator.choice(list(OUTSIDE)))
                return kind, law, planter(law).plant(outside=mechanism, size=size, **options)
            if kind == "wrong_law":
                # PTT told as Giesekus: no single effect mends that
                told = planter("giesekus").declared
                case = planter("ptt_linear").plant(told=told, **options)
                return kind, "giesekus", case
            chosen = generator.choice(names, size=2 if kind == "two" else 1, replace=False)
            return kind, law, planter(law).plant([str(n) for n in chosen], size=size, **options)
        except InputError:
            continue  # this effect cannot change the stress so much: draw again


def judge(index: int, kind: str, law: str, case: PlantedCase, result: LoopResult) -> dict:
    """Return what is recorded of one case."""
    said = [{stage.effect, *stage.aliases} for stage in result.stages]
    planted = set(case.effects)
    parameters = []
    for stage in result.stages:
        for name, true in case.effects.get(stage.effect, {}).items():
            found = stage.parameters[name]
            parameters.append(
                {
                    "effect": stage.effect,
                    "parameter": name,
                    "error": abs(found.value - true) / abs(true),
                    "covered": found.ci95[0] <= true <= found.ci95[1],
                }
            )
    return {
        "index": index,
        "kind": kind,
        "law": law,
        "correlation": case.noise.correlation,
        "planted": {name: dict(values) for name, values in case.effects.items()},
        "outside": case.outside,
        "changes": dict(case.changes),
        "verdict": result.verdict,
        "stages": [[stage.effect, *stage.aliases] for stage in result.stages],
        "named": {name: any(name in names for names in said) for name in planted},
        "first_name": {name: any(s.effect == name for s in result.stages) for name in planted},
        "false": [s.effect for s, names in zip(result.stages, said, strict=True)
                  if not names & planted],
        # beside what was planted, or what the loop holds for the same
        "probable_besides": {
            name: probability
            for name, probability in result.explanations.inclusion.items()
            if probability >= 0.5 and not any(name in names and names & planted for names in said)
            and name not in planted
        },
        "unexplained_probability": result.explanations.unexplained_probability,
        "parameters": parameters,
        "before": [result.error_before.fit, result.error_before.held_out],
        "after": [result.error_after.fit, result.error_after.held_out],
        "seconds": result.seconds,
    }  # fmt: skip


def share(outcomes: list[bool]) -> dict:
    """Return a share with its 95 % interval   [Wilson 1927, JASA 22, 209]."""
    n = len(outcomes)
    if n == 0:
        return {"share": None, "of": 0}
    p, z = sum(outcomes) / n, 1.96
    middle = (p + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z * np.sqrt(p * (1 - p) / n + z**2 / (4 * n**2)) / (1 + z**2 / n)
    return {"share": p, "ci95": [max(0.0, middle - half), min(1.0, middle + half)], "of": n}


def summarise(rows: list[dict]) -> dict:
    """Return the figures of a benchmark."""
    flawed = [row for row in rows if row["planted"]]
    named = [(row, name, hit) for row in flawed for name, hit in row["named"].items()]
    alone = [(r, n, hit) for r, n, hit in named if r["kind"] == "one"]
    strange = [row for row in rows if row["kind"] in ("outside", "wrong_law")]
    estimates = [p for row in rows for p in row["parameters"]]

    def honest(row):
        predicts = row["after"][1] <= HONEST * NOISE
        return row["verdict"] == "unexplained" or (row["verdict"] == "effects_added" and predicts)

    by_size = {}
    edges = [5, 10, 20, 30]
    for low, high in pairwise(edges):
        inside = [
            hit for row, name, hit in named if low <= row["changes"][name] / NOISE < high * 1.001
        ]
        by_size[f"{low} to {high}"] = share(inside)
    confusion: dict[str, Counter] = defaultdict(Counter)
    for row in rows:
        label = " + ".join(row["planted"]) or row["outside"] or row["kind"]
        if row["kind"] == "two":
            for name, hit in row["named"].items():
                confusion[name][name if hit else (row["false"] or ["nothing"])[0]] += 1
            continue
        for names in row["stages"] or [["nothing"]]:
            confusion[label][label if label in names else names[0]] += 1
    return {
        "cases": len(rows),
        "named": share([hit for _, _, hit in named]),
        "named_alone": share([hit for _, _, hit in alone]),
        "named_first_alone": share([row["first_name"][name] for row, name, _ in alone]),
        "named_white": share([hit for row, _, hit in named if row["correlation"] == 0.0]),
        "named_correlated": share([hit for row, _, hit in named if row["correlation"] > 0.0]),
        "named_by_size_over_noise": by_size,
        "false_on_clean": share([bool(r["stages"]) for r in rows if r["kind"] == "clean"]),
        "false_besides_planted": share([bool(row["false"]) for row in flawed]),
        "probable_besides_planted": share([bool(row["probable_besides"]) for row in flawed]),
        "unexplained_though_in_dictionary": share(
            [row["verdict"] == "unexplained" for row in flawed]
        ),
        "outside_honest": share([honest(row) for row in strange]),
        "outside_unexplained": share([row["verdict"] == "unexplained" for row in strange]),
        "parameter_error_median": float(np.median([p["error"] for p in estimates] or [np.nan])),
        "interval_coverage": share([p["covered"] for p in estimates]),
        "held_out_before_median": float(np.median([r["before"][1] for r in flawed] or [np.nan])),
        "held_out_after_median": float(np.median([r["after"][1] for r in flawed] or [np.nan])),
        "seconds_median": float(np.median([row["seconds"] for row in rows])),
        "missed": [
            [row["index"], name, row["stages"], row["verdict"]]
            for row, name, hit in named
            if not hit
        ],
        "confusion": {key: dict(row) for key, row in sorted(confusion.items())},
    }


def draw_confusion(confusion: dict[str, dict[str, int]], path: Path) -> None:
    """Write a picture of what was planted against what was named."""
    import matplotlib.pyplot as plt

    plain = {*named_effects(), "nothing"}
    merged: dict[str, Counter] = {name: Counter() for name in confusion}
    for name, row in confusion.items():
        for said, count in row.items():
            merged[name][said if said in plain else "a term of the library"] += count
    confusion = {name: dict(row) for name, row in merged.items()}
    planted = sorted(confusion, key=lambda name: (name not in plain, name))
    others = sorted({name for row in confusion.values() for name in row} - set(planted))
    named = [name for name in planted if any(name in row for row in confusion.values())] + others
    counts = np.array([[confusion[p].get(n, 0) for n in named] for p in planted])
    figure, axes = plt.subplots(
        figsize=(2.5 + 0.28 * len(named), 2.0 + 0.24 * len(planted)), layout="constrained"
    )
    axes.imshow(counts > 0, cmap="Greys", vmin=0, vmax=4, aspect="auto")
    for (i, j), count in np.ndenumerate(counts):
        if count:
            weight = "bold" if planted[i] == named[j] else "normal"
            axes.text(j, i, str(count), ha="center", va="center", fontsize=7, fontweight=weight)
    axes.set_xticks(range(len(named)), named, rotation=90, fontsize=7)
    axes.set_yticks(range(len(planted)), planted, fontsize=7)
    axes.set_xlabel("named, or a declared alias of what was planted")
    axes.set_ylabel("planted")
    figure.savefig(path)
    plt.close(figure)


def main() -> None:
    """Run or resume the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=60)
    parser.add_argument("--first", type=int, default=0, help="index of the first case")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=float("inf"), help="stop after so long")
    parser.add_argument("--out", type=Path, default=Path("undeclared"))
    options = parser.parse_args()
    enable_x64()
    enable_compilation_cache()
    options.out.mkdir(parents=True, exist_ok=True)
    lines = options.out / "cases.jsonl"
    rows = [json.loads(line) for line in lines.read_text().splitlines()] if lines.exists() else []
    done = {row["index"] for row in rows}
    started = time.perf_counter()
    for index in range(options.first, options.first + options.cases):
        if index in done or time.perf_counter() - started > options.seconds:
            continue
        kind, law, case = draw_case(index, options.seed)
        result = run_loop(case.dataset, case.declared, held_out=case.held_out, max_effects=3)
        row = judge(index, kind, law, case, result)
        rows.append(row)
        with lines.open("a") as file:
            file.write(json.dumps(row) + "\n")
        what = ", ".join(f"{name} {100 * size:.0f} %" for name, size in row["changes"].items())
        print(
            f"{index:3d} {law} {kind}: {what or 'nothing'} -> {row['verdict']} {row['stages']} "
            f"({row['seconds']:.0f} s)",
            flush=True,
        )
    summary = summarise(rows)
    (options.out / "summary.json").write_text(json.dumps(summary, indent=2) + "\n")
    draw_confusion(summary["confusion"], options.out / "confusion.svg")
    print(json.dumps({k: v for k, v in summary.items() if k != "confusion"}, indent=1))


if __name__ == "__main__":
    main()
