"""What a rheometer records: a fluid with its effects, in any flow, seen by an instrument.

`AugmentedModel` predicts the records of runs from one vector of parameters: constants of the
declared law, then those of every candidate effect. At zero amplitude an effect changes nothing.
"""

from discover.forward.augmented_model import AugmentedModel, data_scales
from discover.forward.declared import MODULUS, RELAXATION_TIME, DeclaredModel, FreeParameter
from discover.forward.flows import Batch, TransientFlows, make_batch

__all__ = [
    "MODULUS",
    "RELAXATION_TIME",
    "AugmentedModel",
    "Batch",
    "DeclaredModel",
    "FreeParameter",
    "TransientFlows",
    "data_scales",
    "make_batch",
]
