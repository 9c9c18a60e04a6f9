"""TOML files that users write by hand: studies and mappings."""

import json
import re
import tomllib
from pathlib import Path
from typing import Any

from discover.dataset.tables.table import read_bytes
from discover.errors import InputError

_DEEPEST_KEY = 16
_PART = r"""(?:[A-Za-z0-9_-]++|"(?:[^"\\\n]|\\[^\n])*+"?|'[^'\n]*+'?)"""
_LINK = rf"[ \t]*+\.[ \t]*+{_PART}"
# No value has more than one dot outside strings, so whatever has many is a key. Every token is
# taken whole, closed or not, so that the time is linear in the text.
_TOKEN = re.compile(
    rf"""
    \#[^\n]*+
    | \"{{3}} (?: [^"\\] | \\. | "{{1,2}}(?!") )*+ (?:"{{3,5}})?
    | '{{3}} (?: [^'] | '{{1,2}}(?!') )*+ (?:'{{3,5}})?
    | (?P<deep> {_PART} (?:{_LINK}){{{_DEEPEST_KEY},}}+ )
    | {_PART} (?:{_LINK})*+
    """,
    re.VERBOSE | re.DOTALL,
)

LARGEST_FILE = 1_000_000
"""Bytes; what is written by hand is a page of text."""


def read_toml(path: Path, kind: str, example: str) -> tuple[dict[str, Any], str]:
    """Return the content of a TOML file, and its text.

    `kind`: what it should be, for messages, such as "study file". `example`: what to do instead of
    giving a file of another kind, as a sentence. Raises InputError if it cannot be read, is no text
    or no TOML; says on which line.
    """
    raw = read_bytes(
        path, str(path), f"Check the path of the {kind}.", largest=LARGEST_FILE, too_large=example
    )
    try:
        # editors on Windows write a byte order mark, which TOML does not know
        text = raw.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError:
        raise InputError(
            f"{path} is not UTF-8 text, so it is not a {kind}. Save it as UTF-8."
        ) from None
    # the library's time grows with the square of the parts, whether they make a key or not
    deep = next((token for token in _TOKEN.finditer(text) if token["deep"]), None)
    if deep is not None:
        line = text[: deep.start()].count("\n") + 1
        raise InputError(
            f"{path} has a key of more than {_DEEPEST_KEY} parts on line {line}, so it is not a "
            f"{kind}. {example}"
        )
    try:
        return tomllib.loads(text), text
    except RecursionError:
        raise InputError(f"{path} is nested too deeply to be a {kind}. {example}") from None
    except ValueError as error:  # TOML's own error, or a number of thousands of digits
        raise InputError(f"{path} is not valid TOML: {error}. Fix that line.") from None


def toml_string(text: str) -> str:
    """Return a text as TOML has it, which escapes as JSON does, and DEL besides."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
