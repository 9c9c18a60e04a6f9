"""Protocols: the rate of deformation in time, the flow that has it, and what came before.

Examples
--------
>>> import jax.numpy as jnp
>>> import numpy as np
>>> steps = step_rates([0.0, 10.0], [0.1, 1.0])
>>> [float(one.rate(jnp.asarray(12.0))) for one in (start_up(0.5), steps)]
[0.5, 1.0]
>>> stopped = after_steady_flow(start_up(0.0), 5.0, end=60.0)
>>> relaxation = after_step_strain(start_up(0.0), 2.0, first=0.01)
>>> times = np.linspace(0.0, 4 * np.pi, 201)
>>> wave = sampled_rate(times, np.cos(times))
>>> begun = after_alternation(wave, 2 * np.pi, times)
>>> [bool(one.begins < 0) for one in (stopped, relaxation, wave, begun)]
[True, True, False, True]
"""

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
