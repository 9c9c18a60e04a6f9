"""Laws as they leave this package: SymPy, LaTeX, JSON, Python, UFL, rheoTool."""

from discover.equations.equation import Box, Equation, HasEquation, Tested
from discover.equations.files import (
    FORMATS,
    equation_from_json,
    equation_to_json,
    read_result_laws,
    write_equation,
)
from discover.equations.parts import (
    AugmentedLaw,
    NamedPart,
    StatePart,
    combined,
    effect_terms,
    law_parts,
    law_parts_by_mode,
    law_terms,
)

__all__ = [
    "FORMATS", "AugmentedLaw", "Box", "Equation", "HasEquation", "NamedPart", "StatePart", "Tested",
    "combined", "effect_terms", "equation_from_json", "equation_to_json", "law_parts",
    "law_parts_by_mode", "law_terms", "read_result_laws", "write_equation",
]  # fmt: skip
