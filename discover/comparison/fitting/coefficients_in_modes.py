"""What runs say of each mode, where the same coefficients in all of them explain the runs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from discover.comparison.fitting.fits_by_mode import (
    OF_THE_SPECTRUM,
    effect_of_term,
    fitted_by_mode,
    problem_by_mode,
    told_by_mode,
)
from discover.comparison.fitting.other_law_of_a_mode import OtherLaws, other_laws_of_modes
from discover.comparison.outcomes.flows import Flow
from discover.dataset import Run
from discover.identify.rivals.bands import PredictionBand
from discover.inference.by_mode.constants import ConstantByMode
from discover.inference.readings import fitted_readings
from discover.learners import RecoveredTerm
from discover.study.declared_model import DeclaredModel


@dataclass(frozen=True)
class CoefficientsInModes:
    """What the runs say of each mode where the same coefficients in all of them explain the runs.

    Attributes
    ----------
    constants
        By spelling of the term.
    bands
        Of laws whose coefficients may differ from mode to mode, by the key of the flow.
    others
        Laws of which one mode follows another, that describe the runs as well.
    """

    constants: Mapping[str, ConstantByMode]
    bands: Mapping[str, PredictionBand]
    others: OtherLaws = field(default_factory=OtherLaws)

    @property
    def differ(self) -> bool:
        """Whether evidence asks for one that differs from mode to mode."""
        return any(one.degree for one in self.constants.values())


def coefficients_in_modes(
    model: DeclaredModel,
    terms: Sequence[RecoveredTerm],
    fitted: Sequence[Run],
    flows: Sequence[Flow] = (),
) -> CoefficientsInModes | None:
    """Return what the runs say of each mode's coefficients, where equal ones explain them.

    A mode that the flow hardly stretches may have any, which the intervals of common coefficients
    take no account of. None where a term changes what the sweep tells, or cannot be fitted.

    Parameters
    ----------
    model
        The known part: two modes or more.
    terms
        Of the law that explains the runs.
    fitted
        Runs without what a known instrument did.
    flows
        In which laws with coefficients by mode predict.
    """
    if any(term.term in OF_THE_SPECTRUM or term.inner for term in terms):
        return None
    names = {effect_of_term(term.term, term.coefficient): term.term for term in terms}
    problem = problem_by_mode(model, [*names], fitted, 1)
    fit, degrees = fitted_by_mode(problem, [*names])
    if not fit.usable:
        return None
    seen = fitted_readings(problem.model, problem.batch, fitted, fit)
    constants, bands = told_by_mode(problem, fit, degrees, seen, model, flows)
    if set(constants) != set(names):
        return None
    others = OtherLaws()
    if len(names) == 1:
        ((name, constant),) = constants.items()
        told = [one.relaxation_time_s for one in constant.told if one.ci95 is not None]
        others = other_laws_of_modes(model, name, told, fitted, flows)
    bands = others.held_by(bands)
    return CoefficientsInModes({names[name]: one for name, one in constants.items()}, bands, others)
