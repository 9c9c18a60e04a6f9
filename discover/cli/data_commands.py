"""Commands on data folders: list, show, check, import."""

import json
import os
from pathlib import Path
from typing import Annotated, get_args

import typer
from typer import Argument, Option

from discover.cli.console import (
    JsonOption,
    Number,
    OverwriteOption,
    Place,
    Text,
    Texts,
    guarded,
    say,
)
from discover.errors import InputError

data_app = typer.Typer(help="Import, check and draw data.", no_args_is_help=True)

FolderArgument = Annotated[
    str, Argument(help="Folder, or its name under DISCOVER_DATA.", show_default=False)
]


@data_app.command("list")
@guarded
def list_data(as_json: JsonOption = False) -> None:
    """List the data sets under DISCOVER_DATA."""
    from discover.dataset.load import DATA_VARIABLE
    from discover.dataset.read_run import INDEX_FILE
    from discover.dataset.tables.table import read_bytes

    root = os.environ.get(DATA_VARIABLE)
    if not root:
        raise InputError(
            f"The environment variable {DATA_VARIABLE} is not set. Set it to the folder that holds "
            "your data folders."
        )
    if not Path(root).is_dir():
        raise InputError(f"{DATA_VARIABLE} names {root}, which is not a folder.")
    rows = []
    for folder in sorted(Path(root).iterdir()):
        index = folder / INDEX_FILE
        if index.is_file():
            lines = read_bytes(index, str(index)).decode("utf-8", "replace").splitlines()
            runs = sum(1 for line in lines[1:] if line.strip())
            rows.append({"name": folder.name, "runs": runs, "lve": (folder / "lve.csv").is_file()})
    if as_json:
        typer.echo(json.dumps(rows, indent=2))
        return
    if not rows:
        say(f"No data folder under {root}: none of its folders has a {INDEX_FILE}.")
    for row in rows:
        sweep = "linear sweep" if row["lve"] else "no linear sweep"
        say(f"{row['name']:<24} {row['runs']:>4} runs  {sweep}")


@data_app.command("show")
@guarded
def show(
    name: FolderArgument,
    out: Annotated[
        Place, Option("--out", "-o", help="Folder for a page with all tests drawn, and a study.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Show the runs of a data set, in a table and on a page."""
    import pandas as pd

    from discover.cli.import_options import write_page
    from discover.dataset.checking.folder import check_folder
    from discover.dataset.load import load_dataset
    from discover.dataset.run_table import run_line
    from discover.words import counted

    dataset = load_dataset(name)
    tables = [run_line(run) for run in dataset.material_functions.values()]
    rows = [run_line(run) for run in dataset]
    sweep = dataset.linear_sweep
    n_sweep = 0 if sweep is None else len(sweep)
    page, kept = None, []
    if out is not None:
        here = Path(name)
        # where the study lies a relative path would be another one
        folder = here.resolve().as_posix() if here.is_dir() else name
        page, kept = write_page(dataset, folder, out, check_folder(name))
    if as_json:
        content = {"name": dataset.name, "runs": rows, "tables": tables, "lve_points": n_sweep}
        written = {"page": None if page is None else str(page), "kept": kept}
        typer.echo(json.dumps({**content, **written}, indent=2))
        return
    linear = f"a linear sweep with {n_sweep} points" if n_sweep else "no linear sweep"
    say(f"{dataset.name}: {counted(len(rows), 'run')}, {linear}")
    for row in (*rows, *tables):
        row["flow"] = ", ".join([row["flow"], *(key for key in ("N1", "N2") if row[key])])
    columns = ["run", "samples", "duration_s", "largest_rate_1_s", "largest_stress_Pa", "flow"]
    table = pd.DataFrame([*rows, *tables], columns=columns)
    if len(table):
        say(table.to_string(index=False, na_rep="–", float_format="{:.4g}".format))
    if page is None:
        say("For a page with all tests drawn, and a study to start from, add --out DIR.")
    else:
        for sentence in kept:
            say(sentence)
        say(f"Page: {page}")
        say(f"A study to start from: discover close-loop {page.with_name('study.toml')}")


@data_app.command("check")
@guarded
def check(
    folder: FolderArgument,
    clock_factor: Annotated[Text, Option(help="Column of runs.csv with a clock factor.")] = None,
    as_json: JsonOption = False,
) -> None:
    """List everything that is wrong or doubtful in a data folder; exit code 2 on errors."""
    from dataclasses import asdict

    from discover.dataset.checking.folder import check_folder
    from discover.dataset.checking.runs import Severity

    findings = check_folder(folder, clock_factor)
    if as_json:
        lists = {
            f"{severity}s": [asdict(finding) for finding in findings.of(severity)]
            for severity in get_args(Severity)
        }
        typer.echo(json.dumps({"folder": folder, **lists}, indent=2))
    else:
        for finding in findings:
            say(f"{finding.severity}: {finding}", err=finding.severity == "error")
        say(f"{folder}: {findings.counts}." if findings else f"{folder}: nothing wrong was found.")
    if findings.of("error"):
        raise typer.Exit(2)


_GEOMETRY = "For torque, angle and force: cone_plate:radius_mm=25,angle_deg=1 or "
_GEOMETRY += "plate_plate:radius_mm=25,gap_mm=1."
_TEST = "Kind of test in a block, if it is misread: melt.txt:2=creep; frequency_sweep, "
_TEST += "amplitude_sweep, flow_curve, relaxation, creep, run or none."
_TEMPERATURE = "Temperature to import, in °C, if there are several, or of a file: melt.txt=140."


@data_app.command("import")
@guarded
def import_data(
    files: Annotated[
        list[Path] | None,
        Argument(help="Exported files, with one or more tests in each, or a folder of them."),
    ] = None,
    out: Annotated[Place, Option("--out", "-o", help="Data folder to make.")] = None,
    mapping: Annotated[Place, Option(help="TOML file with the options below.")] = None,
    column: Annotated[Texts, Option(help="Which column is what: stress='Stress'.")] = None,
    unit: Annotated[Texts, Option(help="Unit of a quantity: stress=kPa.")] = None,
    geometry: Annotated[Text, Option(help=_GEOMETRY)] = None,
    block: Annotated[list[int] | None, Option(min=1, help="Import only these blocks.")] = None,
    test: Annotated[Texts, Option(help=_TEST)] = None,
    temperature: Annotated[Texts, Option(help=_TEMPERATURE)] = None,
    start_time: Annotated[Number, Option(help="Clock when the flow started, in s.")] = None,
    form: Annotated[Text, Option("--format", help="Importer; default: by suffix or text.")] = None,
    delimiter: Annotated[Text, Option(help="tab, semicolon or comma.")] = None,
    decimal: Annotated[Text, Option(help="Decimal sign, . or ,")] = None,
    header_row: Annotated[int | None, Option(min=1, help="Line with the column names.")] = None,
    encoding: Annotated[Text, Option(help="Such as cp1252.")] = None,
    page: Annotated[bool, Option(help="Write a page with every test drawn, and a study.")] = True,
    as_json: JsonOption = False,
    overwrite: OverwriteOption = False,
) -> None:
    """Make a data folder from rheometer exports: text, spreadsheets, RepTate, your own formats."""
    from discover.cli import import_options as options
    from discover.dataset.checking.folder import check_folder
    from discover.dataset.checking.runs import Findings
    from discover.dataset.importing import import_files
    from discover.dataset.load import DATA_FILES

    if out is None:
        raise InputError("Say where the data folder goes: --out FOLDER.")
    layout = {
        "format": form, "delimiter": delimiter, "decimal": decimal, "header_row": header_row,
        "encoding": encoding,
    }  # fmt: skip
    pairs = {"columns": column, "units": unit, "tests": test, "temperatures": temperature}
    merged = options.merge_mapping(mapping, pairs, layout, geometry, block, start_time)
    paths, changed = options.sources_of(merged, mapping, files or [])
    imported = import_files(paths, merged)
    options.write_folder(imported, out, overwrite, mapping)
    # a folder of several temperatures is for one to be chosen from
    whole = any(name in imported.files for name in DATA_FILES)
    findings = check_folder(out) if whole else Findings()
    errors = findings.of("error")
    said = [*changed, *imported.said]
    written = options.write_import_page(out, findings, said) if page and whole else None
    if as_json:
        content = {
            "folder": str(out),
            "files": sorted(imported.files),
            "said": said,
            "unread": imported.unread,
            "errors": [str(finding) for finding in errors],
            "warnings": [str(f) for f in findings.of("warning")],
            "page": None if written is None else str(written),
        }
        typer.echo(json.dumps(content, indent=2))
    else:
        for line in said:
            say(line)
        for finding in findings:
            say(f"{finding.severity}: {finding}", err=finding.severity == "error")
        for line in imported.unread:
            say(f"not read: {line}", err=True)
        say(f"{out}: {len(imported.files) + 1} files written.")
        if written is not None:
            say(f"Every test drawn, to see whether each column is what its name says: {written}")
            say(f"A study to start from: discover close-loop {out / options.STUDY_FILE}")
    if errors:
        raise typer.Exit(2)
