"""What is compiled is kept, solvers included."""

import subprocess
import sys

SIMULATE = """
import sys
from discover.compilation_cache import enable_compilation_cache
enable_compilation_cache(sys.argv[1])
import numpy as np
from discover.laws import Fluid, Giesekus
from discover.protocols import start_up
from discover.simulate import simulate
simulate(Fluid(Giesekus(0.3), np.ones(1), np.ones(1)), start_up(2.0), np.linspace(0.1, 3.0, 7))
"""


def test_a_program_with_a_solver_in_it_is_kept(tmp_path):
    # a check that calls back to Python would make it one that cannot be
    subprocess.run([sys.executable, "-c", SIMULATE, str(tmp_path)], check=True, timeout=300)
    assert any("_solve_adaptively" in path.name for path in tmp_path.iterdir())
