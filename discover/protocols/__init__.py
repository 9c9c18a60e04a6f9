"""Shear protocols."""

from discover import first_use as first_use  # double precision, before any array is made
from discover.protocols.paper import paper_test_protocols, paper_training_protocols
from discover.protocols.shear import (
    ShearProtocol,
    measured_rate,
    oscillatory_shear,
    shear_rates,
    smooth_between_samples,
    stack_protocols,
    start_up,
    step_rates,
    strains,
)

__all__ = [
    "ShearProtocol",
    "measured_rate",
    "oscillatory_shear",
    "paper_test_protocols",
    "paper_training_protocols",
    "shear_rates",
    "smooth_between_samples",
    "stack_protocols",
    "start_up",
    "step_rates",
    "strains",
]
