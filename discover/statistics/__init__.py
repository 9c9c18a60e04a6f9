"""What residuals say of noise, and noise of parameters."""

from discover.statistics.lack_of_fit import FitVerdict, LackOfFit, lack_of_fit
from discover.statistics.noise.covariance import HALF_BAND, least_squares_covariance, root_of
from discover.statistics.noise.dead_records import holds_signal
from discover.statistics.noise.independent_samples import independent_samples
from discover.statistics.noise.noise_model import NoiseModel, noise_model

__all__ = [
    "HALF_BAND",
    "FitVerdict",
    "LackOfFit",
    "NoiseModel",
    "holds_signal",
    "independent_samples",
    "lack_of_fit",
    "least_squares_covariance",
    "noise_model",
    "root_of",
]
