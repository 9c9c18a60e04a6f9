"""What users, editors and disks do to files: seeded harm to text, nested values and folders.

Harm need not break a file; whoever does it has to ask.
"""

import json
import os
import random
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

SANE: dict[str, Any] = json.loads(Path(__file__).with_name("malformed.json").read_text("utf-8"))
"""Files of every sort that the command line reads, with nothing wrong in them."""

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
    None, True, False, -1, 0, 1, 2**31, 2**70, 10**400, 1e308, -1e-300, float("nan"), float("inf"),
    "", "0", "fit", "lve", "each", "a" * 3000, "../up", "/", "/dev/zero", "\x00", "\u202e", "<b>",
    "\ud800", "exp(sigma)", "sigma" + ".sigma" * 99, "(" * 5000, [], [1], [[]] * 3, ["x", "x"], {},
    {"a": 1}, {"": {}}, [None], [1e400, -1],
)  # fmt: skip
"""Values of every type, many of them wrong anywhere."""


def mutate_text(text: str, source: random.Random) -> bytes:
    """Return the text with one to four things done to it."""
    data = text
    for _ in range(source.randint(1, 4)):
        lines, token = data.split("\n"), source.choice(TOKENS)
        i, row = source.randrange(len(data) + 1), source.randrange(len(lines))
        match source.randrange(10):
            case 0:
                data = data[:i] + token + data[i:]
            case 1:
                data = data[:i] + data[i + source.randint(1, 9) :]
            case 2:
                data = source.choice((data[:i], token + data, data + token))
            case 3:
                data = "\n".join(lines[:row] + lines[row + 1 :])
            case 4:
                lines.insert(row, lines[source.randrange(len(lines))])
                data = "\n".join(lines)
            case 5:
                cells = lines[row].split(",")
                cells[source.randrange(len(cells))] = token
                data = "\n".join([*lines[:row], ",".join(cells), *lines[row + 1 :]])
            case 6:
                data = data.replace(*source.choice(((",", ";"), (".", ","), ("\n", "\r\n"))))
            case 7:
                source.shuffle(lines)
                data = "\n".join(lines)
            case 8:
                key, equals, _ = lines[row].partition("=")
                lines[row] = f"{key}= {token}" if equals else lines[row]
                data = "\n".join(lines)
            case _:
                nested = source.choice(("[" * 10**5, '{"a":' * 10**4, "[x" + ".y" * 10**4 + "]"))
                data += nested if source.random() < 0.2 else token
    raw = data.encode("utf-8", "surrogatepass")
    match source.randrange(12):
        case 0:
            raw = raw[: source.randrange(len(raw) + 1)] + source.randbytes(3)
        case 1:
            raw = data.encode(source.choice(("utf-16", "utf-32", "cp037")), "replace")
        case 2:
            raw = data.encode("latin-1", "replace")
    return raw


def mutate_values(content: Any, source: random.Random) -> Any:
    """Return a copy of nested lists and dictionaries with one to three entries wronged."""
    for _ in range(source.randint(1, 3)):
        content = json.loads(json.dumps(content))  # a copy, in which no two places are one
        if not (places := list(holders(content))):
            break
        holder, key = source.choice(places)
        match source.randrange(6):
            case 0:
                del holder[key]
            case 1 if isinstance(holder, dict):
                name = source.choice((key + "x", key.upper(), "", "a.b", *TOKENS[:4]))
                holder[name] = holder.pop(key)
            case 2 if isinstance(holder, dict):
                holder[source.choice(("units", "law", "noise", "x" * 200))] = holder[key]
            case 3:
                holder[key] = [holder[key]] * source.choice((1, 2, 50))
            case _:
                holder[key] = source.choice(VALUES)
    return json.loads(json.dumps(content))


def holders(content: Any) -> Iterator[tuple[Any, Any]]:
    """Yield every place of nested values as what holds it, and its key."""
    for key in list(content if isinstance(content, dict) else range(len(content))):
        yield content, key
        if isinstance(content[key], dict | list):
            yield from holders(content[key])


def spoil_file(path: Path, source: random.Random) -> None:
    """Put something in a file's place that is no such file."""
    kind = source.choice(("absent", "folder", "pipe", "loop", "link", "empty", "other"))
    if kind in ("absent", "folder", "pipe", "loop", "link"):
        path.unlink()
    match kind:
        case "folder":
            path.mkdir()
        case "pipe":
            os.mkfifo(path)
        case "loop":
            path.symlink_to(path.name)
        case "link":
            path.symlink_to(source.choice(("/etc/passwd", "/dev/zero", "nowhere")))
        case "empty":
            path.write_bytes(b"")
        case "other":
            shutil.move(path, path.with_name("elsewhere"))
            path.write_bytes(source.randbytes(source.randint(1, 2000)))


def spoil(root: Path, name: str, source: random.Random) -> None:
    """Harm a file of a folder, or put something else in its place."""
    path = root / name
    if source.random() < 0.15:
        spoil_file(path, source)
    else:
        path.write_bytes(mutate_text(path.read_text("utf-8"), source))


def write_files(root: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        (root / name).write_text(text, encoding="utf-8", errors="surrogatepass")
