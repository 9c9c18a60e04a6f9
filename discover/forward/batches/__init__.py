"""Runs laid out once on the host: padded, and of each control all in one program."""

from discover.forward.batches.batch import Batch, Flows, make_batch
from discover.forward.batches.imposed_stress import StressFlows
from discover.forward.batches.loadings import Loadings, names_of_loadings
from discover.forward.batches.records import OBSERVED, Records, data_scales, even, make_records
from discover.forward.batches.states import PeriodicFlows, Places, SteadyFlows
from discover.forward.batches.transient import TransientFlows

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
