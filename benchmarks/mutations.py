"""What users, editors and disks do to files: seeded mutations of text, nested values and folders.

A mutation need not break a file; whoever uses it has to ask.
"""

import json
import os
import random
import shutil
from pathlib import Path
from typing import Any

TOKENS = (
    "nan", "inf", "-inf", "1e400", "-1", "0", "1e300", "1e-320", "", " ", "\t", ";", ",", ",,", '"',
    "'", "\n", "\r\n", "\r", "\n\n", "#", "0,5", "1.2.3", "--", "true", "0x10", "1_000", "é", "µ",
    "\ufeff", "\u2028", "\u202e", "\x1b[31m", "\x00", "../", "/etc/passwd", "~", "~nobody", "$HOME",
    "[", "]", "{", "}", "=", "[[", "99999999999999999999999", "9" * 5000, "0x" + "f" * 5000,
    "a" * 300, "time_s", "time_min", "time_parsec", "stress_furlong", "fit", "lve", "%s", "{0}",
    "1979-05-27", "1 MPa", "١٢", "None", "null", "file", "a.csv", "runs.csv", "\\u0000",
    '"\\u0000"', "<script>alert(1)</script>", "__import__('os')", "[red]", "\ud800",
)  # fmt: skip
"""Pieces of text that have broken a reader somewhere."""

VALUES: tuple[Any, ...] = (
    None, True, False, -1, 0, 1, 2**31, 2**70, 1e308, -1e-300, float("nan"), float("inf"), "", "0",
    "fit", "lve", "each", "a" * 300, "../up", "/", "\x00", "\u202e", "<b>", "\ud800", "exp(sigma)",
    "sigma.sigma.sigma.sigma", [], [1], [[]], ["x", "x"], {}, {"a": 1}, {"": {}}, [None],
    [1e400, -1],
)  # fmt: skip
"""Values of every type, many of them wrong anywhere."""


def mutate_text(text: str, source: random.Random) -> bytes:
    """Return the text with one to four things done to it."""
    data = text
    for _ in range(source.randint(1, 4)):
        lines = data.split("\n")
        i = source.randrange(len(data) + 1)
        row = source.randrange(len(lines))
        match source.randrange(11):
            case 0:
                data = data[:i] + source.choice(TOKENS) + data[i:]
            case 1:
                data = data[:i] + data[i + source.randint(1, 9) :]
            case 2:
                data = data[:i]
            case 3:
                del lines[row]
                data = "\n".join(lines)
            case 4:
                lines.insert(row, lines[source.randrange(len(lines))])
                data = "\n".join(lines)
            case 5:
                cells = lines[row].split(",")
                cells[source.randrange(len(cells))] = source.choice(TOKENS)
                lines[row] = ",".join(cells)
                data = "\n".join(lines)
            case 6:
                data = data.replace(*source.choice(((",", ";"), (".", ","), ("\n", "\r\n"))))
            case 7:
                source.shuffle(lines)
                data = "\n".join(lines)
            case 8:
                key, equals, _ = lines[row].partition("=")
                lines[row] = f"{key}= {source.choice(TOKENS)}" if equals else lines[row]
                data = "\n".join(lines)
            case 9:
                data = source.choice(TOKENS) + data
            case _:
                data += source.choice(TOKENS)
    raw = data.encode("utf-8", "surrogatepass")
    match source.randrange(12):
        case 0:
            raw = raw[: source.randrange(len(raw) + 1)] + source.randbytes(3)
        case 1:
            raw = data.encode("utf-16", "replace")
        case 2:
            raw = data.encode("latin-1", "replace")
    return raw


def mutate_values(content: Any, source: random.Random) -> Any:
    """Return a copy of nested lists and dictionaries with one to three entries wronged."""
    for _ in range(source.randint(1, 3)):
        content = json.loads(json.dumps(content))  # a copy, in which no two places are one
        places = list(_places(content))
        if not places:
            break
        holder, key = source.choice(places)
        match source.randrange(6):
            case 0:
                del holder[key]
            case 1 if isinstance(holder, dict):
                holder[source.choice((key + "x", key.upper(), "", "a.b", *TOKENS[:4]))] = (
                    holder.pop(key)
                )
            case 2 if isinstance(holder, dict):
                holder[source.choice(("units", "law", "noise", "x" * 200))] = holder[key]
            case 3:
                holder[key] = [holder[key]] * source.choice((1, 2, 50))
            case _:
                holder[key] = source.choice(VALUES)
    return json.loads(json.dumps(content))


def _places(content: Any):
    keys = content if isinstance(content, dict) else range(len(content))
    for key in list(keys):
        yield content, key
        if isinstance(content[key], dict | list):
            yield from _places(content[key])


def to_toml(content: dict[str, Any]) -> str:
    """Return nested values as TOML, tables at the top as sections; what TOML lacks becomes text."""
    tables = {key: value for key, value in content.items() if isinstance(value, dict)}
    lines = [
        f"{_toml(key)} = {_toml(value)}" for key, value in content.items() if key not in tables
    ]
    for name, table in tables.items():
        lines.append(f"[{_toml(name)}]")
        lines += [f"{_toml(key)} = {_toml(value)}" for key, value in table.items()]
    return "\n".join(lines) + "\n"


def _toml(value: Any) -> str:
    match value:
        case bool() | int() | float():
            return repr(value).lower()
        case dict():
            return "{" + ", ".join(f"{_toml(k)} = {_toml(v)}" for k, v in value.items()) + "}"
        case list():
            return "[" + ", ".join(map(_toml, value)) + "]"
    return json.dumps(str(value), ensure_ascii=False).replace("\x7f", "")


def spoil_file(path: Path, source: random.Random) -> None:
    """Put something in a file's place that is no such file."""
    other = path.with_name("elsewhere")
    match source.randrange(7):
        case 0:
            path.unlink()
        case 1:
            path.unlink()
            path.mkdir()
        case 2:
            path.unlink()
            os.mkfifo(path)
        case 3:
            path.unlink()
            path.symlink_to(path.name)
        case 4:
            path.unlink()
            path.symlink_to(source.choice(("/etc/passwd", "/dev/zero", "nowhere")))
        case 5:
            path.write_bytes(b"")
        case _:
            shutil.move(path, other)
            path.write_bytes(source.randbytes(source.randint(1, 2000)))
