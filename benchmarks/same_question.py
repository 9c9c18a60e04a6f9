"""One question asked in other words, and whether both commands give one answer.

Records of `hostile_fluids`, by scipy, are written anew so that nothing that is known changes:

- ``units``: times a thousandth (2^-10) of what they were and stresses a thousand times as large
  (2^10, so that no digit is rounded); rates and what is declared follow.
- ``turned``: the tool turns the other way, so rates, strains and shear stresses change their sign.
- ``renamed``: the files have other names and another order.
- ``nudged``: stresses differ by 1e-9 of themselves. What this changes is decided by chance.

What is printed for each is what differs: a verdict, a name of one half or more, a probability by
more than 0.05, a constant or an end of its interval by more than a tenth of the interval, an error
by more than a tenth of itself.

    python benchmarks/same_question.py --out same --cases baseline,k_bkz
"""

import argparse
import csv
import json
import re
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pint
from bad_days import answer
from hostile_fluids import TASKS, make, write
from hostile_fluids_noises_cases import CASES
from independent.folders import write_study

POWER = 10
DEFAULT = "baseline,lag_and_slip,k_bkz,two_own,creep_giesekus,pulled_pec,curve_pec"
_UNITS = pint.UnitRegistry()
_TURN = ("shear_rate", "stress", "strain")


def _scale(unit: str) -> float:
    """Return the factor on a number in this unit; lengths stay as they are."""
    dimensions = _UNITS.get_dimensionality(unit) if unit else {}
    mass, time = (float(str(dimensions.get(name, 0))) for name in ("[mass]", "[time]"))
    stress, time = mass, time + 2 * mass  # Pa is kg/(m s²)
    return 2.0 ** (POWER * (stress - time))


def _unit(heading: str) -> str:
    """Return the unit at the end of a column's or a key's name."""
    if heading.endswith("rad_s"):
        return "1/s"
    found = re.search(r"_(1_s|1_Pa|Pa_s|Pa|s)$", heading)
    return found[1].replace("1_", "1/").replace("_", " ") if found else ""


def units(heading: str, values: np.ndarray) -> np.ndarray:
    """Return a column in other units."""
    return values * _scale(_unit(heading))


def turned(heading: str, values: np.ndarray) -> np.ndarray:
    """Return a column with the tool turning the other way."""
    sheared = heading.startswith(_TURN) and "hencky" not in heading
    return -values if sheared else values


def nudged(heading: str, values: np.ndarray) -> np.ndarray:
    """Return a column whose stresses are off by 1e-9 of themselves."""
    if not heading.startswith(("stress", "tensile", "Gp")):
        return values
    return values * (1.0 + 1e-9 * np.random.default_rng(len(values)).standard_normal(len(values)))


def same(heading: str, values: np.ndarray) -> np.ndarray:
    """Return a column as it is."""
    del heading
    return values


WORDS = {"units": units, "turned": turned, "renamed": same, "nudged": nudged}


def reworded(study: Path, words: str, folder: Path) -> Path:
    """Write the data and the study in other words; return the study."""
    told = tomllib.loads(study.read_text("utf-8"))
    data = Path(told["data"]["folder"])
    change = WORDS[words]
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "data").mkdir(parents=True)
    runs = list(csv.DictReader((data / "runs.csv").open(encoding="utf-8")))
    names = {run["file"]: run["file"] for run in runs}
    if words == "renamed":
        names = {name: f"{chr(ord('z') - k)}_{name}" for k, name in enumerate(names)}
        runs.reverse()
    for file in data.glob("*.csv"):
        if file.name == "runs.csv":
            continue
        with file.open(encoding="utf-8") as lines:
            heads = lines.readline().strip().split(",")
        columns = np.loadtxt(file, delimiter=",", skiprows=1, ndmin=2).T
        # a table of flow or moduli has magnitudes: it is alike whichever way the tool turned
        moved = change if file.name in names or words != "turned" else same
        changed = [moved(head, values) for head, values in zip(heads, columns, strict=True)]
        rows = [",".join(map(repr, map(float, row))) for row in np.array(changed).T]
        text = "\n".join([",".join(heads), *rows]) + "\n"
        (folder / "data" / names.get(file.name, file.name)).write_text(text, encoding="utf-8")
    lines = [",".join(runs[0])] if runs else ["file"]
    for run in runs:
        cells = [names[run["file"]]]
        cells += [_cell(change, head, cell) for head, cell in run.items() if head != "file"]
        lines.append(",".join(cells))
    (folder / "data" / "runs.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    told["data"]["folder"] = str((folder / "data").resolve())
    if isinstance(told["data"].get("held_out"), list):
        told["data"]["held_out"] = [names[name] for name in told["data"]["held_out"]]
    if words == "units":
        for section in ("data", "model"):
            for key, value in told[section].items():
                if isinstance(value, float | int) and not isinstance(value, bool):
                    told[section][key] = value * _scale(_unit(key))
    return write_study(folder / study.name, told)


def _cell(change, head: str, cell: str) -> str:
    try:
        number = float(cell)
    except ValueError:
        return cell
    return repr(float(change(head, np.array([number]))[0]))


def said(task: str, folder: Path, words: str) -> dict:
    """Return what an answer claims, in the units of the first question."""
    if task == "compare":
        content = json.loads((folder / "comparison.json").read_text("utf-8"))
        found = content["learners"]["tensor_sindy"]["terms"]
        return {
            "verdict": content["verdict"],
            "names": sorted(term["term"] for term in found),
            "shares": {},
            "open": sorted(content["undetermined"]),
            "constants": {term["term"]: (term["coefficient"], term["ci95"]) for term in found},
            "errors": [content["lack_of_fit"]["tensor_sindy"]["misfit"]],
        }
    content = json.loads((folder / "loop.json").read_text("utf-8"))
    constants = {}
    for stage in content["stages"]:
        for name, told in stage["parameters"].items():
            factor = _scale(told["unit"]) if words == "units" else 1.0
            turn = words == "turned" and told["unit"].startswith("Pa")  # an offset, or a drift
            sign = -1.0 if turn and stage["effect"] in ("stress_offset", "stress_drift") else 1.0
            ends = told["ci95"] and sorted(sign * e / factor for e in told["ci95"] if e is not None)
            constants[f"{stage['effect']}.{name}"] = (sign * told["value"] / factor, ends)
    errors = content["error_after"]
    return {
        "verdict": content["verdict"],
        "names": sorted(name for name, p in content["inclusion"].items() if p >= 0.5),
        "shares": {**content["inclusion"], "none": content["unexplained_probability"]},
        "open": sorted(name for stage in content["stages"] for name in stage["left_open"]),
        "constants": constants,
        "errors": [e for e in (errors["fit"], errors["held_out"]) if e is not None],
    }


def differences(one: dict, other: dict) -> list[str]:
    """Return in what two answers differ."""
    found = [f"{key}: {one[key]}, {other[key]}" for key in ("verdict", "names", "open")
             if one[key] != other[key]]  # fmt: skip
    for name in sorted({*one["shares"], *other["shares"]}):
        shares = [said["shares"].get(name, 0.0) for said in (one, other)]
        if abs(shares[0] - shares[1]) > 0.05:
            found.append(f"probability of {name}: {shares[0]:.2f}, {shares[1]:.2f}")
    for name in one["constants"].keys() & other["constants"].keys():
        (value, ends), (value2, ends2) = one["constants"][name], other["constants"][name]
        if bool(ends) != bool(ends2) or (ends and len(ends) != len(ends2)):
            found.append(f"interval of {name}: {ends}, {ends2}")
        elif ends and len(ends) == 2:
            moved = np.abs(np.array([value, *ends]) - np.array([value2, *ends2]))
            if np.max(moved) > 0.1 * (ends[1] - ends[0]):
                found.append(f"{name}: {value:.4g} {np.round(ends, 5)}, {value2:.4g} "
                             f"{np.round(ends2, 5)}")  # fmt: skip
    for before, after in zip(one["errors"], other["errors"], strict=True):
        if abs(before - after) > 0.1 * abs(before):
            found.append(f"error: {before:.4f}, {after:.4f}")
    return found


def ask(study: Path, task: str, folder: Path, words: str) -> dict:
    """Return what a command says, or how it ended; read it where it was asked before."""
    kept = folder.with_suffix(".json")
    if kept.is_file():
        return json.loads(kept.read_text("utf-8"))
    row = answer(study, task, folder, False, lambda: said(task, folder, words))
    row = {"names": [], "shares": {}, "open": [], "constants": {}, "errors": [], **row}
    kept.write_text(json.dumps(row), encoding="utf-8")
    return row


def main() -> None:
    """Ask, and print what differs."""
    parser = argparse.ArgumentParser(description="one question in other words")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--cases", default=DEFAULT, help="names of hostile_fluids, by commas")
    parser.add_argument("--task", choices=[*TASKS, "both"], default="both")
    parser.add_argument("--words", nargs="*", choices=[*WORDS], default=[*WORDS])
    asked = parser.parse_args()
    same_answers = count = 0
    for name in asked.cases.split(","):
        _, noisy = make(CASES[name], 0)
        studies = write(CASES[name], noisy, asked.out / name, 0)
        for task in TASKS if asked.task == "both" else (asked.task,):
            first = ask(studies[task], task, asked.out / name / task, "")
            print(f"{name}, {task}: {first['verdict']} {first.get('message', '')}", flush=True)
            for words in asked.words:
                folder = asked.out / name / f"{words}-{task}"
                study = reworded(studies[task], words, folder / "asked")
                differ = differences(first, ask(study, task, folder / task, words))
                count, same_answers = count + 1, same_answers + (not differ)
                print("".join(f"    {words}: {one}\n" for one in differ), end="", flush=True)
    print(f"\n{same_answers} of {count} answers are the same")


if __name__ == "__main__":
    main()
