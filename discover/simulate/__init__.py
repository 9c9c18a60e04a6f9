"""From a fluid and a protocol to stresses."""

from discover import first_use as first_use  # what it sets for equinox counts only before diffrax
from discover.simulate.exponential_runge_kutta import ExponentialRungeKutta4
from discover.simulate.flow_batch import FlowBatch, lay_out
from discover.simulate.grid import IntegrationGrid, make_grid, make_grids
from discover.simulate.solve import (
    ShearStress,
    SimulationError,
    simulate,
    simulate_homogeneous_flow,
    solve_batch,
    solve_on_grid,
    solve_states_on_grid,
)
from discover.simulate.synthetic import SyntheticDataset, synthetic_dataset

__all__ = [
    "ExponentialRungeKutta4",
    "FlowBatch",
    "IntegrationGrid",
    "ShearStress",
    "SimulationError",
    "SyntheticDataset",
    "lay_out",
    "make_grid",
    "make_grids",
    "simulate",
    "simulate_homogeneous_flow",
    "solve_batch",
    "solve_on_grid",
    "solve_states_on_grid",
    "synthetic_dataset",
]
