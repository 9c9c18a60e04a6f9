"""Bands of prediction: what the uncertainty of the parameters, and of the law, leaves open."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from discover.identify.side_by_side.many_laws import Contender, draws, fluid_of, predict_laws
from discover.laws.multimode import Fluid
from discover.protocols.protocol import FlowProtocol

QUANTITIES = ("sigma12", "N1", "N2")

_PERCENTILES = (2.5, 97.5)
_MOST_LOST = 0.05


@dataclass(frozen=True)
class PredictionBand:
    """What is to be expected in one flow.

    Attributes
    ----------
    times
        In s, shape (n,).
    chosen
        Of the chosen law, shape (n, 3): σ12, N1, N2 in Pa.
    low, high
        95 % band of the chosen law's parameters, shape (n, 3).
    rivals_low, rivals_high
        The same with every rival's band around it: what the data leave open altogether.
    runaways
        Fraction of the draws that could not be integrated.
    reason
        Why there is no band, that is why the limits are nan; empty where there is one.
    directions
        Changes of the chosen law's σ12 in Pa whose squares add up to its variance, shape
        (draws, n); None without a band.
    """

    times: Float[np.ndarray, " n"]
    chosen: Float[np.ndarray, "n 3"]
    low: Float[np.ndarray, "n 3"]
    high: Float[np.ndarray, "n 3"]
    rivals_low: Float[np.ndarray, "n 3"]
    rivals_high: Float[np.ndarray, "n 3"]
    runaways: float
    reason: str = ""
    directions: Float[np.ndarray, "draws n"] | None = None

    def ends_with(
        self, low: Float[np.ndarray, "n 3"], high: Float[np.ndarray, "n 3"], half: np.ndarray
    ) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"]]:
        """Return ends of a band about the chosen law that is off by another half-width too.

        The two are independent. What is not a number stays so: no band stays no band.
        """
        below = self.chosen - np.hypot(self.chosen - low, half)
        return below, self.chosen + np.hypot(high - self.chosen, half)

    def widths(self, with_rivals: bool = True) -> dict[str, float]:
        """Return the root-mean-square width of each band over that of the chosen prediction.

        N2's is relative to N1, as its error is.
        """
        low = self.rivals_low if with_rivals else self.low
        high = self.rivals_high if with_rivals else self.high
        width = np.sqrt(np.mean((high - low) ** 2, axis=0))
        size = np.sqrt(np.mean(self.chosen**2, axis=0))
        size[2] = size[1]
        return {
            quantity: float(w / s) if s > 0 else 0.0
            for quantity, w, s in zip(QUANTITIES, width, size, strict=True)
        }

    def to_json(self) -> dict[str, Any]:
        """Return the band's relative widths, with and without rivals."""
        return {
            "relative_width": self.widths(with_rivals=False),
            "relative_width_with_rivals": self.widths(),
            "runaways": self.runaways,
            "reason": self.reason,
        }


def prediction_bands(
    chosen: Contender,
    rivals: Sequence[Contender],
    declared: Fluid,
    protocols: Sequence[FlowProtocol],
    times: Sequence[Float[np.ndarray, " _"]],
    n_draws: int = 100,
    seed: int = 0,
) -> list[PredictionBand]:
    """Return the band of every flow, in one simulation of all draws of all laws.

    Parameters
    ----------
    chosen, rivals
        The laws, with the covariance of their parameters.
    declared
        The known part that they share.
    protocols, times
        The flows and their sampling times.
    n_draws
        Draws of each law's parameters.
    """
    rng = np.random.default_rng(seed)
    amounts = np.append(np.asarray(declared.modulus), float(declared.solvent_viscosity))
    drawn = [draws(law, n_draws, rng, amounts) for law in (chosen, *rivals)]
    flat = [law for group in drawn for law in group]
    predicted = predict_laws(fluid_of(flat, declared), protocols, times)
    sizes = [len(group) for group in drawn]
    return bands_of_predictions(predicted, sizes, times, chosen.without_band)


def bands_of_predictions(
    predicted: Float[np.ndarray, "laws flows n 3"],
    group_sizes: Sequence[int],
    times: Sequence[Float[np.ndarray, " _"]],
    without_band: str = "",
) -> list[PredictionBand]:
    """Return the band of every flow from predictions in groups, the chosen law's first.

    A law of whose draws more run away in a flow than a 95 % band leaves out has no band there.

    Serves draws of parameters and members of an ensemble alike. A group of one has no width.

    Parameters
    ----------
    predicted
        Predictions; the first of each group is the law itself, later ones are its draws.
    group_sizes
        How many predictions each law has.
    times
        Sampling times of every flow.
    without_band
        Why the chosen law has no band in any flow, if so.
    """
    finite = np.all(np.isfinite(predicted), axis=(2, 3))
    edges = np.cumsum([0, *group_sizes])
    bands = []
    for flow, sampling in enumerate(times):
        n = len(sampling)
        low, high, reason = [], [], without_band
        for start, stop in itertools.pairwise(edges):
            usable = predicted[start:stop, flow, :n][finite[start:stop, flow]]
            lost = 1.0 - len(usable) / (stop - start)
            if lost > _MOST_LOST and finite[start, flow]:
                reason = reason or f"{100 * lost:.0f} % of the laws that fit run away in this flow"
            if len(usable):
                limits = np.percentile(usable, _PERCENTILES, axis=0, method="median_unbiased")
                low.append(limits[0])
                high.append(limits[1])
        if not finite[0, flow]:
            nothing = np.full((n, 3), np.nan)
            reason = reason or "the law itself runs away in this flow"
            bands.append(PredictionBand(sampling, *([nothing] * 5), runaways=1.0, reason=reason))
            continue
        if reason:
            low, high = [np.full((n, 3), np.nan)], [np.full((n, 3), np.nan)]
        drawn = predicted[1 : edges[1], flow, :n, 0][finite[1 : edges[1], flow]]
        directions = (drawn - predicted[0, flow, :n, 0]) / np.sqrt(max(len(drawn), 1))
        bands.append(
            PredictionBand(
                times=sampling,
                chosen=predicted[0, flow, :n],
                low=low[0],
                high=high[0],
                rivals_low=np.min(low, axis=0),
                rivals_high=np.max(high, axis=0),
                runaways=1.0 - float(np.mean(finite[:, flow])),
                reason=reason,
                directions=None if reason or not len(drawn) else directions,
            )
        )
    return bands
