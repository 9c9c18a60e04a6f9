"""The import table, file by file: what comes of each export, and after how many tries.

A first try has no option. Where that does not give the test that the file holds, a second one has
the options that the first one's message asks for. A file counts as read where every number of
every test is what was written, to 1e-9, and nothing else came of it; of real files, whose truth
nobody has, where each step is taken for what it is called.

    python benchmarks/import_table.py [--real FOLDER]
"""

import argparse
import csv
import io
import tempfile
from pathlib import Path

import numpy as np
import openpyxl
from independent.exports import Export, exports
from typer.testing import CliRunner

from discover.cli import app

REAL = {
    "creep_experiment.txt": {"creep_experiment.csv"},
    "multi_technique.txt": {"amplitude_sweep.csv", "lve.csv", "multi_technique-3.csv"},
    "frequency_sweep_tts_ARES.txt": {f"lve_{t}C.csv" for t in range(-40, 151, 10)},
}
_OWN = {"runs.csv", "tests.csv", "import.toml"}


def tried(path: Path, options: tuple[str, ...], out: Path) -> str:
    """Import a file; return what the command said."""
    words = ["data", "import", str(path), "--out", str(out), "--overwrite", "--no-page", *options]
    return CliRunner().invoke(app, words).output


def columns_of(path: Path) -> dict[str, list[str]]:
    """Return the columns of a table by their names."""
    with path.open(encoding="utf-8") as stream:
        rows = list(csv.reader(stream))
    return {name: [row[i] for row in rows[1:]] for i, name in enumerate(rows[0])}


def wrong(export: Export, out: Path) -> str:
    """Return what is wrong with a folder; nothing where all is as it was written."""
    if not out.is_dir():
        return "refused"
    files = {path.name for path in out.iterdir()} - _OWN
    if files != set(export.holds):
        return f"{', '.join(sorted(files))} instead of {', '.join(sorted(export.holds))}"
    for name, wanted in export.holds.items():
        found = columns_of(out / name)
        for column, values in wanted.items():
            if column == "cells":
                runs = columns_of(out / "runs.csv")
                at = runs["file"].index(name)
                for cell, value in values.items():
                    if runs.get(cell, [""] * (at + 1))[at] != str(value):
                        return f"{cell} of {name}"
                continue
            # a wave is closed by its first sample once more
            got = np.array(found.get(column, []), dtype=float)[: len(values)]
            if len(got) != len(values) or not np.allclose(
                got, values, rtol=1e-9, atol=1e-12 * np.max(np.abs(values))
            ):
                return f"{column} of {name}"
    return ""


def as_spreadsheet(export: Export) -> tuple[Export, bytes]:
    """Return a text of commas as the first sheet of a workbook."""
    book, content = openpyxl.Workbook(), io.BytesIO()
    for line in export.text.splitlines():
        book.active.append([as_cell(word) for word in line.split(",")])
    book.save(content)
    name = export.name.replace(".csv", ".xlsx")
    return export._replace(shape="The same, as a spreadsheet", name=name), content.getvalue()


def as_cell(word: str) -> float | str:
    """Return a number as one."""
    try:
        return float(word)
    except ValueError:
        return word


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--real", type=Path, help="Folder with the real exports.")
    options = parser.parse_args()
    print("| file | tries | becomes |\n|---|---|---|")
    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        made = [(export, export.text.encode(export.encoding)) for export in exports()]
        made.insert(2, as_spreadsheet(made[1][0]))
        for number, (export, content) in enumerate(made):
            path = root / export.name
            path.write_bytes(content)
            out, tries = root / f"out{number}", 1
            said = tried(path, (), out)
            fault = wrong(export, out)
            if fault and export.options:
                tries = 2
                said = tried(path, export.options, out)
                fault = wrong(export, out)
            kinds = ", ".join(f"`{name}`" for name in list(export.holds)[:3])
            kinds += ", …" if len(export.holds) > 3 else ""
            with_what = f" (with `{' '.join(export.options)}`)" if tries > 1 else ""
            failed += bool(fault)
            end = f"**{fault}**: {said}" if fault else kinds
            print(f"| {export.shape} | {tries}{with_what} | {end} |", flush=True)
        for name, wanted in REAL.items() if options.real else ():
            out = root / f"real_{name}"
            tried(options.real / name, (), out)
            files = {path.name for path in out.iterdir()} - _OWN if out.is_dir() else set()
            fault = "" if files == wanted else f"**{', '.join(sorted(files)) or 'refused'}**"
            failed += bool(fault)
            kinds = ", ".join(f"`{name}`" for name in sorted(wanted)[:3])
            kinds += f", … ({len(wanted)} files)" if len(wanted) > 3 else ""
            print(f"| real TRIOS export `{name}` | 1 | {fault or kinds} |", flush=True)
    print(f"\n{failed} not read")


if __name__ == "__main__":
    main()
