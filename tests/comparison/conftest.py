"""What the tests of comparisons share."""

import sys
from pathlib import Path

import pytest

# data behind an instrument, made by scipy
sys.path.append(str(Path(__file__).parent))


@pytest.fixture(scope="module")
def optimised():
    """Optimise the programs of models: these tests call each some thousand times."""
    from discover.forward import program
    from discover.programs import compiled

    def slower_to_compile(function, **options):
        made = compiled(function, **options)
        made.ask_for(xla_backend_optimization_level=1)
        return made

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(program, "compiled", slower_to_compile)
        yield
