"""The page with every key of a study file, made from the schema that reads it.

``python docs/study_keys.py`` writes it; a test holds it equal to the schema.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from discover.study.schema import Study

PAGE = Path(__file__).parent / "study-file.md"

_HEAD = """# Every key of a study file

A study file is TOML. Only `[data]` is needed. Unknown keys and wrong values are refused, all at
once, with what was probably meant. This page is made from the schema that reads the file
(`docs/study_keys.py`).

```toml
[data]
folder = "melt"
held_out = ["fast.csv"]
[model]
law = "giesekus"
modes = "lve"
parameters = { alpha = "fit" }
```
"""


def study_page() -> str:
    """Return the page."""
    schema = Study.model_json_schema()
    parts = [_HEAD]
    for name, entry in schema["properties"].items():
        parts += _section(f"[{name}]", entry, schema["$defs"])
    return "\n".join(parts)


def _section(title: str, entry: dict[str, Any], defined: dict[str, Any]) -> Iterator[str]:
    """Yield a section with its keys, and then those of the tables in it."""
    (kind,) = _tables_in(entry)
    content = defined[kind]
    yield f"## `{title}`\n\n{entry.get('description', '')}\n"
    yield "| key | value | default | meaning |\n|---|---|---|---|"
    inside = []
    for key, value in content["properties"].items():
        default = _default(value.get("default"))
        if key in content.get("required", ()):
            default = "needed"
        said = value.get("description", "").replace("\n", " ").replace("|", "\\|")
        yield f"| `{key}` | {_kind(value, defined)} | {default} | {said} |"
        inside += [(key, value)] if list(_tables_in(value)) else []
    yield ""
    for key, value in inside:
        name = title.strip("[]")
        several = value.get("type") == "array"
        yield from _section(f"[[{name}.{key}]]" if several else f"[{name}.{key}]", value, defined)


def _tables_in(entry: dict[str, Any]) -> Iterator[str]:
    """Yield the names of the sections that a value may be."""
    if "$ref" in entry:
        yield entry["$ref"].rpartition("/")[2]
    for part in [*entry.get("anyOf", ()), *entry.get("allOf", ()), entry.get("items")]:
        if isinstance(part, dict):
            yield from _tables_in(part)


def _kind(entry: dict[str, Any], defined: dict[str, Any]) -> str:
    """Return in words what a value may be."""
    if any(_tables_in(entry)):
        return "list of tables, below" if entry.get("type") == "array" else "table, below"
    if "anyOf" in entry:
        kinds = [_kind(part, defined) for part in entry["anyOf"] if part.get("type") != "null"]
        return " or ".join(dict.fromkeys(kinds))
    if "const" in entry:
        return f'`"{entry["const"]}"`'
    if "enum" in entry:
        return ", ".join(f'`"{value}"`' for value in entry["enum"])
    if entry.get("type") == "array":
        if "prefixItems" in entry:
            return f"two of: {_kind(entry['prefixItems'][0], defined)}"
        return f"list of: {_kind(entry['items'], defined)}"
    if entry.get("type") == "object":
        return "table"
    name = {"string": "text", "boolean": "true or false", "integer": "whole number"}
    return name.get(entry["type"], entry["type"]) + _range(entry)


def _range(entry: dict[str, Any]) -> str:
    low = entry.get("minimum", entry.get("exclusiveMinimum"))
    high = entry.get("maximum", entry.get("exclusiveMaximum"))
    said = []
    if low is not None:
        said.append(f"{'>' if 'exclusiveMinimum' in entry else '≥'} {low:g}")
    if high is not None and high < 1e9:  # above it, a limit of arithmetic alone
        said.append(f"{'<' if 'exclusiveMaximum' in entry else '≤'} {high:g}")
    return f" {', '.join(said)}" if said else ""


def _default(value: Any) -> str:
    if value is None or value == {} or value == []:
        return "–"
    if isinstance(value, dict):
        return "see below"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, str):
        return f'`"{value}"`' if value else "–"
    if isinstance(value, list | tuple):
        return f"`[{', '.join(_default(one).strip('`') for one in value)}]`"
    return f"`{value}`"


if __name__ == "__main__":
    PAGE.write_text(study_page(), encoding="utf-8")
