"""What a complete law may leave of a study's runs: noise, the sweep's own error, repeats."""

from discover.dataset.records.repeats import Repeats
from discover.statistics.residual import Expectation
from discover.study.declared_model import DeclaredModel
from discover.study.schema import Study


def expectation_of(
    study: Study, model: DeclaredModel, repeats: Repeats | None = None
) -> Expectation:
    """Return what a complete law may leave of a study's runs, as the closed loop has it.

    What repeated runs differ by is counted where nobody told the noise.
    """
    linear_error = 0.0 if model.spectrum is None else model.spectrum.relative_error
    noise = study.loop.noise
    told = 0.0 if repeats is None or noise is not None else repeats.error
    return Expectation(noise, linear_error, told)
