"""What residuals say of noise, and noise of parameters."""

from discover.statistics.lack_of_fit import FitVerdict, LackOfFit, lack_of_fit
from discover.statistics.noise.noise_model import HALF_BAND, independent_samples, root_of

__all__ = [
    "HALF_BAND", "FitVerdict", "LackOfFit", "independent_samples", "lack_of_fit", "root_of",
]  # fmt: skip
