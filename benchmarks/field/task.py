"""Every contestant of `field/contestants` on every fluid: the tables of `docs/evidence.md`."""

import importlib
import pkgutil
from pathlib import Path

from field import contestants
from field.cases import FLUIDS
from field.judge import judged, tables

QUESTIONS, SEED, LIMIT, FRESH = ("learn",), 1, 300.0, 1
NAMES = sorted(module.name for module in pkgutil.iter_modules(contestants.__path__))
GROUPS = {name: [f"{name} {fluid}" for fluid in FLUIDS] for name in NAMES}


def names(seed: int) -> list[str]:
    del seed
    return [name for group in GROUPS.values() for name in group]


def _module(name: str):
    return importlib.import_module(f"field.contestants.{name}")


def run(name: str, question: str, seed: int, folder: Path) -> dict:
    """Return what a contestant makes of a fluid; a package that is not there is a fault."""
    from discover.compilation_cache import enable_compilation_cache
    from discover.first_use import enable_x64

    enable_x64()
    enable_compilation_cache()
    contestant, fluid = name.split(" ", 1)
    return judged(_module(contestant), fluid, seed)


def line(row: dict) -> str:
    return row["words"][:90]


def table(rows: list[dict]) -> str:
    """Return the table of all contestants and one of each by fluid."""
    results = {tuple(row["case"].split(" ", 1)): row for row in rows}
    return tables(results, {name: _module(name).TITLE for name in NAMES})
