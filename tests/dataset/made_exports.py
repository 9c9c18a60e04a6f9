"""Exports of one Maxwell element in closed form, and their import.

What is compared went through text and units.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from click.testing import Result
from command_line import invoke

from discover.dataset import load_dataset

EXACT = 1e-12  # text of 17 digits; a unit costs a rounding or two
G, LAMBDA = 100.0, 2.0
OMEGA = np.geomspace(0.1, 100.0, 13)
STRAINS = np.geomspace(0.001, 1.0, 9)
TIMES = np.geomspace(0.01, 10.0, 30)
RATES = np.geomspace(0.01, 100.0, 11)


def moduli(omega, shift=1.0):
    x = omega * shift * LAMBDA
    return G * x**2 / (1 + x**2), G * x / (1 + x**2)


def softening(strain, omega=10.0):
    return tuple(m / (1 + strain**2) for m in moduli(np.full_like(strain, omega)))


def lines(*columns, mark="\t", comma=False, before=""):
    """Return rows of columns; a number stands in every row."""
    cells = zip(*(c.tolist() for c in np.broadcast_arrays(*columns)), strict=True)
    rows = [mark.join([*([before] if before else []), *map(repr, row)]) for row in cells]
    return [row.replace(".", ",") for row in rows] if comma else rows


class Imported(NamedTuple):
    """The folder that an import made, and what the command said."""

    folder: Path
    said: Result

    @property
    def run(self):
        """The one run of the folder."""
        (run,) = load_dataset(self.folder)
        return run


def imported(tmp_path, name, rows, *options, encoding="utf-8", code=0):
    path = tmp_path / name
    path.write_bytes("\r\n".join(rows).encode(encoding))
    return run(tmp_path, path, *options, code=code)


def exported(tmp_path, head, *columns, options=(), code=0, name="a.csv"):
    """Import a table of columns below one line or several of a head."""
    rows = [*([head] if isinstance(head, str) else head), *lines(*columns, mark=",")]
    return imported(tmp_path, name, rows, *options, code=code)


def run(tmp_path, *arguments, code=0):
    out = tmp_path / "data"
    return Imported(out, invoke("data", "import", *arguments, "--out", out, "--no-page", code=code))


def csv(table):
    rows = zip(*(np.asarray(v).tolist() for v in table.values()), strict=True)
    return "\n".join([",".join(table), *(",".join(map(repr, row)) for row in rows)])


def write_files(folder, files):
    """Write texts or bytes by their names, and return the folder."""
    folder.mkdir(exist_ok=True)
    for name, content in files.items():
        (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    return folder


def write_runs(folder, *runs, sweep=None, **files):
    """Write tables as r0.csv, r1.csv, ...; other files by their names, with __ for the dot."""
    named = {f"r{i}.csv": csv(run) for i, run in enumerate(runs)}
    named = {"runs.csv": "\n".join(["file", *named]), **named}
    named |= {"lve.csv": csv(sweep)} if sweep else {}
    return write_files(folder, named | {n.replace("__", "."): text for n, text in files.items()})


def sweep_table(points):
    """Return the moduli over four decades."""
    omega = np.geomspace(1e-2, 1e2, points)
    return {"omega_rad_s": omega, **dict(zip(("Gp_Pa", "Gpp_Pa"), moduli(omega), strict=True))}


def columns(text):
    head, *rows = text.splitlines()
    values = np.array([row.split(",") for row in rows], dtype=float)
    return dict(zip(head.split(","), values.T, strict=True))


def table(path):
    return columns(path.read_text())


def assert_sweep(path, omega=OMEGA, shift=1.0):
    found = table(path)
    order = np.argsort(found["omega_rad_s"])
    np.testing.assert_allclose(found["omega_rad_s"][order], omega, rtol=EXACT)
    for key, wanted in zip(("Gp_Pa", "Gpp_Pa"), moduli(omega, shift), strict=True):
        np.testing.assert_allclose(found[key][order], wanted, rtol=EXACT)


def assert_curve(folder, factor, name="flow_curve.csv"):
    np.testing.assert_allclose(table(folder / name)["stress_Pa"], factor * RATES, rtol=EXACT)


def assert_softening(path):
    found = table(path)
    np.testing.assert_allclose(found["strain"], STRAINS, rtol=EXACT)
    np.testing.assert_allclose(found["omega_rad_s"], 10.0, rtol=EXACT)
    np.testing.assert_allclose(found["Gp_Pa"], softening(STRAINS)[0], rtol=EXACT)
    np.testing.assert_allclose(found["Gpp_Pa"], softening(STRAINS)[1], rtol=EXACT)
