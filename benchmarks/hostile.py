"""Data sets that an outside evaluator might make: what is claimed of them, against what is true.

Cases are lines of ``hostile.toml``; `independent` and scipy make the records, and the product gets
a data folder and a study file and no more. The rules, written before the first run:

1. **No fluid**: any verdict but `unexplained` and `no_signal` is false. A refusal is as good.
2. **Any verdict that claims to explain** is false where what is predicted misses the record
   without its noise by more than half the noise in the runs fitted, or than it in those held out.
3. **Names**: under such a verdict every effect or term with a probability of a half or more is
   there, or is an alias of one that is. A name that is less likely than not is listed.
4. **Intervals**: a constant that is known lies within three half-widths of its 95 % interval.
5. **N1, N2, σ12** of a comparison that are not said to be open are off, in every run, by no more
   than two half-bands (rms); 1 % where there is no band.
6. **Laws**: with `law = "any"` the law chosen is false if the truth is told apart from it.

To say `unexplained` of what could be explained is no falsehood; it is noted.
"""

import ast
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import hostile_benches
import hostile_fluids
import hostile_noises
import hostile_records
import hostile_tests
import independent
import numpy as np
import product
from hostile_records import FILE, SAMPLED, SCALE, Runs
from independent import authors, noise
from independent import named as by_name
from independent.folders import write_runs, write_table
from independent.noise import rms
from scipy.ndimage import median_filter

QUESTIONS, SEED, LIMIT = ("compare", "close-loop"), 0, 1200.0
DETECTABLE, HELD_OUT_DETECTABLE = 0.5, 1.0
"""Of the noise: a miss so large raises the squared residuals by a quarter, four standard errors of
their mean over 240 samples; of runs held out by once as much."""
HALF_WIDTHS, BANDS = 3.0, 2.0
RULED_OUT = 0.05
"""Probability of a law among all named, below which the product tells it from its answer."""
FLOOR = 2e-3
"""Of the rms: what sampling of the commanded rate and text cost."""
QUANTITY = {"stress_Pa": "sigma12", "tensile_stress_Pa": "tensile_stress"}
GROUPS = {name: [n for n in cases if n != "all"] for name, cases in FILE["sets"].items()}


OPERATIONS: dict[type, Callable] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv, ast.MatMult: operator.matmul, ast.Mod: operator.mod,
    ast.Pow: operator.pow, ast.BitOr: operator.or_, ast.Lt: operator.lt, ast.Gt: operator.gt,
    ast.NotEq: operator.ne, ast.Eq: operator.eq, ast.In: lambda one, many: one in many,
}  # fmt: skip


def _named(law: str):
    return by_name.material(law, by_name.CONSTANTS[law], **SCALE)


@cache
def words() -> dict[str, Any]:
    """Return what the expressions of the file may name."""
    known: dict[str, Any] = {name: getattr(np, name) for name in np.__all__}
    own = (hostile_benches, hostile_fluids, hostile_records, hostile_tests, hostile_noises)
    for module in (authors, independent, noise, *own):
        known |= vars(module)
    known |= SAMPLED | {"material": by_name.material, "named": _named, "len": len}
    known |= {"median_filter": median_filter}
    for name, text in FILE["names"].items():
        known[name] = evaluated(ast.parse(text, mode="eval").body, known)
    return known


def evaluated(node: ast.AST, known: Mapping[str, Any]) -> Any:
    """Return the value of an expression of numbers, names and calls; no other code runs."""

    def value(one: ast.AST) -> Any:
        return evaluated(one, known)

    match node:
        case ast.Constant(constant):
            return constant
        case ast.Name(name):
            return known[name]
        case ast.List(items) | ast.Tuple(items):
            return [value(one) for one in items]
        case ast.Dict(keys, values):
            return {value(k): value(v) for k, v in zip(keys, values, strict=True) if k}
        case ast.UnaryOp(ast.USub(), one):
            return -value(one)
        case ast.BinOp(left, how, right) | ast.Compare(left, [how], [right]):
            if type(how) in OPERATIONS:
                return OPERATIONS[type(how)](value(left), value(right))
        case ast.IfExp(test, this, that):
            return value(this if value(test) else that)
        case ast.Subscript(whole, at):
            return value(whole)[value(at)]
        case ast.Attribute(whole, name) if not name.startswith("_"):
            return getattr(value(whole), name)
        case ast.Lambda(arguments, body):
            names, defaults = [one.arg for one in arguments.args], map(value, arguments.defaults)
            own = dict(zip(reversed(names), reversed(list(defaults)), strict=False))
            return lambda *given, **more: evaluated(
                body, {**known, **own, **dict(zip(names, given, strict=False)), **more}
            )
        case ast.Call():
            function, given, named = called(node, known)
            return function(*given, **named)
    raise ValueError(f"{ast.unparse(node)} is no expression of hostile.toml.")


def called(node: ast.Call, known: Mapping[str, Any]) -> tuple[Callable, list, dict[str, Any]]:
    """Return a function with what it is called with."""
    given, named = [], {}
    for one in node.args:
        starred = isinstance(one, ast.Starred)
        value = evaluated(one.value if starred else one, known)
        given += value if starred else [value]
    for one in node.keywords:
        value = evaluated(one.value, known)
        named |= {one.arg: value} if one.arg else value
    return evaluated(node.func, known), given, named


def bound(text: str) -> Callable:
    """Return the call of an expression, for which what comes first is still to be given."""
    node = ast.parse(text, mode="eval").body

    def call(*first):
        if not isinstance(node, ast.Call):
            return evaluated(node, words())(*first)
        function, given, named = called(node, words())
        return function(*first, *given, **named)

    return call


@dataclass(frozen=True)
class Case:
    """One data set, what is declared of it, and what is true.

    `truth` in words.
    `records`, `noise`, `tables`, `export`: make the runs without noise, put it on what is observed,
        make tables beside them, and say what becomes of the runs once they have their noise.
    `planted`: effects that are there, with constants that are known.
    `same_as`: names that are no falsehood: they come to the same here, or describe the same thing.
    `outside`, `fluid`: whether no effect describes what is there, and whether there is a fluid.
    `model`, `compare_model`, `loop`, `compare`, `told`: sections of the studies; `compare` is False
        where no comparison is asked.
    `exact_tables`: whether tables have no noise.
    """

    truth: str
    records: Callable[[], Runs]
    noise: Callable
    tables: Callable | None = None
    export: Callable | None = None
    planted: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    same_as: tuple[str, ...] = ()
    outside: bool = False
    fluid: bool = True
    model: Mapping[str, Any] = field(default_factory=lambda: FILE["models"]["known"])
    compare_model: Mapping[str, Any] | None = None
    loop: Mapping[str, Any] = field(default_factory=lambda: {"max_effects": 3})
    compare: Any = field(
        default_factory=lambda: {"learners": ["tensor_sindy"], "library": {"degree": 1}}
    )
    told: Mapping[str, Any] = field(default_factory=dict)
    held_out: tuple[str, ...] = ("held.csv",)
    exact_tables: bool = False


def case_named(name: str) -> Case:
    """Return the case of a line of the file."""
    group = next(cases for cases in FILE["sets"].values() if name in cases)
    of_all, own = group.get("all", {}), dict(group[name])
    kind = FILE["kinds"].get(own.pop("kind", ""), {})
    told = {**of_all, **kind, **own}
    told["same_as"] = (*kind.get("same_as", ()), *own.get("same_as", ()))
    if "loop" in of_all:
        told["loop"] = of_all["loop"] | own.get("loop", {})
    for key in ("model", "compare_model"):
        if isinstance(told.get(key), str):
            told[key] = FILE["models"][told[key]]
    defaults = {"records": "recorded(GIESEKUS)", "noise": "white(0.01)"}
    for key in ("records", "noise", "tables", "export"):
        text = told.get(key, defaults.get(key))
        if text is not None:
            told[key] = bound(text)
    return Case(**told)


def make(case: Case, seed: int) -> tuple[Runs, Runs]:
    """Return the runs without and with their noise; the same for the same seed."""
    clean, noisy = case.records(), {}
    for number, (name, run) in enumerate(clean.items()):
        lot = np.random.default_rng([seed, number])
        noisy[name] = run.told(**{run.observed: case.noise(run.columns[run.observed], lot)})
    return (clean, noisy) if case.export is None else (case.export(clean), case.export(noisy))


def write(case: Case, noisy: Runs, folder: Path, seed: int) -> dict[str, Any]:
    """Write the data folder; return the section of a study on it."""
    columns = {name: run.columns for name, run in noisy.items()}
    write_runs(folder, columns, {name: run.cells for name, run in noisy.items()})
    source = {"folder": str(folder.resolve()), **case.told}
    if case.held_out:
        source["held_out"] = list(case.held_out)
    lot, told = np.random.default_rng([seed, 99]), {"strain", "omega_rad_s", "shear_rate_1_s"}
    for name, columns in (case.tables() if case.tables else {}).items():
        rough = {k: v if k in told or case.exact_tables
                 else v * (1 + 0.01 * lot.standard_normal(len(v)))
                 for k, v in columns.items()}  # fmt: skip
        write_table(folder / name, rough)
        if name != "lve.csv":  # the modes come from it
            source[name.removesuffix(".csv")] = "fit"
    return source


def is_asked(name: str, question: str) -> bool:
    return question == "close-loop" or bool(case_named(name).compare)


def run(name: str, question: str, seed: int, folder: Path) -> dict:
    """Return the row of one case and question."""
    case = case_named(name)
    clean, noisy = make(case, seed)
    sections = {"data": write(case, noisy, folder / "data", seed), "model": case.model}
    if question == "compare":
        sections |= {"model": case.compare_model or case.model, "compare": case.compare}
    else:
        sections["loop"] = case.loop
    said = product.answer(folder, question, sections)
    found = judge(case, question, said, product.predictions(folder), clean, noisy)
    return {"truth": case.truth, **found}


def judge(case: Case, question: str, said: dict, rows, clean: Runs, noisy: Runs) -> dict[str, Any]:
    """Return what is recorded of an answer: verdict, names, errors, falsehoods."""
    source = "augmented" if question == "close-loop" else "posterior"
    misses = {source: miss(case, rows, source, clean, noisy)}
    found = {
        "verdict": said["verdict"], "misses": misses, "constants": [], "false": [], "notes": [],
    }  # fmt: skip
    if question == "close-loop":
        of_loop(case, said, found)
    else:
        of_compare(case, said, rows, clean, found)
    confident = said["verdict"] in product.CONFIDENT
    if confident and not case.fluid:
        found["false"].append(f"{said['verdict']}, where no fluid is")
    elif confident:
        fit, held = misses[source]
        open_ = {s["quantity"] for s in said.get("statements", []) if s["determined"] == "no"}
        if fit > DETECTABLE or held > HELD_OUT_DETECTABLE:
            text = f"{said['verdict']}, but misses by {fit:.2g}, held out {held:.2g} of the noise"
            # a law whose σ12 is said to be open claims nothing of the run held out
            only_held = fit <= DETECTABLE and "sigma12" in open_
            found["notes" if only_held else "false"].append(text)
    if case.fluid and not case.outside and said["verdict"] == "unexplained":
        found["notes"].append("not explained, though it could be")
    return found


def of_loop(case: Case, said: dict, found: dict) -> None:
    """Judge names, probabilities, intervals and the law."""
    true, confident = {*case.planted, *case.same_as}, said["verdict"] in product.CONFIDENT
    sets = [(stage, {stage["effect"], *stage["aliases"]}) for stage in said["stages"]]
    found["named"] = [[stage["effect"], *stage["aliases"]] for stage, _ in sets]
    inclusion = said.get("inclusion", {})
    found["inclusion"] = {name: p for name, p in inclusion.items() if p >= 0.05}
    found["unexplained_probability"] = said.get("unexplained_probability")
    right = true.union(*(names for _, names in sets if names & true))
    for stage, names in sets if said["verdict"] == "effects_added" else ():
        likely = inclusion.get(stage["effect"], 1.0)
        if not names & true:
            text = f"{stage['effect']} is named, at {likely:.2f}, and not there"
            found["false" if likely >= 0.5 else "notes"].append(text)
        for name, value in case.planted.get(stage["effect"], {}).items():
            _interval(name, stage["parameters"][name], value, found)
    named = {stage["effect"] for stage, _ in sets}
    for name in (n for n, p in inclusion.items() if p >= 0.5 and n not in right | named):
        text = f"{name} has a probability of {inclusion[name]:.2f}"
        found["false" if confident else "notes"].append(text)
    if laws := said.get("laws"):
        found["law"] = laws[0]["law"]
        apart = {one["law"] for one in laws[1:] if (one["probability"] or 0.0) < RULED_OUT}
        if confident and case.truth in apart:
            found["false"].append(f"{found['law']} chosen and told apart from the truth")


def of_compare(case: Case, said: dict, rows, clean: Runs, found: dict) -> None:
    """Judge the law of the posterior as one of a loop, and the quantities it has a number for."""
    posterior = said["posterior"]
    found["undetermined"] = said["undetermined"]
    explained = said["verdict"] == "explained"
    verdict = "unexplained" if not explained else "effects_added"
    keys = ("inclusion", "unexplained_probability")
    law = {"verdict": verdict, "stages": posterior["effects"]} | {k: posterior[k] for k in keys}
    of_loop(case, law, found)
    if not explained:
        return
    open_ = {s["quantity"] for s in said["statements"] if s["determined"] == "no"}
    for quantity in {"N1", "N2", "sigma12"} - open_ - {*said["undetermined"]}:
        _band(quantity, rows, clean, found)


def _interval(name: str, value: dict, true: float, found: dict) -> None:
    low, high = value["ci95"] or (None, None)
    if low is None or high is None or not np.isfinite([low, high]).all():
        return
    found["constants"].append([name, true, value["value"], low, high])
    if abs(value["value"] - true) > HALF_WIDTHS * (high - low) / 2 + 1e-4 * abs(true):
        found["false"].append(
            f"{name} = {value['value']:.4g} ({low:.4g} to {high:.4g}), truly {true:.4g}"
        )


def _band(quantity: str, rows, clean: Runs, found: dict) -> None:
    """Judge the band of a quantity that is determined, in every run whose truth is known."""
    for run, record in clean.items():
        truth = getattr(record, quantity, None)
        if quantity == "sigma12" and record.observed == "stress_Pa":
            truth = record.columns["stress_Pa"]
        predicted = rows.get((run, quantity, "posterior"))
        if predicted is None or truth is None:
            continue
        scale = rms(truth if quantity == "sigma12" else record.N1)
        there = np.interp(predicted["time"], record.columns["time_s"], truth)
        half = (predicted["high"] - predicted["low"]) / 2
        # no band is a claim to be exact: the noise of σ12 is granted
        band = rms(half) if np.all(np.isfinite(half)) else 0.01 * scale
        off = rms(predicted["value"] - there)
        if off > BANDS * band + FLOOR * scale:
            found["false"].append(
                f"{quantity} of {run} is determined, and off by {100 * off / scale:.3g} % "
                f"(band {100 * band / scale:.2g} %)"
            )


def miss(case: Case, rows, source: str, clean: Runs, noisy: Runs) -> tuple[float, float]:
    """Return how far the record without noise is missed, over the noise: fitted, held out.

    Root-mean-square over runs; infinite where nothing is predicted, 0 where no run is.
    """
    parts: dict[bool, list[float]] = {False: [], True: []}
    for run, record in clean.items():
        values, times = record.columns[record.observed], record.columns["time_s"]
        key = (run, QUANTITY.get(record.observed, record.observed))
        predicted = rows.get((*key, source))
        if predicted is None and source == "augmented":
            predicted = rows.get((*key, "declared"))  # nothing was added
        size = max(rms(noisy[run].columns[record.observed] - values), FLOOR * rms(values))
        off = np.inf
        if predicted is not None and np.all(np.isfinite(predicted["value"])):
            off = rms(predicted["value"] - np.interp(predicted["time"], times, values)) / size
        parts[run in case.held_out].append(off)
    fit, held = (rms(np.array(parts[one])) if parts[one] else 0.0 for one in (False, True))
    return fit, held


def line(row: dict) -> str:
    """Return what an answer names, and by how much it misses."""
    named = ", ".join(" or ".join(names) for names in row["named"]) or "nothing"
    told = ", ".join(f"{n} {v:.3g} ({a:.3g} to {b:.3g})" for n, _, v, a, b in row["constants"])
    open_ = f"; open: {', '.join(row['undetermined'])}" if row.get("undetermined") else ""
    misses = "; ".join(f"{fit:.2g}, {held:.2g}" for fit, held in row["misses"].values())
    return f"{row.get('law', '')} {named} {told}{open_} [{misses}]"


def table(rows: list[dict]) -> str:
    """Return the answers as Markdown, and counts by set."""
    lines = ["| data | answers |", "|---|---|"]
    for row in rows:
        failed = "message" in row
        text = row["message"] if failed else line(row)
        false = "".join(f"; **false: {one}**" for one in row.get("false", ()))
        truth = row.get("truth", row["case"])
        lines.append(f"| {truth} | {row['question']}: *{row['verdict']}* {text}{false} |")
    heads = ("set", "answers", "false", "withheld", "failed", "intervals that hold")
    lines += ["", f"| {' | '.join(heads)} |", "|---" * 6 + "|"]
    for group, members in GROUPS.items():
        some = [row for row in rows if row["case"] in members]
        if some:
            told = [one for r in some for one in r.get("constants", ())]
            open_ = [r for r in some if "not explained, though it could be" in r.get("notes", ())]
            counts = [len(some), sum(bool(r.get("false")) for r in some), len(open_)]
            counts += [sum("message" in r for r in some)]
            held = sum(low <= true <= high for _, true, _, low, high in told)
            cells = [group, *map(str, counts), f"{held} of {len(told)}"]
            lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)
