"""Protocols: the rate of deformation in time, the flow that has it, and what came before."""

from discover import first_use as first_use  # double precision, before any array is made
from discover.protocols.between_samples import another_between_samples, sampled_rate
from discover.protocols.control import imposed_stress, oscillations, steady_rates
from discover.protocols.history import (
    after_alternation,
    after_steady_flow,
    after_step_strain,
    settled,
)
from discover.protocols.kinematics import kinematics_of
from discover.protocols.protocol import (
    FlowProtocol,
    in_flow,
    measured_rate,
    oscillatory_shear,
    paper_test_protocols,
    paper_training_protocols,
    recorded_at,
    shear_rates,
    stack_protocols,
    start_up,
    step_rates,
    strains,
)

__all__ = [
    "FlowProtocol", "after_alternation", "after_steady_flow", "after_step_strain",
    "another_between_samples", "imposed_stress", "in_flow", "kinematics_of", "measured_rate",
    "oscillations", "oscillatory_shear", "paper_test_protocols", "paper_training_protocols",
    "recorded_at", "sampled_rate", "settled", "shear_rates", "stack_protocols", "start_up",
    "steady_rates", "step_rates", "strains",
]  # fmt: skip
