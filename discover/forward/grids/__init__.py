"""Where runs are stepped and sampled: fixed grids, made once on the host."""

from discover.forward.grids.flow_batch import lay_out
from discover.forward.grids.grid import make_grid, make_grids

__all__ = ["lay_out", "make_grid", "make_grids"]
