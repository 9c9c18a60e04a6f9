"""What an import needs to know: which column is what, in which unit, on which geometry."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, model_validator

from discover.dataset.importing.quantities import QUANTITIES
from discover.dataset.tables.table import read_toml, toml_string
from discover.dataset.tables.units import ABSOLUTE_ZERO
from discover.validation import Section, one_of, validated

MAPPING_FILE = "import.toml"

QuantityName = Annotated[str, AfterValidator(one_of("quantity", lambda: QUANTITIES))]

TestName = Literal[
    "frequency_sweep", "amplitude_sweep", "flow_curve", "relaxation", "creep", "run", "none"
]
"""What a block may be taken for: ``run`` is a record in time at a given rate, ``none`` nothing."""

EVERY_BLOCK = "*"

Celsius = Annotated[float, Field(ge=ABSOLUTE_ZERO, le=2000)]  # a temperature that can be


class Geometry(Section):
    """The tool, needed where the file holds torque, angle or force.

    Cone and plate: σ12 = 3M/(2πR³), γ = θ/β, N1 = 2F/(πR²). Plates: σ12 = 2M/(πR³), the apparent
    one, γ = θR/h at the rim [Macosko 1994, Rheology, ch. 5]; the force gives N1 − N2 and is not
    read.
    """

    type: Literal["cone_plate", "plate_plate"]
    # tools are made from 2 mm to 50 mm, cones from 0.3°, gaps from some µm; the bounds are wider
    radius_mm: Annotated[float, Field(ge=0.01, le=1000)]
    angle_deg: Annotated[float, Field(ge=0.001, le=10)] | None = None
    gap_mm: Annotated[float, Field(ge=1e-4, le=100)] | None = None

    @model_validator(mode="after")
    def _complete(self):
        needed = "angle_deg" if self.type == "cone_plate" else "gap_mm"
        if getattr(self, needed) is None:
            raise ValueError(f"{self.type} needs {needed}")
        return self

    def per_signal(self, key: str) -> float | None:
        """Return σ12/M in Pa/(N m), γ/θ or γ̇/Ω, or N1/F in Pa/N; None where F does not give N1."""
        is_cone, radius = self.type == "cone_plate", self.radius_mm * 1e-3
        if key == "stress":
            return (1.5 if is_cone else 2.0) / (math.pi * radius**3)
        if key == "N1":
            return 2.0 / (math.pi * radius**2) if is_cone else None
        if self.angle_deg is not None and is_cone:
            return 1.0 / math.radians(self.angle_deg)
        return self.radius_mm / (self.gap_mm or math.nan)


class Layout(Section):
    """How the text is laid out, or which importer reads it; what is left out is found."""

    format: str | None = None
    delimiter: Literal["tab", "semicolon", "comma", "space"] | None = None
    decimal: Literal[".", ","] | None = None
    header_row: Annotated[int, Field(ge=1)] | None = None
    encoding: str | None = None


class Source(Section):
    """A file that was imported, with its hash."""

    file: str
    sha256: str | None = None


class Mapping(Section):
    """Everything that decides an import; `tests` and `temperatures` (°C) by file and block."""

    columns: dict[QuantityName, str] = Field(default_factory=dict)
    units: dict[QuantityName, str] = Field(default_factory=dict)
    layout: Layout = Layout()
    geometry: Geometry | None = None
    start_time_s: float = 0.0
    temperature_C: Celsius | None = None
    temperatures: dict[str, Celsius] = Field(default_factory=dict)
    blocks: Annotated[tuple[Annotated[int, Field(ge=1)], ...], Field(min_length=1)] | None = None
    source: tuple[Source, ...] = ()
    tests: dict[str, TestName] = Field(default_factory=dict)

    def test_of(self, file: str, block: int) -> TestName | None:
        """Return what the user says that a block of a file, from 1, is; None if nothing."""
        keys = f"{file}:{block}", file, EVERY_BLOCK
        return next((self.tests[key] for key in keys if key in self.tests), None)

    def of_block(self, file: str, block: int) -> "Mapping":
        """Return what holds for a block of a file, its temperature being that of the file."""
        degrees = self.temperatures.get(f"{file}:{block}")
        of_file = {} if degrees is None else {"temperatures": {file: degrees}}
        return self.model_copy(update=of_file)


def make_mapping(content: dict, where: str) -> Mapping:
    """Return a mapping from nested dictionaries; InputError names a key or value that is wrong."""
    return validated(Mapping, content, where)


def read_mapping(path: Path) -> Mapping:
    """Return the mapping in a TOML file; InputError says what is wrong with it."""
    content, _ = read_toml(path, "mapping file", f"Write it like the {MAPPING_FILE} of an import.")
    return make_mapping(content, path.name)


def write_mapping(mapping: Mapping) -> str:
    """Return a mapping as TOML."""
    content = mapping.model_dump(exclude_defaults=True, exclude_none=True)
    sources = [("[source]", source) for source in content.pop("source", ())]
    sections = [(name, content.pop(name)) for name in list(content)
                if isinstance(content[name], dict)]  # fmt: skip
    lines = ["# How this folder was imported. Repeat it with"]
    lines += [f"#   discover data import --mapping {MAPPING_FILE} --out FOLDER", *_lines(content)]
    for name, section in (*sections, *sources):
        lines += ["", f"[{name}]", *_lines(section)]
    return "\n".join(lines) + "\n"


def _lines(content: dict[str, Any]) -> Iterator[str]:
    for name, value in content.items():
        key = name if name.isidentifier() and name.isascii() else toml_string(name)
        value = list(value) if isinstance(value, tuple) else value
        yield f"{key} = {toml_string(value) if isinstance(value, str) else repr(value)}"
