"""Inputs of the command line written by a grammar: good ones, with hostile parts in their places.

Every generator starts from something sane and puts in at most a few parts of a list of hostile
ones. What no sane program should take is marked as nonsense with a reason, so that a run can say
what was taken nevertheless. Nothing here is derived from `malformed_inputs.py`.
"""

import json
import math
import random
from dataclasses import dataclass, field

Content = bytes | tuple[str, str]
"""What a file holds, or (kind, target) of something else in its place."""


@dataclass
class Case:
    """One call of the command line.

    Attributes
    ----------
    kind
        Generator that made it.
    arguments
        Of the command line; ``{}`` stands for the folder.
    files
        By path in that folder.
    nonsense
        What in it no sane program should take.
    """

    kind: str
    arguments: list[str] = field(default_factory=list)
    files: dict[str, Content] = field(default_factory=dict)
    nonsense: list[str] = field(default_factory=list)


WORDS_FOR_NUMBERS = ["nan", "inf", "-inf", "0x1F", "1_000", "１２３", "١٢", "1e999", "", "--",
                     "true", "None", "1d5", "+-1", "1e", "∞", "½", "1 2", "'1", "#REF!",
                     "1,5"]  # fmt: skip
WORDS = ["", " ", "\u202egnp.exe", "a\u0301" * 9, "é", "…", "x" * 5000, "../../etc/passwd",
         "/dev/zero", "CON", "a\tb", "${HOME}", "%s%n", "<script>", "'; DROP", "\U0001f9ea",
         "\ufeff", "~nobody"]  # fmt: skip
ENCODINGS = ["utf-16", "utf-16-le", "utf-32", "cp037", "utf-7"]
PLACES = [("folder", ""), ("pipe", ""), ("link", "/dev/zero"), ("link", "/dev/null"), ("link", "."),
          ("link", "itself"), ("link", "/etc/hostname"), ("absent", "")]  # fmt: skip


def words(r: random.Random) -> str:
    return r.choice(WORDS)


# Studies: a valid tree of values, some leaves replaced, then its text damaged


def _valid_study(r: random.Random, folder: bool) -> dict:
    data: dict = {"synthetic": {"law": "giesekus", "parameters": {"alpha": 0.2}, "noise": 0.01}}
    if folder:
        data = {"folder": "data", "held_out": ["b.csv"], "rate": "commanded"}
    model = {
        "law": r.choice(["ucm", "giesekus", "ptt_linear"]),
        "modulus_Pa": r.choice([1.0, "fit"]),
    }
    model |= {"relaxation_time_s": 1.0, "known_relaxation": True}
    model |= {"solvent_viscosity_Pa_s": 0.1}
    loop = {"max_effects": 2, "strain": [0.01, 25], "noise": 0.02, "most_samples": 100}
    compare = {"learners": ["tensor_sindy"], "library": {"degree": 1, "closed_forms": ["exp"]}}
    compare |= {"seed": 3, "quick": True, "members": 1, "max_terms": 3, "high_deborah": [1.5]}
    return {"data": data, "model": model, "loop": loop, "compare": compare}


def _leaves(tree: object, path: tuple = ()) -> list[tuple]:
    if not isinstance(tree, dict):
        return [path]
    return [leaf for key, value in tree.items() for leaf in _leaves(value, (*path, key))]


def _swap_leaf(r: random.Random, tree: dict) -> str:
    path = r.choice(_leaves(tree))
    place = tree
    for key in path[:-1]:
        place = place[key]
    old = place[path[-1]]
    others = [
        True,
        "3",
        "fit\u200b",
        math.nan,
        math.inf,
        [[1]],
        {"a": 1},
        -1,
        1e308,
        10**40,
        [],
        1e-310,
    ]
    new = r.choice(others)
    place[path[-1]] = new
    name = ".".join(map(str, path))
    if type(new) is type(old) or (isinstance(new, int) and isinstance(old, float)):
        absurd = not isinstance(new, bool) and (
            new == -1 or (isinstance(new, float) and new > 1e300)
        )
        return f"{name} = {new!r:.20}" if absurd or new == 10**40 or new != new else ""
    if new == [] and path[-1] in ("held_out", "closed_forms", "high_deborah", "fit"):
        return ""
    return "" if isinstance(old, bool) and isinstance(new, bool) else f"{name} = {new!r:.20}"


def _toml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_key(k)} = {_toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(value)


def _key(key: str) -> str:
    return key if key.replace("_", "").isascii() and key.isidentifier() else _toml(key)


def _study_text(tree: dict) -> str:
    parts = []
    for name, section in tree.items():
        if isinstance(section, dict):
            parts.append(f"[{name}]")
            parts += [f"{_key(key)} = {_toml(value)}" for key, value in section.items()]
        else:
            parts.insert(0, f"{name} = {_toml(section)}")
    return "\n".join(parts) + "\n"


def _damage_text(r: random.Random, text: str) -> tuple[bytes, str]:
    raw = text.encode("utf-8", "replace")
    at = r.randrange(1, len(raw))
    return r.choice([
        (raw + b"\n[data]\n", "a table twice"),
        (raw.replace(b"[loop]\n", b"[loop]\nnoise = 0.1\nnoise = 0.1\n"), "a key twice"),
        (raw + b"x = " + b"[" * 5000, "nested lists"),
        (raw + b"[x" + b".y" * r.choice([40, 20_000]) + b"]\n", "a deep table"),
        (raw + b'"' + b"k" * 400_000 + b'" = 1\n', "a huge key"),
        (raw + b'note = "' + b"v" * 900_000 + b'"\n', "an unknown key of a huge value"),
        (raw + b"n = " + b"9" * 6000 + b"\n", "a huge number"),
        (raw + b"".join(b"[t%d]\n" % i for i in range(20_000)), "thousands of tables"),
        (raw + b"x = {" + b"a = {" * 3000, "nested tables"),
        (raw[:at] + b"\0" + raw[at:], "a zero byte"),
        (raw[:at] + b"\xff\xfe" + raw[at:], "no UTF-8"),
        (text.encode("utf-16"), "UTF-16"),
        (b"\xef\xbb\xbf" + raw.replace(b"\n", b"\r\n"), ""),
        (raw[:at], ""),
        (b"", "an empty file"),
        (b"\n" * 900_000, "blank lines alone"),
        (bytes(r.randrange(256) for _ in range(300)), "random bytes"),
        (b'{"data": 1}', "JSON"),
    ])  # fmt: skip


def study_case(r: random.Random) -> Case:
    case = Case("study")
    folder = r.random() < 0.5
    tree = _valid_study(r, folder)
    case.files = data_files(r) if folder else {}
    for _ in range(r.choice([0, 1, 1, 2])):
        case.nonsense.append(_swap_leaf(r, tree))
    if r.random() < 0.25:
        section = r.choice(list(tree))
        tree[section][words(r) or "x"] = 1
        case.nonsense.append(f"an unknown key in {section}")
    if r.random() < 0.15 and folder:
        key = r.choice(["fit", "held_out", "clock_factor", "rate_before", "sequence", "folder"])
        name = words(r)
        tree["data"][key] = [name] if key in ("fit", "held_out") else name
        case.nonsense.append(f"{key} = {name!r:.20}")
    raw: Content = _study_text(tree).encode("utf-8", "replace")
    if r.random() < 0.3:
        raw, what = _damage_text(r, _study_text(tree))
        case.nonsense.append(what)
    name = r.choice(["study.toml"] * 8 + ["m\udce9.toml", ".toml", "a b.toml", "é" * 60 + ".toml"])
    if r.random() < 0.08:
        raw = r.choice(PLACES)
        case.nonsense.append(f"{raw} as study")
    case.files[name] = raw
    command = r.choice(["compare", "close-loop", "batch"])
    case.arguments = [command, f"{{}}/{name}", "--out", "{}/out"]
    return case


# Data folders: start-ups of a Maxwell fluid, some cells, lines, headings or files replaced

UNITS = {"time_s": 1.0, "time_ms": 1e3, "time_min": 1 / 60, "stress_Pa": 1.0, "stress_kPa": 1e-3,
         "stress_dyn_cm2": 10.0, "stress_psi": 1 / 6894.757293168361, "shear_rate_1_min": 60.0,
         "stress_Pa_2": None, "stress_10Pa": None, "time_s_2": None, "time_s2": None,
         "stress_Pas": None, "stress_9**9": None, "time_": None, "stress_pi_Pa": None,
         "shear_rate_s": None, "stress_e3_Pa": None, "time_Hz": None, "STRESS_PA": None,
         "stress__Pa": None, "stress_Pa10": None, "time_s_s": None, "stress_µ": None}  # fmt: skip


def _table(columns: dict[str, list]) -> str:
    rows = zip(*columns.values(), strict=True)
    return "\n".join([",".join(columns), *(",".join(map(str, row)) for row in rows)]) + "\n"


def data_files(r: random.Random) -> dict[str, Content]:
    """Return a good data folder, under ``data/``."""
    files: dict[str, str] = {}
    for name, rate in (("a.csv", 0.5), ("b.csv", 2.0), ("c.csv", 5.0)):
        time = [0.05 * 1.12**i for i in range(40)]
        stress = [100 * rate * (1 - math.exp(-t)) for t in time]
        columns = {"time_s": time, "shear_rate_1_s": [rate] * 40, "stress_Pa": stress}
        files[name] = _table(columns)
    files["runs.csv"] = "file,factor,label\na.csv,1,x\nb.csv,1,y\nc.csv,2,\n"
    omega = [10 ** (0.25 * i - 2) for i in range(17)]
    moduli = [[100 * w**2 / (1 + w**2) for w in omega], [100 * w / (1 + w**2) for w in omega]]
    names = ("omega_rad_s", "Gp_Pa", "Gpp_Pa")
    files["lve.csv"] = _table(dict(zip(names, [omega, *moduli], strict=True)))
    return {f"data/{name}": text.encode() for name, text in files.items()}


def _damage_table(r: random.Random, raw: bytes, name: str) -> tuple[bytes, str]:
    lines = raw.decode().splitlines()
    i = r.randrange(1, len(lines))
    cells = lines[i].split(",")
    j = r.randrange(len(cells)) if name != "runs.csv" else 0
    form = r.randrange(14)
    if form <= 2:
        cells[j] = r.choice([*WORDS_FOR_NUMBERS, "1e-320", "1e16", "-1e300", "9" * 400, "-5", "0"])
        known = cells[j] in ("1e-320", "-5", "0")
        lines[i] = ",".join(cells)
        return "\n".join(lines).encode(), "" if known else f"{cells[j]!r:.12} in {name}"
    if form <= 4:
        heading = r.choice(list(UNITS))
        old = next(
            (k for k in lines[0].split(",") if k.startswith(heading.split("_")[0].lower())), ""
        )
        if not old or name in ("runs.csv", "lve.csv"):
            return raw, ""
        lines[0] = lines[0].replace(old, heading)
        good = UNITS[heading] is not None
        unsaid = f"unsaid {heading}" if good and UNITS[heading] != 1.0 else ""
        return "\n".join(lines).encode(), unsaid if good else f"heading {heading}"
    if form == 5 and name != "runs.csv":
        factor = r.choice([1e-200, 1e-90, 1e-30, 1e-9, 0.0, -1.0, 1e9, 1e13, 1e200])
        rows = [line.split(",") for line in lines[1:]]
        for row in rows:
            row[j] = repr(float(row[j]) * factor)
        column = lines[0].split(",")[j]
        signed = column[0] != "t" and name != "lve.csv"
        fine = 1e-90 < abs(factor) < 1e14 and (factor > 0 or signed)
        body = "\n".join([lines[0], *map(",".join, rows)])
        # rest and reversed flow are for the checks to say
        return body.encode(), "" if fine or column[0] == "s" else f"{column} × {factor:g} in {name}"
    text = "\n".join(lines)
    return r.choice([
        ("\n".join([*lines[:i], lines[i] + ",7", *lines[i + 1 :]]).encode(), "a ragged row"),
        ("\n".join([*lines[:i], lines[i][:2], *lines[i + 1 :]]).encode(), f"a cut row in {name}"),
        ("\n".join([lines[0], *lines[:0:-1]]).encode(), "" if name in ("runs.csv", "lve.csv")
         else "time backwards"),
        ((text + "\n" + lines[-1]).encode(),
        "" if name == "lve.csv" else f"a line twice in {name}"),
        (text.replace(",", r.choice([";", "\t", "|", ",,"])).encode(), "another separator"),
        (text.replace("\n", r.choice(["\r\n", "\n\n"])).encode(), ""),
        (b"\xef\xbb\xbf" + raw, ""),
        (text.encode(r.choice(ENCODINGS[:4]), "replace"), "another encoding"),
        (raw[: len(raw) // 2] + b"\0" + raw[len(raw) // 2 :], "a zero byte"),
        (raw + b"\xff\xfe\n", "no UTF-8"),
        (("\n".join(lines[1:])).encode(), "no header"),
        (lines[0].encode(), "a header alone"),
        ((lines[0].replace(lines[0].split(",")[0], lines[0].split(",")[-1])).encode()
         + b"\n" + "\n".join(lines[1:]).encode(), "a column twice"),
        (text.replace(cells[0], '"' + cells[0], 1).encode(), "an open quote"),
        (text.replace(cells[0], "7" * 200_000, 1).encode(), "a huge field"),
        (b"", "an empty file"),
        (b"\n" * 100_000, "blank lines"),
        ((lines[0] + ",x" * 30_000 + "\n" + lines[1]).encode(), "thousands of columns"),
        (bytes(r.randrange(256) for _ in range(200)), "random bytes"),
    ])  # fmt: skip


def folder_case(r: random.Random) -> Case:
    case = Case("folder", files=data_files(r))
    for _ in range(r.choice([0, 1, 1, 1, 2])):
        name = r.choice(["a.csv", "b.csv", "runs.csv", "lve.csv"])
        path = f"data/{name}"
        raw = case.files[path]
        if r.random() < 0.12:
            case.files[path] = r.choice(PLACES)
            absent = case.files[path] == ("absent", "") and name == "lve.csv"
            case.nonsense.append("" if absent else f"{case.files[path]} as {name}")
        elif isinstance(raw, bytes) and raw.count(b"\n") > 2:
            try:
                case.files[path], what = _damage_table(r, raw, name)
            except UnicodeDecodeError:
                continue
            case.nonsense.append(what)
    if r.random() < 0.1:
        name = r.choice(["../a.csv", "/etc/hostname", "data", "runs.csv", "a.csv\u202e", "x" * 400])
        case.files["data/runs.csv"] = f"file\n{name}\n".encode()
        case.nonsense.append(f"a run named {name:.20}")
    case.arguments = ["data", r.choice(["check", "check", "show"]), "{}/data"]
    if r.random() < 0.15:
        case.arguments.append("--json")
    if r.random() < 0.1 and case.arguments[1] == "check":
        case.arguments += ["--clock-factor", r.choice(["factor", "label", "nobody", "file", ""])]
    return case
