"""Data sets: runs, loading, checking, linear viscoelasticity."""

from discover.dataset.checking.folder import check_folder
from discover.dataset.checking.runs import Finding, Findings
from discover.dataset.dataset import Dataset
from discover.dataset.linear_viscoelasticity import (
    LinearSweep,
    RelaxationSpectrum,
    relaxation_spectrum,
)
from discover.dataset.load import from_dataframe, load_dataset
from discover.dataset.run import Run

__all__ = [
    "Dataset", "Finding", "Findings", "LinearSweep", "RelaxationSpectrum", "Run", "check_folder",
    "from_dataframe", "load_dataset", "relaxation_spectrum",
]  # fmt: skip
