"""Laws as they leave this package: SymPy, LaTeX, JSON, Python, UFL, rheoTool; and back."""

from discover.equations.augmented_law import AugmentedLaw
from discover.equations.equation import Box, Equation, Tested
from discover.equations.formats.json_format import equation_from_json, equation_to_json
from discover.equations.formats.rheotool_reader import read_rheotool
from discover.equations.from_law import combined, effect_terms, law_terms
from discover.equations.has_equation import HasEquation
from discover.equations.named_part import NamedPart
from discover.equations.parts import law_parts
from discover.equations.state_part import StatePart
from discover.equations.write import FORMATS, write_equation

__all__ = [
    "FORMATS",
    "AugmentedLaw",
    "Box",
    "Equation",
    "HasEquation",
    "NamedPart",
    "StatePart",
    "Tested",
    "combined",
    "effect_terms",
    "equation_from_json",
    "equation_to_json",
    "law_parts",
    "law_terms",
    "read_rheotool",
    "write_equation",
]
