"""Data sets: runs, loading, checking, linear viscoelasticity."""

from discover.dataset.run import LinearSweep, ShearDataset, ShearRun

__all__ = ["LinearSweep", "ShearDataset", "ShearRun"]
