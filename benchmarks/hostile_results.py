"""Hostile results, exports of instruments and options, as `hostile_grammar` makes the rest."""

import copy
import json
import random

from hostile_grammar import ENCODINGS, PLACES, WORDS_FOR_NUMBERS, Case, Content, data_files, words

LAW = {
    "format": "discover law 1",
    "title": "a law",
    "terms": [{"term": "sigma.sigma", "coefficient": 0.2, "inner": {}, "ci95": [0.1, 0.3]}],
    "linear_relaxation": True,
    "modes": [{"modulus_Pa": 10.0, "relaxation_time_s": 1.0}],
    "solvent_viscosity_Pa_s": 0.0,
}
RESULT = {"learners": {"tensor_sindy": {"law": LAW}}, "rivals": [], "undetermined": []}
LOOP = {"verdict": "effects_added", "law": LAW}
STUDY = '[data]\nfolder = "data"\n[compare]\nquick = true\n'


def _places(tree: object, path: tuple = ()) -> list[tuple]:
    pairs = (
        tree.items()
        if isinstance(tree, dict)
        else enumerate(tree)
        if isinstance(tree, list)
        else ()
    )
    return [path, *(p for key, value in pairs for p in _places(value, (*path, key)))]


def _swap(r: random.Random, tree: dict) -> tuple[object, str]:
    tree = copy.deepcopy(tree)
    path = r.choice([p for p in _places(tree) if "law" in p and len(p) > 1])
    place = tree
    for key in path[:-1]:
        place = place[key]
    old = place[path[-1]]
    new = r.choice([True, "0.2", None, [], {}, -1.0, float("nan"), 1e400, 10**400, "sigma",
        "\ud800",
                    "__import__('os')", "sigma" + ".sigma" * 3000, [[]] * 3,
                    "(" * 5000])  # fmt: skip
    place[path[-1]] = new
    name = ".".join(map(str, path))
    free = path[-1] in ("title", "law", "inner", "ci95", "terms") or type(new) is type(old)
    harmless = free and not (isinstance(new, float) and not -1 <= new <= 1e300)
    return tree, "" if harmless else f"{name} = {new!r:.20}"


def export_case(r: random.Random) -> Case:
    case = Case("export")
    name, tree = r.choice([("comparison.json", RESULT), ("loop.json", LOOP)])
    raw: Content = json.dumps(tree).encode()
    if r.random() < 0.75:
        swapped, what = _swap(r, tree)
        raw = json.dumps(swapped).encode()
        case.nonsense.append(what)
    if r.random() < 0.3:
        raw, what = r.choice([
            (raw[: len(raw) // 2], "half a result"), (b"", "an empty result"),
            (b"[" * 50_000, "nested lists"), (b'{"content": {}}', "no result"), (b"null", "null"),
            (raw.replace(b"0.2", b"1e999"), "an infinite coefficient"), (raw + b"x",
            "more after it"),
            (raw.decode().encode("utf-16"), ""), (r.choice(PLACES), "something else in its place"),
        ])  # fmt: skip
        case.nonsense.append(what)
    case.files["out/" + name] = raw
    form = r.choice(["python", "sympy", "latex", "json", "rheotool"] * 3 + ["docx", ""])
    case.nonsense += [] if form and form != "docx" else ["a format that is none"]
    case.arguments = ["export", "{}/out", "--format", form]
    if form == "rheotool":
        option = r.choice(["--density", "--density", "--tolerance"])
        value = r.choice(["1000", "0.01", "nan", "-1", "inf", "0", "x", "1_000"])
        case.arguments += [option, value]
        fine = value in (("1000", "0.01", "1_000") if option == "--density" else ("0.01", "0"))
        case.nonsense += [] if fine else [f"{option} {value}"]
    if r.random() < 0.3:
        case.arguments += [
            "--out",
            r.choice(["{}/out", "{}/x.py", "{}/a/b/c.py", "{}/\udcff", "/dev/null"]),
        ]
    if r.random() < 0.2:
        case.arguments += ["--law", words(r)]
        case.nonsense.append("a law that is none")
    return case


def planted_case(r: random.Random) -> Case:
    """Return a command on a result folder in which somebody was before."""
    case = Case("planted", files=data_files(r) | {"study.toml": STUDY.encode()})
    state = {"fingerprint": "0" * 16, "complete": r.choice([True, "yes", 1])}
    whole = {"out/report.html": b"<p>", "out/comparison.json": json.dumps(RESULT).encode()}
    case.files |= r.choice([
        {"out/state/study.json": json.dumps(state).encode(), **whole},
        {"out/state/study.json": b'{"fingerprint": {}, "complete": []}', **whole},
        {"out/state/study.json": b"[" * 9000}, {"out/state/study.json": b"null"},
        {"out/state": ("link", "/tmp")}, {"out/state": b"a file"}, {"out/state": ("pipe", "")},
        {"out/figures": ("link", "/tmp")}, {"out/figures": b"a file"}, {"out": b"a file"},
        {"out": ("pipe", "")}, {"out": ("link", "out")}, {"out/.discover-lock": ("pipe", "")},
        {"out/.discover-lock": ("link", "/dev/zero")}, {"out/.discover-lock": ("folder", "")},
        {"out/.discover-lock": b'{"pid": 1e999, "host": []}'},
        {"out/.discover-lock": b'{"pid": 1, "host": "\xff"}'}, {"out/report.html": ("folder", "")},
        {"out/state/study.json": ("pipe", "")}, {"out/state/study.json": ("link", "/dev/zero")},
    ])  # fmt: skip
    command = r.choice(["compare", "close-loop"])
    case.arguments = [command, "{}/study.toml", "--out", "{}/out"]
    case.arguments += r.choice([[], [], ["--overwrite"], ["--quiet"]])
    return case


def _export_text(r: random.Random) -> tuple[str, str]:
    mark = r.choice([",", "\t", ";"])
    unit = r.choice(
        ["Pa", "kPa", "Pa", "dyn/cm²", "10Pa", "9**9**9", "Pa Pa", "", "s", "°C", "(" * 9]
    )
    head = ["Time [s]", "Shear rate [1/s]", f"Shear stress [{unit}]"]
    rows = [[f"{0.1 * i:.3f}", "1.0", f"{2.5 * i:.4f}"] for i in range(1, 30)]
    what = "" if unit in ("Pa", "kPa", "dyn/cm²") else f"unit {unit}"
    if r.random() < 0.3:
        rows[r.randrange(29)][r.randrange(3)] = r.choice(WORDS_FOR_NUMBERS)
    return "\n".join(mark.join(row) for row in [head, *rows]) + "\n", what


def import_case(r: random.Random) -> Case:
    case = Case("import")
    text, what_unit = _export_text(r)
    case.nonsense.append(what_unit)
    raw: Content = text.encode("utf-8")
    if r.random() < 0.35:
        raw, what = r.choice([
            (text.encode(r.choice(ENCODINGS), "replace"), None), (b"", "an empty file"), (raw[:90],
            None),
            (raw.replace(b"\n", b"\r"), None), (b"\0" * 5000, "zero bytes"), (b'"' + raw, None),
            (raw * 40, None), (b"7" * 500_000, "a huge field"), (r.choice(PLACES), "no file"),
            (raw.replace(b"1.0", b"1.0" + b"0" * 150_000, 1), None), (b"[step]\n" * 50_000,
            "no numbers"),
        ])  # fmt: skip
        case.nonsense.append(what or "")
    case.files["x.txt"] = raw
    case.arguments = [
        "data",
        "import",
        "{}/x.txt",
        "--out",
        r.choice(["{}/out"] * 9 + ["{}/x.txt"]),
    ]
    for _ in range(r.choice([0, 0, 1, 1, 2])):
        option, values = r.choice([
            ("--unit", ["stress=Pa", "stress=9**9**9**9", "stress=10Pa", "stress", "=",
            "stress=" + "s*" * 9000,
                        "x=Pa", "stress=__import__('os')", "stress=Pa" + "\ud800", "time=furlong"]),
            ("--column", ["stress=Shear stress", "stress=nobody", "=", "stress==",
            "time=" + "t" * 9000]),
            ("--encoding", ["utf-8", "base64", "idna", "undefined", "punycode", "rot13", "\udcff",
            "a\x01",
                            "", "utf-7", "unicode_escape", "x" * 9000, "../../x", "zip", "utf-32"]),
            ("--geometry", ["cone_plate:radius_mm=25,angle_deg=1",
            "cone_plate:radius_mm=1e-310,angle_deg=1",
                            "cone_plate:radius_mm=25,angle_deg=1e-320",
                            "cone_plate:radius_mm=nan,angle_deg=1",
                            "cup", "", ":", "cone_plate:radius_mm=true,angle_deg=1",
                            "plate_plate:radius_mm=25,gap_mm=0",
                            "plate_plate:radius_mm=1e308,gap_mm=1",
                            "plate_plate:radius_mm=２５,gap_mm=1"]),
            ("--block", ["1", "0", "-1", "99999999999999999999999", "x", "1.5"]),
            ("--header-row", ["1", "0", "99999999999999999999999", "40", "x"]),
            ("--delimiter", ["comma", "tab", "semicolon", "x", "", "\t"]),
            ("--decimal", [".", ",", "x", "", ".,"]),
            ("--start-time", ["0", "nan", "inf", "-1e308", "1e308", "x", "0.05"]),
            ("--lve", ["{}/x.txt", "{}/none", "/dev/zero", "{}"]),
            ("--mapping", ["{}/x.txt", "{}/none", "/dev/zero", "{}/map.toml"]),
        ])  # fmt: skip
        case.arguments += [option, r.choice(values)]
    if "stress=Pa" in case.arguments:  # the unit of the file does not count then
        case.nonsense.remove(what_unit)
    if "{}/map.toml" in case.arguments:
        case.files["map.toml"] = r.choice([
            b'[units]\nstress = "kPa"\n', b"[units]\nstress = true\n", b"blocks = [true]\n",
            b"blocks = []\n",
            b'[[source]]\nfile = "/dev/zero"\n',
            b'[geometry]\ntype = "cone_plate"\nradius_mm = "25"\n',
            b"start_time_s = true\n", b"[columns]\n" + b"x." * 9000 + b"y = 1\n", b"layout = 3\n",
            b'[layout]\nencoding = "idna"\n', b"[layout]\nheader_row = true\n",
        ])  # fmt: skip
    return case


def options_case(r: random.Random) -> Case:
    case = Case("options", files=data_files(r) | {"study.toml": STUDY.encode()})
    huge = str(10**30)
    command, option, values = r.choice([
        ("batch", "--workers", ["0", "-1", huge, "1.5", "x", "true", "", "nan", "１"]),
        ("batch", "--scheduler", ["", "::::", "tcp://", "http://x y", "127.0.0.1:1",
        "tcp://127.0.0.1:99999999",
                                  "inproc://x", "\udcff", "unknown://x", "tcp://[::1", "ucx://h",
                                  "a" * 5000]),
        ("compare", "--seed", ["-1", huge, "1.5", "x", "true", str(2**32), "nan"]),
        ("close-loop", "--seed", ["-1", huge, "x"]),
        ("compare", "--out", ["", "/dev/null", "/proc/x", "{}/study.toml", "\udcff/x", "x\x01",
        "{}/" + "d" * 300]),
        ("compare", "--nobody", ["1"]),
    ])  # fmt: skip
    value = r.choice(values)
    case.arguments = [command, "{}/study.toml", option, value]
    if option != "--out":
        case.arguments += ["--out", "{}/out"]
    if command == "batch" and r.random() < 0.3:
        case.arguments.insert(1, "{}/study.toml")
        case.nonsense.append("a study twice")
    if option in ("--workers", "--seed", "--nobody"):
        fine = option == "--workers" and value == "１"
        case.nonsense.append("" if fine else f"{option} {value:.20}")
    if r.random() < 0.3:
        bad = r.choice(
            ["nan", "inf", "x", "1,alpha", "alpha=0.2", "alpha=True", "alpha=1e999", "alpha=１"]
        )
        case.arguments = [
            "distil",
            "--teacher",
            f"giesekus:{bad}",
            "--student",
            r.choice(["ucm", "x", ""]),
        ]
        student_ok = case.arguments[-1] == "ucm"
        fine = bad == "alpha=0.2" and student_ok
        case.nonsense = [] if fine else [f"teacher {bad}"] if student_ok else ["no student"]
    return case
