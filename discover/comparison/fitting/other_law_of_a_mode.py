"""What laws of which one mode follows another leave open in a comparison."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float

from discover.comparison.fitting.fits_by_mode import problem_by_mode
from discover.comparison.fitting.stresses_by_mode import bands_by_mode
from discover.comparison.outcomes.flows import Flow
from discover.dataset import Run
from discover.effects import ConstitutiveEffect
from discover.forward import AugmentedModel
from discover.identify.rivals.bands import PredictionBand
from discover.inference.by_mode.degrees import Degree
from discover.inference.by_mode.draws import ConstantsDrawn
from discover.inference.by_mode.other_law_of_a_mode import ONE_CONSTANT, laws_as_good
from discover.inference.by_mode.varying_constant import varying_constants
from discover.inference.least_squares import Fit
from discover.inference.problem import FitProblem, effect_of
from discover.study.declared_model import DeclaredModel


@dataclass(frozen=True)
class OtherLaws:
    """Laws of which one mode follows another than all others.

    Attributes
    ----------
    names
        Of the effects that it may follow, by the relaxation time of the mode in s.
    moved
        By how much they change σ12, N1 and N2, one row for each law, by the key of the flow.
    """

    names: Mapping[float, tuple[str, ...]] = field(default_factory=dict)
    moved: Mapping[str, Float[np.ndarray, "laws n 3"]] = field(default_factory=dict)

    def held_by(self, bands: Mapping[str, PredictionBand]) -> dict[str, PredictionBand]:
        """Return bands that hold these laws too, each as uncertain as the one law of all modes."""
        found = dict(bands)
        for key, band in bands.items():
            moved = self.moved.get(key)
            if moved is not None and len(moved):
                low = np.min(band.rivals_low + np.minimum(moved, 0.0), axis=0)
                high = np.max(band.rivals_high + np.maximum(moved, 0.0), axis=0)
                found[key] = replace(band, rivals_low=low, rivals_high=high)
        return found


def other_laws_of_modes(
    model: DeclaredModel,
    name: str,
    told_times_s: Sequence[float],
    fitted: Sequence[Run],
    flows: Sequence[Flow],
) -> OtherLaws:
    """Return the laws of which one mode follows another, that describe the runs as well.

    Parameters
    ----------
    model
        The known part: two modes or more.
    name
        Of the effect that explains the runs with the same constant in every mode; of any but
        classical ones of one constant nothing is asked.
    told_times_s
        Relaxation times of the modes whose constant the runs tell.
    fitted
        Runs without what a known instrument did.
    flows
        In which the laws predict.
    """
    if name not in ONE_CONSTANT:
        return OtherLaws()
    problem = problem_by_mode(model, ONE_CONSTANT, fitted, 1)
    forward = problem.model
    start = forward.zero()
    amplitude = forward.positions(name)[0]
    start[amplitude] = effect_of(forward, name).parameters[0].first_trial
    same = problem.fit(start, [amplitude])
    if not same.usable:
        return OtherLaws()
    modes = np.asarray(model.relaxation_time, dtype=float)
    found: dict[float, tuple[str, ...]] = {}
    fits = [same]
    for time in told_times_s:
        mode = int(np.argmin(np.abs(np.log(modes / time))))
        as_well = laws_as_good(problem, same, name, mode)
        if as_well:
            found[float(time)] = tuple(as_well)
            fits.extend(as_well.values())
    return OtherLaws(found, _moved(problem, fits, model, flows) if found else {})


def _moved(
    problem: FitProblem, fits: Sequence[Fit], model: DeclaredModel, flows: Sequence[Flow]
) -> dict[str, Float[np.ndarray, "laws n 3"]]:
    """Return by how much predictions of all fits but the first differ from it."""
    forward = problem.model
    values = np.array([[_of_modes(forward, fit, one) for one in ONE_CONSTANT] for fit in fits])
    drawn = [ConstantsDrawn(ONE_CONSTANT, row[None], (1,)) for row in values]
    effects = [effect_of(forward, one) for one in ONE_CONSTANT]
    effects = [one for one in effects if isinstance(one, ConstitutiveEffect)]
    none = {one: np.zeros(0) for one in ONE_CONSTANT}
    told = [bands_by_mode(one, effects, none, model.fluid, flows) for one in drawn]
    first, *others = told
    return {
        key: np.array([other[key].chosen - band.chosen for other in others])
        for key, band in first.items()
    }


def _of_modes(forward: AugmentedModel, fit: Fit, name: str) -> Float[np.ndarray, " k"]:
    """Return the constant of each mode; zero of an effect that is not in the fit."""
    found = varying_constants(forward, fit, {name: Degree()}).get(name)
    return np.zeros(forward.declared.n_modes) if found is None else found.of_modes(fit)
