"""Files of RepTate: parameters on the first line, then columns that their suffix names.

The suffix says what the columns are, whatever the file writes above them: RepTate 1.3 divides the
second column of ``.shear`` and ``.uext`` by the rate to show a viscosity, so it is a stress even
where it is headed "h" or "Pa-s"   [Boudara, Read & Ramírez 2020, J. Rheol. 64, 709].
"""

import re
from pathlib import Path

from discover.dataset.importing.header_constants import Constant, constants_of, name_and_unit
from discover.dataset.importing.text_export import Block
from discover.dataset.importing.text_rows import LARGEST_EXPORT, is_number
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
"""Names and units of the columns, by suffix; further ones are read by their own names."""

_PARAMETERS = {
    ".shear": {"gdot": ("shear rate", "1/s")},
    ".uext": {"gdot": ("hencky rate", "1/s"), "edot": ("hencky rate", "1/s")},
    ".creep": {"stress": ("stress", "Pa")},
}
_TEMPERATURE = ("temperature", "°C")


def read_reptate(path: Path) -> list[Block]:
    """Return the one block of a file of RepTate.

    Raises InputError if it has too few columns of numbers, or lacks a parameter that such a file
    needs.
    """
    suffix = path.suffix.lower()
    content = read_bytes(path, path.name, largest=LARGEST_EXPORT)
    lines = re.split(r"\r\n|\r|\n", content.decode("cp1252", "replace"))
    table = [line.lstrip("#").replace(",", " ").split() for line in lines]
    wanted = COLUMNS[suffix]
    width = len(wanted)
    data = [i for i, row in enumerate(table) if len(row) >= width and all(map(is_number, row))]
    if len(data) < 2:
        raise InputError(
            f"{path.name} has no lines of {width} numbers ({', '.join(n for n, _ in wanted)}), as "
            f"a {suffix} file of RepTate has below its first line. Correct it, or give it another "
            "suffix and --format text."
        )
    whole = max(len(table[i]) for i in data)
    # a file may hold more columns than its suffix names, under names of their own
    named = [row for row in table[1 : data[0]] if len(row) == whole]
    further = [name_and_unit(name, "") for name in named[0][width:]] if named else []
    further += [(f"column {i + 1}", "") for i in range(width + len(further), whole)]
    if len(named) > 1:
        further = [(name, unit or below) for (name, unit), below in zip(
            further, named[1][width:], strict=True)]  # fmt: skip
    cells = tuple(tuple((table[i] + [""] * whole)[:whole]) for i in data)
    first = [] if data[0] == 0 else [[lines[0]]]
    given = {constant.name: constant.value for constant in constants_of(first)}
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
    name = "recovery" if float(given.get("rec", 0)) else suffix[1:]
    return [Block(name, (*wanted, *further), cells, data[0] + 1, constants)]
