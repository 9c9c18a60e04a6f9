"""Malformed inputs by kind: each writes a sane one into an empty folder, and harms it."""

import io
import json
import random
import struct
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import harm
from harm import SANE, to_toml, write_files

FOLDER, STUDY, COMPARISON, RESULTS, EXPORTS = (
    SANE[name] for name in ("FOLDER", "STUDY", "COMPARISON", "RESULTS", "EXPORTS")
)


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


def _keys(content: object) -> list[str]:
    return [str(key) for _, key in harm.holders(content)]


def _study(root: Path, content: dict, source: random.Random, name: str = "study.toml") -> None:
    if source.random() < 0.5:
        text = to_toml(harm.mutate_values(content, source)).encode("utf-8", "surrogatepass")
    else:
        text = harm.mutate_text(to_toml(content), source)
    (root / name).write_bytes(text)


def data_folder(root: Path, source: random.Random) -> Case:
    write_files(root, FOLDER)
    harm.spoil(root, source.choice(list(FOLDER)), source)
    command = source.choice(("check", "check", "show"))
    more = ["--clock-factor", "factor"] if command == "check" else source.choice(([], ["--json"]))
    return Case(["data", command, str(root), *more], tuple(FOLDER))


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
    return Case(call, ("study.toml", *_keys(STUDY)), f"{section}.{key} = {tree[section][key]!r}")


def loop_study(root: Path, source: random.Random) -> Case:
    write_files(root, FOLDER)
    _study(root, STUDY, source)
    if source.random() < 0.3:
        write_files(root, {"study.toml": to_toml(STUDY)})
        harm.spoil(root, source.choice(["study.toml", *FOLDER]), source)
    out = str(root / "out")
    names = (*FOLDER, "study.toml", out, *_keys(STUDY))
    return Case(["close-loop", str(root / "study.toml"), "--out", out], names)


def compare_study(root: Path, source: random.Random) -> Case:
    _study(root, COMPARISON, source)
    out = str(root / "out")
    names = ("study.toml", out, *_keys(COMPARISON))
    return Case(["compare", str(root / "study.toml"), "--out", out], names)


def told_by_a_result(root: Path, source: random.Random) -> Case:
    write_files(root, FOLDER)
    (root / "old").mkdir()
    name = source.choice(list(RESULTS))
    told = {"law": RESULTS["loop.json"]["law"], "effects": []}
    tree = RESULTS[name] | {"declared": told, "stages": []}
    write_files(root / "old", {name: json.dumps(harm.mutate_values(tree, source))})
    study = STUDY | {"model": {"from": "old"}}
    write_files(root, {"study.toml": to_toml(study)})
    call = [source.choice(("compare", "close-loop")), str(root / "study.toml")]
    return Case([*call, "--out", str(root / "out")], (name, "old", *FOLDER, *_keys(study)))


def overlaid(root: Path, source: random.Random) -> Case:
    write_files(root, {**FOLDER, "o.csv": SANE["OVERLAY"]})
    harm.spoil(root, "o.csv", source)
    table = '[[report.overlay]]\nlabel = "x"\nfile = "o.csv"\n'
    write_files(root, {"study.toml": to_toml(STUDY) + table})
    call = ["close-loop", str(root / "study.toml"), "--out", str(root / "out")]
    return Case(call, ("o.csv", "overlay"))


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


def exported(root: Path, source: random.Random) -> Case:
    name = source.choice(list(RESULTS))
    write_files(root, {name: json.dumps(harm.mutate_values(RESULTS[name], source))})
    if source.random() < 0.4:
        write_files(root, {name: json.dumps(RESULTS[name])})
        harm.spoil(root, name, source)
    form = source.choice(("python", "sympy", "latex", "json", "rheotool", "ufl"))
    out = source.choice(([], ["--out", str(root / "law.txt")]))
    return Case(["export", str(root), "--format", form, *out], (name, str(root), "rheoTool"))


def batch(root: Path, source: random.Random) -> Case:
    write_files(root, FOLDER)
    names = [f"s{i}.toml" for i in range(source.randint(1, 3))]
    for name in names:
        _study(root, source.choice((STUDY, COMPARISON)), source, name)
    call = ["batch", *(str(root / name) for name in names), "--out", str(root / "out")]
    return Case(call, (*names, *(name.removesuffix(".toml") for name in names)))


def imported(root: Path, source: random.Random) -> Case:
    name = source.choice(list(EXPORTS))
    write_files(root, {**EXPORTS, "sweep.txt": SANE["SWEEP"]})
    with_sweep = source.random() < 0.3
    harm.spoil(root, "sweep.txt" if with_sweep else name, source)
    call = ["data", "import", str(root / name), "--out", str(root / "data")]
    call += ["--lve", str(root / "sweep.txt")] if with_sweep else []
    return Case(call, (Path(name).stem, "runs.csv", "sweep.txt", "lve.csv", "--"))


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
    return _packed(parts)


def _packed(parts: dict[str, bytes]) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in parts.items():
            archive.writestr(name, content)
    return file.getvalue()


def estimator(root: Path, source: random.Random) -> Case:
    """Harm what a saved estimator says of itself and of its arrays."""
    import discover as dc

    shape = source.choice(((2,), (10**12,), (-1,), (0, 10**18), (2,) * 40, ()))
    kind = source.choice(("<f8", "|O", "<U9999", "V0", "|b1"))
    head = repr({"descr": kind, "fortran_order": False, "shape": shape}).encode() + b"\n"
    array = b"\x93NUMPY\1\0" + struct.pack("<H", len(head)) + head + b"\0" * 16
    header = json.dumps(harm.mutate_values(SANE["ESTIMATOR"], source)).encode(
        "utf-8", "surrogatepass"
    )
    raw = _packed({"estimator.json": header, "array0.npy": array})
    if source.random() < 0.2:  # encrypted, says the directory; or the sizes declared are others
        at = raw.index(b"PK\1\2") + source.choice((8, 20, 24))
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


def mapped(root: Path, source: random.Random) -> Case:
    write_files(root, EXPORTS)
    _study(root, SANE["MAPPING"], source, "map.toml")
    call = ["data", "import", "--mapping", str(root / "map.toml"), "--out", str(root / "data")]
    return Case(call, ("map.toml", "trios", "runs.csv", "--", "[[source]]"))


def package(root: Path, source: random.Random) -> Case:
    """Give a package that is not the known one."""
    names = ("reptate/data/PI_LINEAR/PI_94.9k_T-35.tts", "LICENSE", "../../up")
    raw = bytearray(_packed({name: source.randbytes(50) for name in names}))
    for _ in range(source.randint(0, 8)):
        raw[source.randrange(len(raw))] = source.randrange(256)
    (root / "package.whl").write_bytes(bytes(raw))
    call = ["data", "fetch", "polyisoprene", "--accept-licence", "--from"]
    call += [str(root / "package.whl"), "--out", str(root / "data")]
    return Case(call, ("package", ".tts", "LICENSE"))


def options(root: Path, source: random.Random) -> Case:
    """Give wrong words on the command line."""
    write_files(root, {**FOLDER, **EXPORTS, "study.toml": to_toml(STUDY)})
    write_files(root, {"loop.json": json.dumps(RESULTS["loop.json"])})
    out, study, trios = (
        ["--out", str(root / "out")],
        str(root / "study.toml"),
        str(root / "trios.txt"),
    )
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
        ["data", "fetch", "polyisoprene"],
    )))  # fmt: skip
    i = source.randrange(1, len(right))
    key, equals, _ = right[i].partition("=")
    right[i] = f"{key}={word}" if equals and source.random() < 0.5 else word
    return Case(right)


KINDS: dict[str, Callable[[Path, random.Random], Case]] = {
    one.__name__.replace("_", " "): one
    for one in (
        data_folder, nonsense_in_a_folder, nonsense_in_a_study, loop_study, compare_study,
        told_by_a_result, overlaid, resumed, exported, batch, imported, workbook, estimator, frame,
        mapped, package, options,
    )
}  # fmt: skip
