"""Malformed inputs by kind: each writes sane ones into an empty folder, and harms one."""

import gzip
import io
import json
import random
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import harm
from harm import SANE, write_files
from independent.folders import to_toml

FOLDER, STUDY, COMPARISON = (SANE[name] for name in ("FOLDER", "STUDY", "COMPARISON"))
RESULTS, EXPORTS = SANE["RESULTS"], SANE["EXPORTS"]
_TOLD = {"declared": {"law": RESULTS["loop.json"]["law"], "effects": []}, "stages": [],
         "posterior": {"effects": [], "constants": {}}}  # fmt: skip
_DATA = {**EXPORTS, "sweep.txt": SANE["SWEEP"]}
_FORMS = ("python", "sympy", "latex", "json", "rheotool", "ufl")


@dataclass(frozen=True)
class Case:
    """One call of the command line, or of Python, on a malformed input.

    `call`: words after ``discover``, or a function of nothing.
    `names`: words of which the message must hold one: files, folders, keys, options.
    `nonsense`: what in it no sane program takes without a word.
    """

    call: list[str] | Callable[[], object]
    names: tuple[str, ...] = ("",)
    nonsense: str = ""


HARMED: dict[str, tuple[dict[str, Any], list[str], list[str]]] = {
    "data folder": (FOLDER, [*FOLDER],
                    ["data check R --clock-factor factor", "data show R", "data show R --json"]),
    "loop study": ({**FOLDER, "study.toml": STUDY}, [*["study.toml"] * 6, *FOLDER],
                   ["close-loop R/study.toml --out R/out"]),
    "compare study": ({"study.toml": COMPARISON}, ["study.toml"],
                      ["compare R/study.toml --out R/out"]),
    **{f"told by {name}": ({**FOLDER, f"old/{name}": tree | _TOLD,
                            "study.toml": STUDY | {"model": {"from": "old"}}}, [f"old/{name}"],
                           [f"{do} R/study.toml --out R/out" for do in ("compare", "close-loop")])
       for name, tree in RESULTS.items()},
    **{f"exported {name}": ({name: tree}, [name],
                            [f"export R --format {form}{out}" for form in _FORMS
                             for out in ("", " --out R/law.txt")])
       for name, tree in RESULTS.items()},
    "batch": ({**FOLDER, "s0.toml": STUDY, "s1.toml": COMPARISON}, ["s0.toml", "s1.toml"],
              ["batch R/s0.toml R/s1.toml --out R/out"]),
    "imported": (_DATA, [*EXPORTS, "sweep.txt"],
                 [f"data import R/{name}{sweep} --out R/data" for name in EXPORTS
                  for sweep in ("", " R/sweep.txt")]),
    "mapped": ({**EXPORTS, "map.toml": SANE["MAPPING"]}, ["map.toml"],
               ["data import --mapping R/map.toml --out R/data"]),
}  # fmt: skip
"""Files by kind, those of which one is harmed, and calls of which one is made; R is the folder."""


def _spelled(name: str, content: Any) -> str:
    if isinstance(content, str):
        return content
    return json.dumps(content) if name.endswith(".json") else to_toml(content)


def _wrong(content: Any, source: random.Random) -> Any:
    """Return half of the trees with values wronged, everything else as it is."""
    wrong = isinstance(content, dict) and source.random() < 0.5
    return harm.mutate_values(content, source) if wrong else content


def harmed(kind: str, root: Path, source: random.Random) -> Case:
    """Write the files of a kind, text as it is and trees by their ending, and harm one."""
    files, wronged, calls = HARMED[kind]
    name = source.choice(wronged)
    files = files | {name: _wrong(files[name], source)}
    for path, content in files.items():
        (root / path).parent.mkdir(exist_ok=True)
        write_files(root, {path: _spelled(path, content)})
    if files[name] is HARMED[kind][0][name]:
        harm.spoil(root, name, source)
    keys = {str(key) for tree in HARMED[kind][0].values() if isinstance(tree, dict)
            for _, key in harm.holders(tree)}  # fmt: skip
    stems = {word for name in files for word in (Path(name).name, Path(name).stem)}
    call = [word.replace("R", str(root), 1) if word[0] == "R" else word
            for word in source.choice(calls).split()]  # fmt: skip
    return Case(call, (*stems, *keys, str(root), "--", "rheoTool", "[[source]]"))


def nonsense_in_a_folder(root: Path, source: random.Random) -> Case:
    """Put a word for a number, or for a unit, where no sane program guesses."""
    write_files(root, FOLDER)
    lines = FOLDER["a.csv"].splitlines()
    if source.random() < 0.5:
        cells, word = lines[5].split(","), source.choice(
            ("nan", "inf", "0x1F", "1_000", "１２３", "1e999", "true", "½", "1 2", "#REF!", "1e")
        )  # fmt: skip
        cells[source.randrange(3)] = word
        lines[5] = ",".join(cells)
    else:
        word = source.choice(("time_s2", "stress_10Pa", "stress_9**9", "time_Hz", "stress_pi_Pa"))
        own = next(c for c in lines[0].split(",") if c.split("_")[0] == word.split("_")[0])
        lines[0] = lines[0].replace(own, word)
    (root / "a.csv").write_text("\n".join(lines) + "\n")
    return Case(["data", "check", str(root)], tuple(FOLDER), word)


def nonsense_in_a_study(root: Path, source: random.Random) -> Case:
    """Put a value of another kind, or beyond all sense, in one place of a good study."""
    write_files(root, FOLDER)
    tree = json.loads(json.dumps(STUDY))
    section, key = source.choice(
        [("model", "relaxation_time_s"), ("model", "law"), ("loop", "max_effects"),
         ("loop", "noise"), ("data", "fit"), ("model", "parameters")]
    )  # fmt: skip
    tree[section][key] = source.choice((float("nan"), -1, 10**40, "3", [[1]], {"a": 1}))
    (root / "study.toml").write_text(to_toml(tree), "utf-8")
    call = ["close-loop", str(root / "study.toml"), "--out", str(root / "out")]
    places = ("study.toml", *(str(key) for _, key in harm.holders(STUDY)))
    return Case(call, places, f"{section}.{key} = {tree[section][key]!r}")


def complete_results(root: Path) -> None:
    from discover.study import RunFolder, fingerprint, read_study

    write_files(root, {**FOLDER, "study.toml": to_toml(STUDY)})
    name = fingerprint(read_study(root / "study.toml"), "close-loop", None)
    folder = RunFolder(root / "out", name)
    folder.write("report.html", "<p>a report</p>")
    folder.write("loop.json", json.dumps(RESULTS["loop.json"]))
    folder.save("verdict", {"text": "an effect was added"})
    folder.finish()


def resumed(root: Path, source: random.Random) -> Case:
    """Damage a folder of results, and run the same study into it again, alone or in a batch."""
    complete_results(root)
    files = ("report.html", "loop.json", "state/study.json", "state/verdict.json")
    for name in source.sample(files, source.randint(1, 2)):
        harm.spoil((root / "out" / name).parent, Path(name).name, source)
    study, out = str(root / "study.toml"), str(root / "out")
    options = source.choice(([], ["--json"], ["--quiet"]))
    if source.random() < 0.5:
        (root / "batch").mkdir()
        (root / "out").rename(root / "batch" / "study")
        return Case(["batch", study, "--out", str(root / "batch"), *options], (out, "study"))
    return Case(["close-loop", study, "--out", out, *options], (out, *files))


def workbook(root: Path, source: random.Random) -> Case:
    """Harm a part of a spreadsheet's archive, or the archive."""
    import openpyxl

    book = openpyxl.Workbook()
    for line in EXPORTS["plain.csv"].splitlines():
        book.active.append(line.split(";"))  # type: ignore[union-attr]
    book.save(root / "x.xlsx")
    raw = _with_a_part_harmed((root / "x.xlsx").read_bytes(), source)
    (root / "x.xlsx").write_bytes(raw)
    call = ["data", "import", str(root / "x.xlsx"), "--out", str(root / "data")]
    return Case(call, ("x.xlsx", "--", "runs.csv"))


def _with_a_part_harmed(raw: bytes, source: random.Random) -> bytes:
    with zipfile.ZipFile(io.BytesIO(raw)) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    name = source.choice(list(parts))
    parts[name] = harm.mutate_text(parts[name].decode("utf-8", "replace"), source)
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in parts.items():
            archive.writestr(name, content)
    return file.getvalue()


def estimator(root: Path, source: random.Random) -> Case:
    """Harm what a saved estimator says of itself and of its arrays."""
    import discover as dc

    content = harm.mutate_values(SANE["ESTIMATOR"], source)
    raw = gzip.compress(json.dumps(content).encode("utf-8", "surrogatepass"))
    if source.random() < 0.2:
        at = source.randrange(len(raw))
        raw = raw[:at] + b"\x01\xff\xff" + raw[at + 3 :]
    (root / "e").write_bytes(raw)
    return Case(lambda: dc.load(root / "e"))


def frame(root: Path, source: random.Random) -> Case:
    """Put odd objects into a data frame."""
    import pandas as pd

    import discover as dc

    (root / "a.csv").write_text(FOLDER["a.csv"])
    table = pd.read_csv(root / "a.csv").assign(run="a.csv").astype(object)
    odd = [*harm.VALUES, 1j, b"x", pd.NaT, pd.NA, pd.Timestamp(0), object(), (1, 2)]
    options = {}
    match source.randrange(4):
        case 0:
            name = source.choice(("name", "clock_factor", "sequence", "rate_before", "x", "tables"))
            options = {name: source.choice(odd)}
        case 1:
            table = pd.concat([table, table], axis=source.choice((0, 1)))
        case 2:
            table = table.iloc[: source.choice((0, 1, 2))]
        case _:
            table.iat[source.randrange(len(table)), source.randrange(5)] = source.choice(odd)
    return Case(lambda: dc.from_dataframe(table, None, **options))


def options(root: Path, source: random.Random) -> Case:
    """Give wrong words on the command line."""
    write_files(root, {**FOLDER, **EXPORTS, "study.toml": to_toml(STUDY)})
    write_files(root, {"loop.json": json.dumps(RESULTS["loop.json"])})
    out, study, trios = ["--out", f"{root}/out"], f"{root}/study.toml", f"{root}/trios.txt"
    word = source.choice([t for t in harm.TOKENS if "\0" not in t])
    right = list(source.choice((
        ["close-loop", study, *out, "--seed", "1"], ["batch", study, *out, "--workers", "1"],
        ["export", str(root), "--format", "python", "--law", "augmented"],
        ["export", str(root), "--format", "rheotool", "--density", "1", "--tolerance", "0.1"],
        ["data", "check", str(root), "--clock-factor", "factor"], ["data", "show", str(root)],
        ["data", "import", trios, *out, "--column", "stress=Stress"],
        ["data", "import", trios, *out, "--unit", "stress=kPa"],
        ["data", "import", trios, *out, "--encoding", "utf-8"],
        ["data", "import", trios, *out, "--start-time", "0"],
        ["data", "import", trios, *out, "--geometry", "cone_plate:radius_mm=25,angle_deg=1"],
    )))  # fmt: skip
    i = source.randrange(1, len(right))
    key, equals, _ = right[i].partition("=")
    right[i] = f"{key}={word}" if equals and source.random() < 0.5 else word
    return Case(right)


KINDS: dict[str, Callable[[Path, random.Random], Case]] = {
    kind: partial(harmed, kind) for kind in HARMED
} | {
    one.__name__.replace("_", " "): one
    for one in (nonsense_in_a_folder, nonsense_in_a_study, resumed, workbook, estimator, frame,
                options)
}  # fmt: skip
