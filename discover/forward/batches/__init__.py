"""Runs laid out once on the host: padded, and of each control all in one program."""

from discover.forward.batches.imposed_stress import StressBatch
from discover.forward.batches.loadings import relative_noise, share_of_factor
from discover.forward.batches.mixed import (
    Batch,
    MixedBatch,
    Part,
    as_loaded,
    as_predicted,
    deviation_of_loadings,
    loadings_of,
    make_batch,
)
from discover.forward.batches.oscillation import OscillationBatch, Places
from discover.forward.batches.samples import even
from discover.forward.batches.scales import data_scales
from discover.forward.batches.steady import SteadyBatch
from discover.forward.batches.transient import RunBatch

__all__ = [
    "Batch",
    "MixedBatch",
    "OscillationBatch",
    "Part",
    "Places",
    "RunBatch",
    "SteadyBatch",
    "StressBatch",
    "as_loaded",
    "as_predicted",
    "data_scales",
    "deviation_of_loadings",
    "even",
    "loadings_of",
    "make_batch",
    "relative_noise",
    "share_of_factor",
]
