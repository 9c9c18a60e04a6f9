"""What every learner does with runs once it has a fluid: predict them, and be scored on them."""

from abc import abstractmethod
from collections.abc import Iterable
from typing import Any

import numpy as np
from jaxtyping import Float

from discover.dataset.run import ShearRun
from discover.errors import InputError


def as_runs(runs: Iterable[Any]) -> list[ShearRun]:
    """Return the runs as a list, having checked that they are runs.

    Raises
    ------
    InputError
        If there is none, or one is something else.
    """
    listed = list(runs)
    if not listed:
        raise InputError("A learner needs at least one run; got none.")
    for run in listed:
        if not isinstance(run, ShearRun):
            raise InputError(
                f"A learner takes a sequence of ShearRun; got a {type(run).__name__}. Load a "
                "folder or make a synthetic data set."
            )
    return listed


class RunPrediction:
    """Prediction and score by run, for an estimator that knows how to simulate runs."""

    def predict(self, X: Iterable[Any]) -> Float[np.ndarray, " rows"]:
        """Return σ12 in Pa at the samples of all runs, one run after the other."""
        return np.concatenate(self._predict_runs(as_runs(X)))

    def score(self, X: Iterable[Any], y=None, sample_weight=None) -> float:
        """Return one minus the relative error of σ12, averaged over runs.

        The error of a run is the root-mean-square of prediction minus measurement over the
        root-mean-square of the measurement. A law that runs away scores minus infinity.
        """
        del y, sample_weight
        runs = as_runs(X)
        errors = [
            np.sqrt(np.mean((p - run.shear_stress) ** 2) / np.mean(run.shear_stress**2))
            for p, run in zip(self._predict_runs(runs), runs, strict=True)
        ]
        error = float(np.mean(errors))
        return 1.0 - error if np.isfinite(error) else -np.inf

    @abstractmethod
    def _predict_runs(self, runs: list[ShearRun]) -> list[Float[np.ndarray, " n"]]:
        """Return σ12 in Pa of each run."""
