"""Files of RepTate: parameters on the first line, then columns that their suffix names.

The suffix says what the columns are, whatever the file writes above them: RepTate 1.3 divides the
second column of ``.shear`` and ``.uext`` by the rate to show a viscosity, so it is a stress even
where it is headed "h" or "Pa-s"   [Boudara, Read & Ramírez 2020, J. Rheol. 64, 709].
"""

import re
from pathlib import Path

import numpy as np

from discover.dataset.importing.header_constants import Constant, constants_of
from discover.dataset.importing.text_export import Block
from discover.dataset.importing.text_rows import is_number
from discover.dataset.tables.table import read_bytes
from discover.errors import InputError

_TIME, _RATE, _STRESS = ("time", "s"), ("gdot", "1/s"), ("stress", "Pa")
_MODULI = (("omega", "rad/s"), ("G'", "Pa"), ("G''", "Pa"))

COLUMNS = {
    ".tts": _MODULI,
    ".osc": _MODULI,
    ".shear": (_TIME, _STRESS),
    ".uext": (_TIME, ("tensile stress", "Pa")),
    ".laos": (_TIME, ("strain", "-"), _STRESS),
    ".creep": (_TIME, ("strain", "-")),
    ".gt": (_TIME, ("relaxation modulus", "Pa")),
}
"""Names and units of the columns, by suffix; further ones are not read."""

_PARAMETERS = {
    ".shear": {"gdot": ("shear rate", "1/s")},
    ".uext": {"gdot": ("hencky rate", "1/s"), "edot": ("hencky rate", "1/s")},
    ".creep": {"stress": ("stress", "Pa")},
}
_TEMPERATURE = ("temperature", "°C")


def read_reptate(path: Path) -> list[Block]:
    """Return the one block of a file of RepTate.

    Raises
    ------
    InputError
        If it has too few columns of numbers, or lacks a parameter that such a file needs.
    """
    suffix = path.suffix.lower()
    lines = re.split(r"\r\n|\r|\n", read_bytes(path, path.name).decode("cp1252", "replace"))
    table = [line.replace(",", " ").split() for line in lines[1:]]
    wanted = COLUMNS[suffix]
    width = len(wanted)
    rows = [row[:width] for row in table if len(row) >= width and all(map(is_number, row[:width]))]
    if len(rows) < 2:
        raise InputError(
            f"{path.name} has no lines of {width} numbers ({', '.join(n for n, _ in wanted)}), as "
            f"a {suffix} file of RepTate has below its first line. Correct it, or give it another "
            "suffix and --format text."
        )
    values = np.array(rows, dtype=float)
    columns = {name: (unit, values[:, i]) for i, (name, unit) in enumerate(wanted)}
    block = Block.of(columns, suffix[1:])
    given = {constant.name: constant.value for constant in constants_of([[lines[0]]])}
    known = {**_PARAMETERS.get(suffix, {}), "T": _TEMPERATURE}
    constants = tuple(
        Constant(name, given[key], unit) for key, (name, unit) in known.items() if key in given
    )
    needed = [key for key in _PARAMETERS.get(suffix, {}) if key != "edot"]
    if needed and len({c.name for c in constants} - {_TEMPERATURE[0]}) == 0:
        raise InputError(
            f"{path.name} does not say its {needed[0]} on the first line, as a {suffix} file of "
            f"RepTate does. Write {needed[0]}=…; there."
        )
    # of a creep file `rec` says that the strain is the recovered one
    name = "recovery" if float(given.get("rec", 0)) else block.name
    return [Block(name, block.columns, block.cells, 2, constants)]
