"""The known part of a comparison: what is known before, and what is fitted along."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from discover.comparison.fitting.training import require_numbers
from discover.comparison.instrument import (
    FittedAlong,
    Frame,
    absorbed,
    corrected,
    fixed_with_the_law,
)
from discover.comparison.outcomes.flows import MEASURED, Flow, Stresses, comparison_flows, predict
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.dataset import Dataset
from discover.effects import KnownEffect
from discover.study.data import StudyData
from discover.study.declared_model import MODE_CONSTANTS, DeclaredModel
from tensor_library.library import TermLibrary


@dataclass(frozen=True)
class Known:
    """What is known before a learner looks at the data.

    Attributes
    ----------
    before
        Where the known part alone is simulated, its constants fitted with it alone.
    along
        What is fitted along with each learner; None where nothing is.
    flows
        The flows of the page. Where nothing is fitted along, records without what the known
        instrument did; else the records themselves.
    effects
        Of the instrument.
    high_deborah, pipkin
        As in `comparison_flows`.
    fitted
        Names of the constants of the declared law and of its modes that were to be fitted.
    """

    before: Frame
    along: FittedAlong | None
    flows: list[Flow]
    effects: tuple[KnownEffect, ...] = ()
    high_deborah: tuple[float, ...] = ()
    pipkin: Sequence[tuple[float, float]] = ()
    fitted: tuple[str, ...] = ()

    def frame(self, outcome: LearnerOutcome) -> Frame:
        """Return where a learner worked, by the constants that it ended with."""
        if self.along is None:
            return self.before
        return self.frame_of({one.name: one.raw for one in outcome.constants.values()})

    def frame_of(self, raw: Mapping[str, float]) -> Frame:
        """Return where a law with these constants is simulated."""
        assert self.along is not None
        model, data, made = self.along.corrected(raw)
        flows = corrected_flows(self.along.data, data, self.high_deborah, self.pipkin)
        return Frame(model, data, flows, made)

    def alone(self) -> dict[str, Stresses | None]:
        """Return what the known part alone predicts, by the key of the flow."""
        fluid = self.before.model.fluid
        return {
            flow.key: self.before.recorded(flow, predict(fluid, flow)) for flow in self.before.flows
        }


def known_part(
    declared: DeclaredModel,
    data: StudyData,
    library: TermLibrary,
    high_deborah: tuple[float, ...],
    pipkin: Sequence[tuple[float, float]],
    fit_constants: Callable[[DeclaredModel, Dataset], DeclaredModel] | None = None,
) -> Known:
    """Return what is known in a comparison.

    Parameters
    ----------
    declared, data, library
        The declared model, the data as recorded, the study's candidate terms.
    high_deborah, pipkin
        As in `comparison_flows`.
    fit_constants
        Fits constants of the declared law, where only these are to be fitted.

    Raises
    ------
    InputError
        If something of it cannot be known in a comparison.
    """
    beyond_law = [name for name in declared.free if name in MODE_CONSTANTS]
    if not declared.effects and not beyond_law:
        model = declared if fit_constants is None else fit_constants(declared, data.fit)
        require_numbers(model)
        flows = comparison_flows(data, high_deborah, pipkin)
        return Known(Frame(model, data, flows), None, flows, fitted=declared.free)
    model = absorbed(fixed_with_the_law(declared, data.fit.runs))
    effects = model.effects
    if model.free_constants:
        along = FittedAlong(model, data, library)
        known = Known(
            Frame(model, data, []),
            along,
            comparison_flows(data, high_deborah, pipkin),
            effects,
            high_deborah,
            pipkin,
            declared.free,
        )
        return replace(known, before=known.frame_of(along.constants.raw(along.before.alone.theta)))
    free_of_it, _ = corrected(data, effects)
    flows = corrected_flows(data, free_of_it, high_deborah, pipkin)
    frame = Frame(replace(model, effects=()), free_of_it, flows)
    return Known(frame, None, flows, effects, fitted=declared.free)


def corrected_flows(
    data: StudyData,
    free_of_it: StudyData,
    high_deborah: tuple[float, ...],
    pipkin: Sequence[tuple[float, float]],
) -> list[Flow]:
    """Return the flows of corrected data, which keep the titles of what was commanded."""
    commanded = {run.name: run.protocol for run in data.dataset}
    flows = comparison_flows(free_of_it, high_deborah, pipkin)
    return [
        replace(flow, commanded=commanded[flow.name]) if flow.kind in MEASURED else flow
        for flow in flows
    ]
