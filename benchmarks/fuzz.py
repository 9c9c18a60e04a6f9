# ruff: noqa: E501
"""Inputs written to do harm, at every place where something is read: what comes of each.

    python benchmarks/fuzz.py [--inputs 1000] [--seed 62] [--workers 2] [--processes 20]

Wanted of each input: done, or one message and exit code 2. Counted are tracebacks, hangs, and exit
1. They run in a few processes with limits of time and memory, about `--processes` of them as users
run them. Commands go up to their first computation.
"""

import argparse
import io
import json
import os
import random
import resource
import signal
import struct
import subprocess
import sys
import tempfile
import time
import traceback
import zipfile
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pandas as pd
from hostile_grammar import PLACES, study_case
from hostile_inputs import Hang, Reached, put, up_to_the_first_computation
from hostile_results import LAW, LOOP, RESULT
from typer.testing import CliRunner

import discover as dc
from discover.cli import app

SECONDS = 60  # of the wall clock, on a busy machine
MEMORY = 4_000_000_000  # bytes of address space beside what the process starts with
ODD = [
    None, True, -1, 0, 1e308, 1e-308, float("nan"), 1e400, 10**400, "", "1", "sigma", "../x",
    "/dev/zero", "a" * 3000, "\ud800", "a\0b", [], {}, [[]] * 3, {"a": {}}, "sigma" + ".sigma" * 99,
]  # fmt: skip
SAMPLES = "time_s,shear_rate_1_s,stress_Pa\n" + "".join(f"{k / 10},0.5,{k}\n" for k in range(40))
INDEX = "file,temperature_C\na.csv,20\n"
SWEEP = "omega_rad_s,Gp_Pa,Gpp_Pa\n" + "".join(
    f"{0.1 * 2**k},{(0.01 * 4**k) / (1 + 0.01 * 4**k)},{(0.1 * 2**k) / (1 + 0.01 * 4**k)}\n"
    for k in range(8)
)
OVERLAY = "run,time_s,quantity,value\n" + "".join(f"a.csv,{k / 10},sigma12,{k}\n" for k in range(9))
TESTED = {"learned_in": {"Wi": [0.1, 3.0], "De": [0.1, 1.0]}}
STUDY = (
    '[data]\nfolder = "data"\n[model]\nlaw = "ucm"\nmodulus_Pa = 10.0\nrelaxation_time_s = 1.0\n'
)

Call = list[str] | Callable[[Path], object]
Input = tuple[str, dict, Call]


@dataclass
class Files:
    """What `hostile_inputs.put` writes."""

    files: dict


def places(tree: object, path: tuple = ()) -> list[tuple]:
    """Return the path of every value in nested lists and dictionaries."""
    items = (
        tree.items()
        if isinstance(tree, dict)
        else enumerate(tree)
        if isinstance(tree, list)
        else ()
    )
    return [path, *(p for key, value in items for p in places(value, (*path, key)))]


def harmed(r: random.Random, tree: object, text: Callable = json.dumps) -> bytes:
    """Return JSON with one to three values replaced, dropped or repeated, or its bytes harmed."""
    tree = json.loads(json.dumps(tree))
    for _ in range(r.choice([0, 1, 1, 2, 3])):
        *way, last = r.choice(places(tree)[1:]) or [None]
        at = tree
        try:
            for key in way:
                at = at[key]
            at[last] = r.choice([*ODD, at[last]])
            if isinstance(at, list) and len(at) < 10 and len(json.dumps(tree)) < 10**5:
                at *= r.choice([1, 1, 2, 2000])
            elif r.random() < 0.3:
                del at[last]
        except (KeyError, IndexError, TypeError):
            break
    return bytes_harmed(r, text(tree).encode("utf-8", "surrogatepass"), 0.2)


def bytes_harmed(r: random.Random, raw: bytes, share: float = 0.6) -> bytes:
    """Return bytes cut, repeated, nested, flipped, or as they are."""
    if r.random() > share or not raw:
        return raw
    at, end = sorted(r.randrange(len(raw)) for _ in "12")
    return r.choice([
        raw[:at], raw[:at] + raw[end:], raw[:end] + raw[at:] * 3, raw + b"\0" * 999, b"",
        raw[:at] + bytes([r.randrange(256)]) + raw[at + 1 :], raw.replace(b",", b";"),
        raw.replace(b"\n", b"\r"), raw.replace(b"1", b"1e999", 2), raw.replace(b"1", b"nan", 2),
        b"[" * 10**6, b"{\"a\":" * 10**5, b'"' + raw, raw.decode("utf-8", "replace").encode("utf-16"),
        raw.replace(b"0", b"9" * 5000, 1), raw.replace(b",", b",-", 9), b"\xef\xbb\xbf" + raw,
        b"[{}" + b",{}" * 2 * 10**6 + b"]",
    ])  # fmt: skip


def a_place(r: random.Random, raw: bytes) -> object:
    """Return what lies where a file is expected: the file, or a pipe, link, folder."""
    return r.choice(PLACES) if r.random() < 0.1 else raw


def data(r: random.Random, share: float = 0.0) -> dict:
    """Return the files of a data folder, each harmed with a probability."""
    files = {"data/runs.csv": INDEX, "data/a.csv": SAMPLES, "data/lve.csv": SWEEP}
    kept = {name: bytes_harmed(r, text.encode(), share) for name, text in files.items()}
    return {name: a_place(r, raw) if share else raw for name, raw in kept.items()}


def earlier(r: random.Random) -> Input:
    name, tree = r.choice([("comparison.json", RESULT), ("loop.json", LOOP)])
    tree = json.loads(json.dumps(tree)) | {"declared": {"law": LAW, "effects": []}, "stages": []}
    files = data(r) | {f"old/{name}": a_place(r, harmed(r, tree))}
    if r.random() < 0.4:
        state = {"fingerprint": "0" * 16, "complete": True, "files": {}}
        files["old/state/study.json"] = a_place(r, harmed(r, state))
    study = STUDY.replace(
        'law = "ucm"\nmodulus_Pa = 10.0\nrelaxation_time_s = 1.0\n', 'from = "old"\n'
    )
    files["s.toml"] = study.encode()
    return "from", files, [r.choice(["compare", "close-loop"]), "{}/s.toml", "--out", "{}/out"]


def overlay(r: random.Random) -> Input:
    table = f'[[report.overlay]]\nlabel = "x"\nfile = "{r.choice(["o.csv"] * 6 + ["../o", "/dev/zero", "", "data"])}"\n'
    raw = bytes_harmed(r, OVERLAY.encode(), 0.8)
    files = data(r) | {
        "s.toml": bytes_harmed(r, (STUDY + table).encode(), 0.3),
        "o.csv": a_place(r, raw),
    }
    return "overlay", files, ["compare", "{}/s.toml", "--out", "{}/out"]


def checkpoint(r: random.Random) -> Input:
    state = {
        "fingerprint": "0" * 16,
        "complete": r.choice([True, False, 1, "yes"]),
        "files": {"report.html": "x"},
    }
    part = {"hash": "0" * 16, "content": {"stages": [], "law": LAW}}
    files = data(r) | {
        "s.toml": STUDY.encode(), "out/state/study.json": a_place(r, harmed(r, state)),
        f"out/state/{r.choice(['loop', 'tensor_sindy', 'comparison', 'x'])}.json": a_place(r, harmed(r, part)),
        "out/loop.json": a_place(r, harmed(r, LOOP)),
    }  # fmt: skip
    more = r.choice([[], [], ["--overwrite"]])
    return (
        "checkpoint",
        files,
        [r.choice(["compare", "close-loop"]), "{}/s.toml", "--out", "{}/out", *more],
    )


def raw_toml(r: random.Random) -> Input:
    if r.random() < 0.5:
        case = study_case(r)
        return "toml", case.files, case.arguments
    value = r.choice(
        [
            "1979-05-27",
            "{a=1}",
            "[[1]]",
            "'x'",
            "nan",
            "1e400",
            "9" * 5000,
            "true",
            '"\\ud800"',
            "[" * 3000,
        ]
    )
    key = r.choice(
        ["law", "modulus_Pa", "relaxation_time_s", "modes", "a.b.c", '""', "from", "x" * 9000]
    )
    text = bytes_harmed(r, (STUDY + f"{key} = {value}\n").encode(), 0.3)
    return (
        "toml",
        data(r) | {"s.toml": a_place(r, text)},
        ["compare", "{}/s.toml", "--out", "{}/out"],
    )


def batch(r: random.Random) -> Input:
    names = [
        r.choice(
            [
                "s.toml",
                "s (1).toml",
                "s\n.toml",
                "ünï.toml",
                "-s.toml",
                "a" * 240 + ".toml",
                ".toml",
                "con.toml",
                "s.TOML",
                "out",
                "\udcff.toml",
                "s'.toml",
            ]
        )
        for _ in range(3)
    ]
    files = data(r) | {name: a_place(r, bytes_harmed(r, STUDY.encode(), 0.3)) for name in names}
    given = [f"{{}}/{name}" for name in names] if r.random() < 0.7 else ["{}", "{}/*.toml"]
    return (
        "batch",
        files,
        ["batch", *given, "--out", r.choice(["{}/out", "{}/s.toml", "{}/" + "d" * 300])],
    )


def workbook(r: random.Random) -> Input:
    file = io.BytesIO()
    table = pd.read_csv(io.StringIO(SAMPLES)).astype(object)
    table.columns = ["Time [s]", "Shear rate [1/s]", "Shear stress [Pa]"]
    table.iloc[r.randrange(40), r.randrange(3)] = r.choice(
        [x for x in ODD[:12] if not isinstance(x, int) or abs(x) < 9**9]
    )
    table.to_excel(file, index=False, startrow=r.choice([0, 0, 3, 9000]))
    raw = file.getvalue()
    if r.random() < 0.5:
        parts = unpacked(raw)
        name = r.choice(list(parts))
        parts[name] = r.choice([
            bytes_harmed(r, parts[name], 1.0), parts[name].replace(b'"A1', b'"XFD1048576'),
            parts[name].replace(b'r="', b'r="9'), b"<!DOCTYPE a [<!ENTITY b 'c'>]>" + parts[name],
            parts[name].replace(b"?>", b"?><!--" + b"x" * 10**7 + b"-->", 1),
        ])  # fmt: skip
        raw = packed(parts)
    return (
        "xlsx",
        {"x.xlsx": a_place(r, bytes_harmed(r, raw, 0.2))},
        ["data", "import", "{}/x.xlsx", "--out", "{}/out"],
    )


def export_file(r: random.Random) -> Input:
    mark, unit = r.choice("\t;,"), r.choice(["Pa", "kPa", "", "9**9", "°C"])
    head = r.choice(["", "Sample: x\nTemperature: 1e999\n", "\n" * 500, "[step]\n"])
    rows = SAMPLES.split("\n", 1)[1].replace(",", mark)
    text = (
        head + mark.join(["Time [s]", "Shear rate [1/s]", f"Shear stress [{unit}]"]) + "\n" + rows
    )
    name = r.choice(["x.csv", "x.txt", "x.dat", "x.osc", "x.tts", "x.rdf"])
    more = r.choice(
        [
            [],
            [],
            ["--temperature", r.choice(["20", "nan", "x"])],
            ["--unit", "stress=" + "s*" * 999],
        ]
    )
    return (
        "import",
        {name: a_place(r, bytes_harmed(r, text.encode()))},
        ["data", "import", f"{{}}/{name}", "--out", "{}/out", *more],
    )


def folder(r: random.Random) -> Input:
    command = r.choice(["check", "check", "show"])
    more = ["--out", "{}/out"] if command == "show" and r.random() < 0.5 else []
    return f"data {command}", data(r, 0.5), ["data", command, "{}/data", *more]


def export(r: random.Random) -> Input:
    law = json.loads(json.dumps(LAW)) | {"tested": TESTED}
    law["modes"] *= r.choice([1, 1, 1, 3, 1000])
    law["terms"][0]["coefficient"] = r.choice([0.2, -0.2, -1e300, 1e300, 1e-320])
    law["tested"] = {
        "learned_in": {
            "Wi": [0.1, r.choice([3.0, 1e12, 1e308])],
            "De": [r.choice([0.0, 0.1, 1e-300]), 1.0],
        }
    }
    raw = harmed(r, {"verdict": "effects_added", "law": law})
    form = r.choice(["python", "sympy", "latex", "json", "rheotool", "ufl"])
    return "export", {"out/loop.json": a_place(r, raw)}, ["export", "{}/out", "--format", form]


def unpacked(raw: bytes) -> dict[str, bytes]:
    """Return the members of a zip."""
    with zipfile.ZipFile(io.BytesIO(raw)) as file:
        return {name: file.read(name) for name in file.namelist()}


def packed(parts: dict[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    """Return a zip of these members."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", method) as archive:
        for name, content in parts.items():
            archive.writestr(name, content)
    return file.getvalue()


def array(r: random.Random) -> bytes:
    """Return a member that says it is an array."""
    shape = r.choice([(2,), (10**12,), (-1,), (0, 10**18), (2,) * 40, ()])
    kind = r.choice(["<f8", "|O", "<U9999", "V0", "<f8", "|b1"])
    head = repr({"descr": kind, "fortran_order": r.choice([True, False]), "shape": shape}).encode()
    head = r.choice([head, head, b"(" * 9000, b"-" * 9000]) + b"\n"
    return b"\x93NUMPY\1\0" + struct.pack("<H", len(head)) + head + b"\0" * r.choice([16, 16, 0, 7])


def estimator(r: random.Random) -> Input:
    fluid = {
        "kind": "fluid",
        "fields": {
            "law": {"kind": "named_law", "name": "ucm", "values": {}, "linear_relaxation": True},
            "modulus": {"kind": "array", "name": "array0"},
            "relaxation_time": 1.0,
        },
    }
    network = {
        "kind": "network",
        "width": 10**9,
        "depth": 3,
        "weights": {"kind": "list", "items": []},
        "fields": {},
    }
    header = {
        "format": "discover estimator",
        "version": 1,
        "learner": r.choice(["tensor_sindy", "tbnn_ude", "tensor_dense"]),
        "parameters": {"base": fluid},
        "fitted": {"fluid_": r.choice([fluid, network])},
    }
    parts = {"estimator.json": harmed(r, header), "array0.npy": array(r)}
    if r.random() < 0.15:
        parts[r.choice(["estimator.json", "array0.npy", "x"])] = (
            r.choice([b"\0", b"[", b'{"a":']) * 10**8
        )
    raw = packed(
        parts, r.choice([zipfile.ZIP_DEFLATED] * 3 + [zipfile.ZIP_STORED, zipfile.ZIP_LZMA])
    )
    if r.random() < 0.2:  # encrypted, says the directory; or the sizes that it declares are others
        at = raw.index(b"PK\1\2") + r.choice([8, 20, 24])
        raw = raw[:at] + b"\x01\xff\xff" + raw[at + 3 :]
    return "load", {"e": a_place(r, bytes_harmed(r, raw, 0.3))}, lambda at: dc.load(at / "e")


def frame(r: random.Random) -> Input:
    odd = [*ODD, 1j, b"x", "..", "a/b", pd.NaT, pd.NA, pd.Timestamp(0), object(), (1, 2), np.nan]
    samples = pd.read_csv(io.StringIO(SAMPLES)).assign(run="a.csv").astype(object)
    runs = (
        None
        if r.random() < 0.5
        else pd.DataFrame({"file": ["a.csv"], "flow": ["shear"]}, dtype=object)
    )
    options = {}
    for _ in range(r.choice([1, 1, 2])):
        table, value = samples if runs is None or r.random() < 0.6 else runs, r.choice(odd)
        if not table.size:
            break
        column, row = r.randrange(table.shape[1]), r.randrange(len(table))
        match r.choice(["cell", "cell", "heading", "run", "twice", "levels", "rows", "option"]):
            case "cell":
                table.iat[row, column] = value
            case "heading" if not isinstance(value, list | dict):
                table.columns = pd.Index(
                    [*table.columns[:column], value, *table.columns[column + 1 :]],
                    tupleize_cols=False,
                )
            case "run":
                samples.isetitem(
                    samples.shape[1] - 1, pd.Series([value] * len(samples), dtype=object)
                )
            case "twice":
                samples = pd.concat([samples, samples], axis=r.choice([0, 1]))
            case "levels":
                samples.columns = pd.MultiIndex.from_product(
                    [["a"], list(map(str, samples.columns))]
                )
            case "rows":
                samples = samples.iloc[: r.choice([0, 1, 2])]
            case _:
                options[
                    r.choice(
                        [
                            "name",
                            "clock_factor",
                            "rate_window",
                            "sequence",
                            "rate_before",
                            "x",
                            "tables",
                        ]
                    )
                ] = value
    return "dataframe", {}, lambda _: dc.from_dataframe(samples, runs, **options)


MAKERS = (
    earlier,
    overlay,
    checkpoint,
    raw_toml,
    batch,
    workbook,
    export_file,
    folder,
    export,
    estimator,
    frame,
)


def made(number: int, seed: int) -> Input:
    """Return one input; the same for the same number and seed."""
    return MAKERS[number % len(MAKERS)](random.Random(f"{seed}/{number}"))


def outcome(call: Call, at: Path, real: bool) -> tuple[str, str]:
    """Return how an input ended, and what was said."""
    if isinstance(call, list):
        given = [part.replace("{}", str(at)) for part in call]
        if (
            real
            and call[:2] in (["data", "import"], ["data", "check"])
            and "\0" not in "".join(given)
        ):
            done = subprocess.run(
                [sys.executable, "-m", "discover", *given],
                capture_output=True,
                timeout=4 * SECONDS,
                cwd=at,
            )
            said, code = done.stderr.decode("utf-8", "replace"), done.returncode
            return "traceback" if "Traceback" in said else {0: "done", 2: "refused"}.get(
                code, f"exit {code}"
            ), said
        try:
            done = CliRunner().invoke(app, given)
        except Reached:
            return "done", "the computation"
        if done.exception is not None and not isinstance(done.exception, SystemExit):
            return "traceback", "".join(traceback.format_exception(done.exception)[-4:])
        said = done.stderr
        return "traceback" if "Traceback" in said else {0: "done", 2: "refused"}.get(
            done.exit_code, f"exit {done.exit_code}"
        ), said
    try:
        call(at)
    except dc.InputError as error:
        return "refused", str(error)
    except Exception:
        return "traceback", traceback.format_exc()[-900:]
    return "done", ""


def run(number: int, seed: int, real: bool) -> tuple[str, str, str]:
    """Return kind, ending and words of an input, in a folder of its own and with a limit of time."""
    kind, files, call = made(number, seed)

    def alarm(*_: object) -> None:
        raise Hang

    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as scratch:
        os.chdir(scratch)
        put(Path(scratch), Files(files))
        signal.signal(signal.SIGALRM, alarm)
        signal.setitimer(signal.ITIMER_REAL, SECONDS)
        try:
            ended, said = outcome(call, Path(scratch), real)
        except Hang:
            ended, said = "hang", ""
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        os.chdir("/")
    shown = call if isinstance(call, list) else ""
    return kind, ended, f"{shown!r} {sorted(files)!r}\n{said[-900:]}"


def _run(task: tuple[int, int, bool]) -> tuple[str, str, str]:
    return run(*task)


def ready() -> None:
    """Import what commands import, and stop them where they would compute."""
    import jax

    jax.devices()  # what JAX maps once is no input's
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, resource.RLIM_INFINITY))
    STOPPED.enter_context(up_to_the_first_computation())


STOPPED = ExitStack()


def main() -> None:
    """Run the inputs of the command line's arguments, and print the table."""
    asked = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for option, default in (("inputs", 1000), ("seed", 62), ("workers", 2), ("processes", 20)):
        asked.add_argument(f"--{option}", type=int, default=default)
    asked.add_argument("--one", type=int, help="number of one input, whose ending is shown whole")
    given = asked.parse_args()
    os.environ.pop("DISCOVER_DATA", None)
    started = time.monotonic()
    if given.one is not None:
        ready()
        print(*run(given.one, given.seed, False), sep="\n")
        return
    every = max(1, given.inputs // max(1, 3 * given.processes))
    tasks = [(n, given.seed, given.processes > 0 and n % every == 0) for n in range(given.inputs)]
    with get_context("spawn").Pool(given.workers, ready) as pool:
        rows = []
        for row in pool.imap(_run, tasks, 2):
            rows.append(row)
            if row[1] not in ("done", "refused"):
                print(len(rows) - 1, *row, flush=True)
    counts = Counter((kind, ended) for kind, ended, _ in rows)
    columns = list(
        dict.fromkeys(["traceback", "hang", "exit 1", "refused", "done", *(e for _, e in counts)])
    )
    print(f"\n{given.inputs} inputs, seed {given.seed}, {time.monotonic() - started:.0f} s")
    print(f"{'kind':<12}" + "".join(f"{column:>11}" for column in columns))
    for kind in [*sorted({kind for kind, _ in counts}), "all"]:
        of = [
            sum(n for (k, e), n in counts.items() if e == c and kind in (k, "all")) for c in columns
        ]
        print(f"{kind:<12}" + "".join(f"{n:>11}" for n in of))


if __name__ == "__main__":
    main()
