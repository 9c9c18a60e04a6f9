"""What is recorded of a fluid in runs, on the grids of the learners that search a library."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from discover.dataset.run import Run
from discover.forward.fluids import observed_in_batch
from discover.laws.multimode import Fluid
from discover.learners.trajectories.problem import make_problem
from tensor_library.library import TermLibrary


def predict_runs(
    fluid: Fluid, library: TermLibrary, runs: Sequence[Run], strain_step: float
) -> list[Float[np.ndarray, " n"]]:
    """Return what each run records of a fluid at the times of its samples.

    The same padded layout as in the fit, so that folds share a compilation.
    """
    problem = make_problem(
        runs,
        library,
        fluid.modulus,
        fluid.relaxation_time,
        base=fluid.law,
        strain_step=strain_step,
    )
    observed = np.asarray(observed_in_batch(fluid, problem.flows))
    return [observed[i, : len(run), 0] for i, run in enumerate(runs)]
