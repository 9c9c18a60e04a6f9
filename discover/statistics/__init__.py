"""What residuals say of noise, and noise of parameters."""

from discover.statistics.noise_model import HALF_BAND, independent_samples, root_of

__all__ = ["HALF_BAND", "independent_samples", "root_of"]
