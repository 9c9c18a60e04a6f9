"""From a fluid and a protocol to stresses, to a tolerance, and to data sets made of them.

Examples
--------
>>> import numpy as np, discover as dc
>>> fluid = dc.Fluid(dc.make_law("ucm"), 1.0, 1.0)
>>> stress = dc.simulate(fluid, dc.start_up(1.0), np.array([1.0, 10.0]))
>>> print(np.round(stress.components[:, 3], 3))
[0.632 1.   ]
"""

from discover.first_use import answer_calls  # first: it sets double precision
from discover.simulate.solve import SimulationError, observe, simulate
from discover.simulate.synthetic import synthetic_dataset

__all__ = ["SimulationError", "observe", "simulate", "synthetic_dataset"]

answer_calls(__name__, simulate)
