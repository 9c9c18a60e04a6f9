"""What the closed loop answers on the data of every named law, when it is told Maxwell's.

scipy makes three start-ups and three oscillations of each law on full tensors (`independent`, which
shares nothing with the software under test) with 1 % noise; of both the fastest is held out. The
loop is told the upper convected Maxwell law with the modes of small strain, and asked twice: with
its default candidates, and with `law = "any"`. Rules for what counts as a confident falsehood are
those of `bad_days.py`, written before the first run, with one more:

- With `law = "any"`, the law chosen is false if the truth fits the runs better and is told apart
  from it, under a verdict other than *unexplained*.

A name is true if it is a part of the law, and where no name of the dictionary is a part of the law
every name is false; *effects added* is then false too where the prediction misses what scipy says,
without noise, by more than the noise.

    python benchmarks/laws_as_truth.py --out laws_as_truth
    python benchmarks/laws_as_truth.py --out laws_as_truth --laws giesekus xpp --ask default
    python benchmarks/laws_as_truth.py --out laws_as_truth --table

Each pair of law and question prints one line of JSON and is kept in a file, and what is kept is not
run again. `--table` prints what is kept as Markdown.
"""

import argparse
import json
import time
import traceback
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from bad_day_cases import LAMBDA, SCALE, Case, G, Runs
from bad_day_rules import CONFIDENT, HELD_OUT_DETECTABLE, judge
from bad_days import make, without_pages, write
from independent import Structured, Thixotropic, UpperConvectedMaxwell, oscillation, start_up
from independent.flow import Flow
from independent.instruments import Instrument
from independent.named import CONSTANTS, linear_modes, material

_GROWTH, _WAVE = np.linspace(0.1, 8.0, 60), np.linspace(0.0, 4.0 * np.pi, 81)
FLOWS: dict[str, tuple[Flow, np.ndarray]] = {
    "start_0.5.csv": (start_up(0.5), _GROWTH),
    "start_2.csv": (start_up(2.0), _GROWTH),
    "wave_1.csv": (oscillation(1.0, 1.0), _WAVE),
    "wave_2.csv": (oscillation(2.0, 1.0), _WAVE),
    "start_4.csv": (start_up(4.0), _GROWTH),
    "wave_4.csv": (oscillation(4.0, 1.0), _WAVE),
}
HELD_OUT = ("start_4.csv", "wave_4.csv")

PLANTED: dict[str, dict[str, dict[str, float]]] = {
    "johnson_segalman": {"non_affine_motion": {"xi": 0.2}},
    "giesekus": {"giesekus_mobility": {"alpha": 0.3}},
    "ptt_linear": {"ptt_linear": {"epsilon": 0.25}},
    "ptt_exponential": {"ptt_exponential": {"epsilon": 0.2}},
    "fene_p": {"finite_extensibility": {"q": 0.02}},
    "giesekus_non_affine": {"giesekus_mobility": {"alpha": 0.2}, "non_affine_motion": {"xi": 0.1}},
    "ptt_linear_non_affine": {"ptt_linear": {"epsilon": 0.2}, "non_affine_motion": {"xi": 0.15}},
    "ptt_exponential_non_affine": {
        "ptt_exponential": {"epsilon": 0.2},
        "non_affine_motion": {"xi": 0.15},
    },
    "saramito": {"yield_stress": {"yield_strain": 0.4}},
    "thixotropy": {"thixotropy": {"breakdown": 0.3, "build_up_time": 5.0}},
    "thixotropic_relaxation": {
        "thixotropic_relaxation": {
            "inverse_critical_rate": 1.0,
            "build_up_time": 3.0,
            "exponent": 1.0,
        }
    },
}
STRUCTURED = {
    "thixotropy": Thixotropic(UpperConvectedMaxwell(**SCALE), 0.3, 5.0),
    "thixotropic_relaxation": Structured(1.0, (3.0,), modulus=G, mobility=0.0),
}
LAWS = (*CONSTANTS, *STRUCTURED)
ASKS = ("default", "any")


def case_of(law: str, ask: str) -> Case:
    """Return the records of a law, and what the loop is told of them."""
    made = STRUCTURED[law] if law in STRUCTURED else material(law, CONSTANTS[law], **SCALE)
    moduli, times = linear_modes(law, CONSTANTS.get(law, {}), **SCALE)
    model = {"law": "any" if ask == "any" else "ucm"}
    one_mode = len(moduli) == 1
    model |= {"modulus_Pa": G, "relaxation_time_s": LAMBDA} if one_mode else {"modes": "lve"}
    # where the law itself is chosen, what is left is to be a part of no law
    planted = PLANTED.get(law, {}) if ask == "default" or law in STRUCTURED else {}
    effects = {"effects": [law]} if law == "thixotropic_relaxation" else {}
    return Case(
        truth=law,
        runs=lambda: {name: Instrument().record(made, *flow) for name, flow in FLOWS.items()},
        planted=planted,
        outside=ask == "default" and law not in PLANTED and law != "ucm",
        model=model,
        loop=effects,
        modes=None if one_mode else (moduli, times),
        held_out=HELD_OUT,
    )


def run(law: str, ask: str, out: Path, seed: int) -> dict:
    """Return the row of a law and a question."""
    from discover.batch.tasks import run_close_loop

    case, folder = case_of(law, ask), out / f"{law}-{ask}"
    clean, noisy = make(case, seed)
    study = write(case, noisy, folder)["close-loop"]
    text = study.read_text(encoding="utf-8").replace('effects = "named"\n', "")
    study.write_text(text.replace("max_effects = 2", "max_effects = 3"), encoding="utf-8")
    row = {"law": law, "ask": ask, "seed": seed}
    started = time.process_time()
    try:
        with warnings.catch_warnings(), without_pages():
            warnings.simplefilter("ignore")
            run_close_loop(study, folder / "loop", None, True, lambda text, fraction: None)
        row |= judge(case, "close-loop", folder / "loop", clean, noisy)
        row |= told(folder / "loop", law, ask, row, clean)
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(last.filename).name}, line {last.lineno}"
        row |= {"verdict": "fault", "message": f"{type(error).__name__}: {error} ({where})"}
    return {**row, "seconds": round(time.process_time() - started, 1)}


def told(folder: Path, law: str, ask: str, row: dict, clean: Runs) -> dict:
    """Return the law chosen, probabilities, coverage of the bands, and further falsehoods."""
    said = json.loads((folder / "loop.json").read_text(encoding="utf-8"))
    first = (said.get("explanations") or [{}])[0]
    found = {
        "probability": first.get("probability"),
        "unexplained_probability": said.get("unexplained_probability"),
        "inclusion": said.get("inclusion", {}),
        "coverage": coverage(folder / "predictions.csv", clean),
        "falsehoods": row["falsehoods"],
    }
    if ask == "any":
        laws = said["laws"]
        found["chosen"] = laws[0]["law"]
        found["parameters"] = laws[0]["parameters"]
        found["as_well"] = [one["law"] for one in laws[1:] if not one["is_told_apart"]]
        truth = next((one for one in laws if one["law"] == law), None)
        if row["verdict"] in CONFIDENT:
            _, held = row["miss_over_noise"]["augmented"]
            if held is not None and held > HELD_OUT_DETECTABLE:
                found["falsehoods"].append(
                    f"{row['verdict']}, but misses held-out runs by {held:.2g} of the noise"
                )
            if truth and laws[0]["law"] != law and truth["is_told_apart"]:
                found["falsehoods"].append(f"{laws[0]['law']} chosen and told apart from the truth")
    return found


def coverage(predictions: Path, clean: Runs) -> dict[str, float | None]:
    """Return the share of samples without noise that the band of σ12 holds, and of N1."""
    import csv

    inside: dict[str, list[bool]] = {"fit": [], "held_out": [], "N1": []}
    with predictions.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    sources = {row["source"] for row in rows}
    source = "augmented" if "augmented" in sources else "declared"
    for row in rows:
        if row["source"] != source or row["role"] not in ("fit", "held_out") or not row["low95"]:
            continue
        if row["quantity"] not in ("sigma12", "N1"):
            continue
        record = clean[row["run"]]
        exact = record.stress if row["quantity"] == "sigma12" else record.true.N1
        there = np.interp(float(row["time_s"]), record.time, exact)
        key = "N1" if row["quantity"] == "N1" else row["role"]
        inside[key].append(float(row["low95"]) <= there <= float(row["high95"]))
    return {key: float(np.mean(held)) if held else None for key, held in inside.items()}


def table(rows: Sequence[dict]) -> str:
    """Return what was answered as Markdown, a table for each question."""
    lines = []
    for ask in ASKS:
        lines += ["", f"{ask}", ""]
        lines.append(
            "| law | verdict | named | probability | none of them | fitted, held out, % | "
            "off the truth, over the noise | in the band, held out, % | false |"
        )
        lines.append("|---|---|---|---|---|---|---|---|---|")
        lines += [line(row) for row in rows if row["ask"] == ask]
    return "\n".join(lines)


def line(row: dict) -> str:
    """Return one line of the table."""
    if row["verdict"] in ("fault", "refused"):
        return f"| {row['law']} | {row['verdict']}: {row['message']} | | | | | | | |"

    def number(value, scale=1.0, digits=2):
        return "–" if value is None else f"{scale * value:.{digits}g}"

    names = [" or ".join([s["effect"], *s["aliases"]]) for s in row["stages"]]
    if "chosen" in row:
        as_well = f" (as well: {', '.join(row['as_well'])})" if row["as_well"] else ""
        names = [row["chosen"] + as_well, *names]
    error, misses = row["error"], row["miss_over_noise"]["augmented"]
    cells = [
        row["law"],
        row["verdict"].replace("_", " "),
        ", ".join(names) or "–",
        number(row["probability"]),
        number(row["unexplained_probability"]),
        f"{number(error['fit'], 100)}, {number(error['held_out'], 100)}",
        ", ".join(number(one) for one in misses),
        number(row["coverage"]["held_out"], 100, 3),
        "; ".join(row["falsehoods"]) or "–",
    ]
    return f"| {' | '.join(cells)} |"


def main(arguments: Sequence[str] | None = None) -> None:
    """Run what is not kept yet, and print it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--laws", nargs="+", default=LAWS, choices=LAWS)
    parser.add_argument("--ask", nargs="+", default=ASKS, choices=ASKS)
    parser.add_argument("--seed", type=int, default=20261124)
    parser.add_argument("--table", action="store_true", help="print what is kept, run nothing")
    given = parser.parse_args(arguments)
    rows = []
    for ask in given.ask:
        for law in given.laws:
            kept = given.out / f"{law}-{ask}.json"
            if not kept.exists() and not given.table:
                given.out.mkdir(parents=True, exist_ok=True)
                kept.write_text(json.dumps(run(law, ask, given.out, given.seed)), encoding="utf-8")
                print(kept.read_text(encoding="utf-8"), flush=True)
            if kept.exists():
                rows.append(json.loads(kept.read_text(encoding="utf-8")))
    print(table(rows))


if __name__ == "__main__":
    main()
