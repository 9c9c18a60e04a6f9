"""Where a learner works: its known part, its corrected runs, and how it predicts the records."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from discover.comparison.instrument.corrected import InRecord
from discover.comparison.outcomes.flows import MEASURED, Flow, Stresses
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.identify.rivals.bands import PredictionBand
from discover.study.data import StudyData
from discover.study.declared_model import DeclaredModel


@dataclass(frozen=True)
class Frame:
    """What a learner is given, and how what it finds is seen beside the records.

    Attributes
    ----------
    model
        The known part, nothing of it left to be fitted.
    data
        The runs that it learns from, without what the instrument did.
    flows
        The flows in which its law is simulated.
    made
        What the instrument makes of the stress of a run, by its name; empty where the flows hold
        the records themselves.
    """

    model: DeclaredModel
    data: StudyData
    flows: list[Flow]
    made: Mapping[str, InRecord] = field(default_factory=dict)

    def _of(self, flow: Flow) -> InRecord | None:
        return self.made.get(flow.name) if flow.kind in MEASURED else None

    def recorded(self, flow: Flow, stresses: Stresses | None) -> Stresses | None:
        """Return what would be recorded of the stresses in a flow."""
        instrument = self._of(flow)
        if stresses is None or instrument is None:
            return stresses
        return {**stresses, "sigma12": instrument.recorded(stresses["sigma12"])}

    def outcome(self, own: LearnerOutcome) -> LearnerOutcome:
        """Return a learner's outcome with predictions of the records."""
        if not self.made:
            return own
        predictions, bands = dict(own.predictions), dict(own.bands)
        for flow in self.flows:
            instrument = self._of(flow)
            if instrument is None:
                continue
            predictions[flow.key] = self.recorded(flow, predictions[flow.key])
            limits = bands.get(flow.key)
            if limits is not None:
                both = tuple(instrument.recorded(limit) for limit in limits["sigma12"])
                bands[flow.key] = {**limits, "sigma12": (both[0], both[1])}
        return replace(own, predictions=predictions, bands=bands)

    def bands(self, own: Mapping[str, PredictionBand]) -> dict[str, PredictionBand]:
        """Return the bands of a law as bands of the records."""
        flows = {flow.key: flow for flow in self.flows}
        return {key: self._band(flows[key], band) for key, band in own.items()}

    def _band(self, flow: Flow, band: PredictionBand) -> PredictionBand:
        instrument = self._of(flow)
        if instrument is None:
            return band

        def seen(columns: np.ndarray) -> np.ndarray:
            moved = columns.copy()
            moved[:, 0] = instrument.recorded(columns[:, 0])
            return moved

        directions = band.directions
        return replace(
            band,
            chosen=seen(band.chosen),
            low=seen(band.low),
            high=seen(band.high),
            rivals_low=seen(band.rivals_low),
            rivals_high=seen(band.rivals_high),
            directions=None if directions is None else instrument.gain * directions,
        )
