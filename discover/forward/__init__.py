"""What a rheometer records: a fluid with its effects, in any flow, seen by an instrument.

`AugmentedModel` predicts the records of runs from one vector of parameters: constants of the
declared law, then those of every candidate effect. At zero amplitude an effect changes nothing.
"""

from discover.forward.augmented_model import AugmentedModel
from discover.forward.batches import (
    Batch,
    RunBatch,
    as_loaded,
    as_predicted,
    data_scales,
    deviation_of_loadings,
    even,
    loadings_of,
    make_batch,
    relative_noise,
    share_of_factor,
)
from discover.forward.declared import MODULUS, RELAXATION_TIME, DeclaredModel, FreeParameter

__all__ = [
    "MODULUS",
    "RELAXATION_TIME",
    "AugmentedModel",
    "Batch",
    "DeclaredModel",
    "FreeParameter",
    "RunBatch",
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
