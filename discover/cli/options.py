"""Options that several commands share."""

from pathlib import Path
from typing import Annotated

import typer

StudyArgument = Annotated[Path, typer.Argument(help="Study file (TOML).", show_default=False)]
OutOption = Annotated[
    Path | None, typer.Option("--out", "-o", help="Folder for the results; default: results/STUDY.")
]
SeedOption = Annotated[
    int | None,
    typer.Option(
        "--seed", min=0, max=2**32 - 1, help="Seed of noise and learners, in place of the study's."
    ),
]
QuietOption = Annotated[
    bool, typer.Option("--quiet", "-q", help="Print no progress and no summary.")
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]
OverwriteOption = Annotated[
    bool, typer.Option("--overwrite", help="Start again instead of resuming.")
]
ToleranceOption = Annotated[
    float | None,
    typer.Option(
        "--tolerance",
        min=0.0,
        max=1.0,
        help="Relative discrepancy that is good enough, in place of the study's; default: 0.05.",
    ),
]
