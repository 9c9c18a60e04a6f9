"""Runs laid out once on the host: padded, and of each control all in one program."""

from discover.forward.batches.flows import (
    Batch,
    Flows,
    PeriodicFlows,
    Places,
    SteadyFlows,
    StressFlows,
    TransientFlows,
    make_batch,
)
from discover.forward.batches.records import (
    OBSERVED,
    Loadings,
    Records,
    data_scales,
    even,
    make_records,
    names_of_loadings,
)

__all__ = [
    "OBSERVED",
    "Batch",
    "Flows",
    "Loadings",
    "PeriodicFlows",
    "Places",
    "Records",
    "SteadyFlows",
    "StressFlows",
    "TransientFlows",
    "data_scales",
    "even",
    "make_batch",
    "make_records",
    "names_of_loadings",
]
