"""Classes of experiments that could be run next."""

from typing import Literal, get_args

FlowClass = Literal[
    "laos",
    "start_up",
    "cessation",
    "steps",
    "superposed",
    "step_strain",
    "flow_curve",
    "creep",
    "uniaxial",
    "planar",
    "biaxial",
]
FLOW_CLASSES: tuple[FlowClass, ...] = get_args(FlowClass)
