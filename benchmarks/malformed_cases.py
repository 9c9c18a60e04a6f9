"""Malformed inputs of every sort that the command line reads, made by seeded mutation."""

import json
import random
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from mutations import TOKENS, mutate_text, mutate_values, spoil_file, to_toml

RUN = "time_s,shear_rate_1_s,stress_Pa,N1_Pa\n" + "".join(
    f"{0.1 * i:.1f},0.5,{2 * (1 - 0.9**i):.6f},{0.1 * i:.2f}\n" for i in range(14)
)
STRAIN_RUN = "time_ms,strain,stress_kPa\n" + "".join(
    f"{i},{0.1 * i:.6f},{1 - 0.9**i:.6f}\n" for i in range(24)
)
FOLDER = {
    "runs.csv": "file,factor,label\na.csv,2.0,first\nb.csv,4.0,second\n",
    "a.csv": RUN,
    "b.csv": STRAIN_RUN,
    "lve.csv": "omega_rad_s,Gp_Pa,Gpp_Pa\n10,50,5\n1,25,25\n0.1,1,5\n",
}
STUDY = {
    "data": {
        "folder": ".",
        "fit": ["a.csv"],
        "held_out": ["b.csv"],
        "clock_factor": "factor",
        "rate": "commanded",
        "rate_before": "factor",
        "sequence": "factor",
    },
    "model": {
        "law": "giesekus",
        "modulus_Pa": "fit",
        "relaxation_time_s": 1.0,
        "parameters": {"alpha": 0.3},
        "known_relaxation": True,
    },
    "loop": {
        "max_effects": 3,
        "strain": [0.02, 25.0],
        "noise": 0.01,
        "effects": ["giesekus_mobility", "stress_offset"],
    },
}
COMPARISON = {
    "data": {
        "synthetic": {
            "law": "giesekus",
            "parameters": {"alpha": 0.2},
            "protocol": "paper",
            "noise": 0.01,
            "seed": 0,
            "samples": 11,
        },
        "held_out": ["laos_1_1"],
    },
    "model": {"law": "ucm", "modulus_Pa": 1.0, "relaxation_time_s": 1.0},
    "compare": {
        "learners": ["tensor_sindy", "tbnn_ude"],
        "library": {"degree": 1, "closed_forms": ["exp"]},
        "test": "paper",
        "seed": 0,
        "max_terms": 3,
        "high_deborah": [1.5],
        "distillation": False,
        "sweep": {"laws": ["ptt_linear"], "parameter": "epsilon", "values": [0.1]},
        "next": {"flows": ["laos"], "observe": ["N1"], "noise": 0.01},
    },
}
LAW = {
    "format": "discover law 1",
    "title": "found",
    "notes": ["a note"],
    "terms": [
        {"term": "sigma.sigma", "coefficient": 0.2, "inner": {}, "ci95": [0.1, 0.3]},
        {
            "term": "(exp(epsilon*tr(sigma))-1)*sigma",
            "coefficient": 0.1,
            "inner": {"epsilon": 0.4},
            "ci95": None,
        },
        {"term": "tr(sigma.gammadot)*I", "coefficient": 0.1, "inner": {}, "ci95": None},
    ],
    "linear_relaxation": True,
    "modes": [{"modulus_Pa": 10.0, "relaxation_time_s": 0.5}],
    "solvent_viscosity_Pa_s": 0.1,
    "tested": {
        "learned_in": {"Wi": [1.0, 2.0], "De": [0.25, 1.0]},
        "judged_in": {"Wi": [2.0, 3.0], "De": [0.1, 1.5]},
        "worst_errors": {"sigma12": 0.01},
    },
}
TERM = {"term": "sigma.sigma", "coefficient": 0.2, "ci95": [0.1, 0.3], "inner": {}}
RESULTS = {
    "comparison.json": {
        "learners": {
            "tensor_sindy": {
                "terms": [TERM],
                "errors": {"laos_1_1": {"sigma12": 0.01, "N1": 0.02, "N2": None}},
                "train_seconds": 1.0,
                "details": {"selectors": {"chosen": {"bic": ["sigma.sigma"]}}},
                "law": LAW,
            }
        },
        "rivals": [],
        "undetermined": ["N2"],
    },
    "loop.json": {
        "verdict": "effects_added",
        "error_before": {"fit": 0.4, "held_out": None},
        "error_after": {"fit": 0.01, "held_out": 0.02},
        "stages": [{"effect": "giesekus_mobility", "kind": "constitutive"}],
        "law": LAW,
    },
}
EXPORTS = {
    "trios.txt": "Filename\tmelt\n\n[step]\nPeak hold - 1\nStep time\tShear rate\tStress\tStatus\n"
    "s\t1/s\tkPa\t\n" + "".join(f"{0.1 * i:.1f}\t0.5\t{0.1 * i:.2f}\tok\n" for i in range(14)),
    "rheocompass.csv": "Project:\tmelt\nInterval and data points:\t1\t14\nInterval data:\tPoint No."
    "\tTime\tShear Rate\tShear Stress\tTorque\n\n\t\t[s]\t[1/s]\t[Pa]\t[mN·m]\n"
    + "".join(f"\t{i + 1}\t{0.1 * i:.1f}\t0.5\t{0.1 * i:.2f}\t{i}\n" for i in range(14)),
    "plain.csv": "time [s];shear rate [1/s];stress [Pa]\n"
    + "".join(f"{i},5;0,5;{i},25\n" for i in range(14)),
}
SWEEP = "Angular frequency\tStorage modulus\tLoss modulus\nrad/s\tPa\tkPa\n" + "".join(
    f"{10.0**i}\t{100.0 ** (i + 1)}\t{10.0**i}\n" for i in range(4)
)
MAPPING = {
    "start_time_s": 0.0,
    "blocks": [1],
    "columns": {"time": "Step time", "stress": "Stress"},
    "units": {"stress": "kPa"},
    "layout": {"delimiter": "tab", "decimal": "."},
    "geometry": {"type": "cone_plate", "radius_mm": 25.0, "angle_deg": 1.0},
    "source": [{"file": "trios.txt", "sweep": False}],
}


@dataclass(frozen=True)
class Case:
    """One command on one malformed input.

    Attributes
    ----------
    arguments
        After ``discover``.
    names
        Words of which the message must hold one: files, folders, keys, options.
    """

    arguments: list[str]
    names: tuple[str, ...]


def write_files(root: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        (root / name).write_text(text, encoding="utf-8")


def _spoil(root: Path, name: str, source: random.Random) -> None:
    path = root / name
    if source.random() < 0.15:
        spoil_file(path, source)
    else:
        path.write_bytes(mutate_text(path.read_text("utf-8"), source))


def _keys(content: object) -> Iterator[str]:
    if isinstance(content, dict):
        for key, value in content.items():
            yield key
            yield from _keys(value)
    elif isinstance(content, list):
        for value in content:
            yield from _keys(value)


def data_folder(root: Path, source: random.Random) -> Case:
    """Spoil a file of a data folder, and look at the folder."""
    write_files(root, FOLDER)
    _spoil(root, source.choice(list(FOLDER)), source)
    command = source.choice(("check", "check", "show"))
    factor = ["--clock-factor", "factor"] if command == "check" else []
    json_ = source.choice(([], [], ["--json"])) if command == "show" else []
    return Case(["data", command, str(root), *factor, *json_], tuple(FOLDER))


def _study(root: Path, content: dict, source: random.Random, name: str) -> None:
    if source.random() < 0.5:
        text = to_toml(mutate_values(content, source)).encode("utf-8", "surrogatepass")
    else:
        text = mutate_text(to_toml(content), source)
    (root / name).write_bytes(text)


def loop_study(root: Path, source: random.Random) -> Case:
    """Mutate a study of measured runs, or a run of it, and close the loop."""
    write_files(root, FOLDER)
    _study(root, STUDY, source, "study.toml")
    if source.random() < 0.3:
        write_files(root, {"study.toml": to_toml(STUDY)})
        _spoil(root, source.choice(["study.toml", *FOLDER]), source)
    out = str(root / "out")
    return Case(
        ["close-loop", str(root / "study.toml"), "--out", out],
        (*FOLDER, "study.toml", out, *_keys(STUDY)),
    )


def compare_study(root: Path, source: random.Random) -> Case:
    """Mutate a study of synthetic runs, and compare."""
    _study(root, COMPARISON, source, "study.toml")
    out = str(root / "out")
    return Case(
        ["compare", str(root / "study.toml"), "--out", out], ("study.toml", out, *_keys(COMPARISON))
    )


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
        path = root / "out" / name
        _spoil(path.parent, path.name, source)
    study, out = str(root / "study.toml"), str(root / "out")
    options = source.choice(([], ["--json"], ["--quiet"]))
    if source.random() < 0.5:
        (root / "batch").mkdir()
        (root / "out").rename(root / "batch" / "study")
        return Case(["batch", study, "--out", str(root / "batch"), *options], (out, "study"))
    return Case(["close-loop", study, "--out", out, *options], (out, *files))


def exported(root: Path, source: random.Random) -> Case:
    """Mutate a result file, and export its law."""
    name = source.choice(list(RESULTS))
    text = json.dumps(RESULTS[name])
    if source.random() < 0.6:
        (root / name).write_text(json.dumps(mutate_values(RESULTS[name], source)), "utf-8")
    else:
        write_files(root, {name: text})
        _spoil(root, name, source)
    form = source.choice(("python", "sympy", "latex", "json", "rheotool"))
    out = source.choice(([], ["--out", str(root / "law.txt")]))
    return Case(["export", str(root), "--format", form, *out], (name, str(root), "rheoTool"))


def batch(root: Path, source: random.Random) -> Case:
    """Mutate all studies of a batch."""
    write_files(root, FOLDER)
    names = [f"s{i}.toml" for i in range(source.randint(1, 3))]
    for name in names:
        _study(root, source.choice((STUDY, COMPARISON)), source, name)
    out = ["--out", str(root / "out")]
    stems = [name.removesuffix(".toml") for name in names]
    return Case(["batch", *(str(root / name) for name in names), *out], (*names, *stems))


def imported(root: Path, source: random.Random) -> Case:
    """Mutate a rheometer's export, and import it."""
    name = source.choice(list(EXPORTS))
    write_files(root, {**EXPORTS, "sweep.txt": SWEEP})
    with_sweep = source.random() < 0.3
    _spoil(root, "sweep.txt" if with_sweep else name, source)
    options = ["--lve", str(root / "sweep.txt")] if with_sweep else []
    return Case(
        ["data", "import", str(root / name), "--out", str(root / "data"), *options],
        (Path(name).stem, "runs.csv", "sweep.txt", "lve.csv", "--"),
    )


def mapped(root: Path, source: random.Random) -> Case:
    """Mutate a mapping file, and import by it."""
    write_files(root, EXPORTS)
    _study(root, MAPPING, source, "map.toml")
    return Case(
        ["data", "import", "--mapping", str(root / "map.toml"), "--out", str(root / "data")],
        ("map.toml", "trios", "runs.csv", "--", "[[source]]"),
    )


def fetched(root: Path, source: random.Random) -> Case:
    """Give a package that is not the known one."""
    path = root / "package.whl"
    with zipfile.ZipFile(path, "w") as archive:
        for name in ("reptate/data/PI_LINEAR/PI_94.9k_T-35.tts", "LICENSE", "../../up"):
            archive.writestr(name, source.randbytes(50))
    if source.random() < 0.7:
        raw = bytearray(path.read_bytes())
        for _ in range(source.randint(1, 8)):
            raw[source.randrange(len(raw))] = source.randrange(256)
        path.write_bytes(bytes(raw))
    elif source.random() < 0.5:
        spoil_file(path, source)
    arguments = ["data", "fetch", "polyisoprene", "--accept-licence", "--from", str(path)]
    return Case([*arguments, "--out", str(root / "data")], ("package", ".tts", "LICENSE"))


def optioned(root: Path, source: random.Random) -> Case:
    """Give wrong words on the command line."""
    write_files(root, {**FOLDER, **EXPORTS, "study.toml": to_toml(STUDY)})
    write_files(root, {"loop.json": json.dumps(RESULTS["loop.json"])})
    out = ["--out", str(root / "out")]
    tool = "cone_plate:radius_mm=25,angle_deg=1"
    word = source.choice([t for t in TOKENS if "\0" not in t])
    right = source.choice(
        (
            ["close-loop", str(root / "study.toml"), *out, "--seed", "1"],
            ["batch", str(root / "study.toml"), *out, "--workers", "1"],
            ["export", str(root), "--format", "python", "--law", "augmented"],
            ["export", str(root), "--format", "rheotool", "--density", "1", "--tolerance", "0.1"],
            ["data", "check", str(root), "--clock-factor", "factor"],
            ["data", "show", str(root)],
            ["data", "import", str(root / "trios.txt"), *out, "--column", "stress=Stress"],
            ["data", "import", str(root / "trios.txt"), *out, "--unit", "stress=kPa"],
            ["data", "import", str(root / "trios.txt"), *out, "--encoding", "utf-8"],
            ["data", "import", str(root / "trios.txt"), *out, "--start-time", "0"],
            ["data", "import", str(root / "trios.txt"), *out, "--geometry", tool],
            ["data", "fetch", "polyisoprene"],
            ["distil", "--teacher", "giesekus:alpha=0.2", "--student", "nobody"],
        )
    )  # fmt: skip
    i = source.randrange(1, len(right))
    key, equals, _ = right[i].partition("=")
    right[i] = f"{key}={word}" if equals and source.random() < 0.5 else word
    return Case(right, ("",))


KINDS: dict[str, Callable[[Path, random.Random], Case]] = {
    "data folder": data_folder,
    "study, closed loop": loop_study,
    "study, comparison": compare_study,
    "results, resumed": resumed,
    "results, exported": exported,
    "batch": batch,
    "export of a rheometer": imported,
    "mapping": mapped,
    "package": fetched,
    "options": optioned,
}
"""Sorts of malformed input by name; each makes a case in an empty folder."""
