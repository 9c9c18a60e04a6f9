"""What residuals say of noise, and noise of parameters."""

from discover.statistics.covariance import least_squares_covariance
from discover.statistics.independent_samples import independent_samples
from discover.statistics.noise_model import NoiseModel, noise_model

__all__ = ["NoiseModel", "independent_samples", "least_squares_covariance", "noise_model"]
