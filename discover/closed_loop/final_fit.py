"""The model that a search ended with, on the runs: its fit, what it predicts, its constants."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from discover.closed_loop.explanations import Carried, OtherBench, other_benches
from discover.closed_loop.judging.before_after import errors_of, record_runs
from discover.closed_loop.judging.between_samples import (
    Bounds,
    change_between_samples,
    coarse_rates,
)
from discover.closed_loop.judging.finer_steps import on_finer_steps
from discover.closed_loop.judging.held_out import HeldOut
from discover.closed_loop.judging.held_out import held_out as predict_held_out
from discover.closed_loop.judging.loadings import factors_of_loadings
from discover.closed_loop.judging.misread_runs import holding_misreading
from discover.closed_loop.judging.numerical_resolution import NumericalResolution
from discover.closed_loop.own_noise import weighed_like
from discover.closed_loop.results.error_pair import ErrorPair
from discover.closed_loop.results.run_record import RunRecord
from discover.closed_loop.search import Search
from discover.closed_loop.searching import SearchResult
from discover.dataset import Run
from discover.dataset.records.coarse_rates import CoarseRates
from discover.dataset.records.repeats import repeats_among
from discover.forward import AugmentedModel, Batch, make_batch
from discover.inference.by_mode.as_fitted import constants_by_mode
from discover.inference.by_mode.constants import ConstantByMode
from discover.inference.by_mode.varying_constant import freer_fits
from discover.inference.fit_uncertainty import intervals
from discover.inference.least_squares import Fit
from discover.inference.modulus_errors import modulus_shifts
from discover.inference.profile import profiled
from discover.inference.readings import beside_one_another, fitted_readings, unseen_readings
from discover.inference.small_faults import with_small_faults
from discover.inference.step_instants import with_own_instants
from discover.statistics.reading.loadings import LoadingFound
from discover.statistics.reading.misread import Misread, not_ruled_out
from discover.statistics.reading.reading_faults import Reading
from discover.statistics.reading.small_faults import small_faults


@dataclass(frozen=True)
class FinalFit:
    """The final model on the runs, in the steps that its effects need.

    Attributes
    ----------
    search, carried
        The search that has ended, and the sets of effects that explain the records.
    fitted, held_out
        The runs that were fitted, and those that only judge.
    held_batch
        These, as the model has them, if there are any.
    order
        Names of the runs of the data set, in its order.
    """

    search: Search
    carried: Sequence[Carried]
    fitted: Sequence[Run]
    held_out: Sequence[Run]
    held_batch: Batch | None
    order: Sequence[str]

    @property
    def model(self) -> AugmentedModel:
        """The declared model with all candidates."""
        return self.search.model

    @property
    def batch(self) -> Batch:
        """The fitted runs as the model has them."""
        return self.search.batch

    @property
    def loading(self) -> float:
        """Standard deviation of the factors of loadings; zero where runs are none of their own."""
        return self.batch.records.deviation_of_loadings

    @cached_property
    def loadings(self) -> list[LoadingFound]:
        """The factors of the loadings of all runs; none where they are none of their own."""
        told, model = (self.batch, self.fit), self.model
        found = factors_of_loadings(model, told, self.batch, self.fitted)
        if self.held_batch is not None:
            found += factors_of_loadings(model, told, self.held_batch, self.held_out, held_out=True)
        return found

    @property
    def fit(self) -> Fit:
        """The final fit."""
        return self.search.fit

    @property
    def active(self) -> list[str]:
        """Names of the effects that were found."""
        return self.search.active

    @cached_property
    def benches(self) -> list[OtherBench]:
        """Sets of fewer effects that explain the records as well on a bench a little off."""
        return other_benches(self.search, self.carried)

    @property
    def beside_benches(self) -> list[Carried]:
        """What explains the records: the sets carried, and those beside faults of the bench."""
        return [*self.carried, *(one.carried for one in self.benches)]

    @property
    def present(self) -> list[str]:
        """Names of all effects of the model: those found, and those that were known."""
        return [*self.active, *(known.name for known in self.model.declared.effects)]

    @property
    def error(self) -> float:
        """Relative misfit, mean over the fitted runs."""
        return float(np.mean(self.fit.run_errors))

    @cached_property
    def records_fitted(self) -> list[RunRecord]:
        """The fitted runs with predictions of every stage of the search."""
        return record_runs(
            self.model, self.batch, self.fitted, self.search.path, held_out=False, order=self.order
        )

    @cached_property
    def records_held_out(self) -> list[RunRecord]:
        """The same of the runs held out."""
        if self.held_batch is None:
            return []
        return record_runs(
            self.model, self.held_batch, self.held_out, self.search.path, held_out=True,
            order=self.order,
        )  # fmt: skip

    @cached_property
    def held_as_noisy(self) -> Batch | None:
        """The runs held out, taken to be as noisy as fitted ones of their kind."""
        if self.held_batch is None or all(run.weight == 1.0 for run in self.fitted):
            return self.held_batch
        return make_batch(weighed_like(self.held_out, self.fitted))

    @property
    def records(self) -> list[RunRecord]:
        """The same of all runs."""
        return [*self.records_fitted, *self.records_held_out]

    def error_at(self, stage: int) -> ErrorPair:
        """Return the errors of the declared model, stage 0, or after so many effects."""
        return errors_of(self.records, stage)

    @property
    def error_after(self) -> ErrorPair:
        """The errors of the final model."""
        return self.error_at(len(self.search.path) - 1)

    @cached_property
    def shifts(self) -> Float[np.ndarray, "k runs n"]:
        """What errors of the moduli change of the fitted runs."""
        return modulus_shifts(self.model, self.fit.theta, self.batch)

    @cached_property
    def fitted_readings(self) -> list[Reading]:
        """The fitted runs for the question how they were read."""
        return fitted_readings(self.model, self.batch, self.fitted, self.fit)

    @cached_property
    def unseen_readings(self) -> list[Reading]:
        """The runs held out for the same question."""
        if self.held_batch is None:
            return []
        return unseen_readings(
            self.model, self.held_batch, self.held_out, self.fit, self.search.path[-1]
        )

    @property
    def readings(self) -> tuple[list[Reading], list[Reading]]:
        """The fitted runs and those held out, to be asked together."""
        constants = len(self.fit.free)
        return beside_one_another(self.fitted_readings, self.unseen_readings, constants)

    def unseen(self) -> HeldOut | None:
        """Return what the final model leaves of the runs held out, if there are any."""
        if self.held_batch is None:
            return None
        resolution = NumericalResolution(self.model, self.held_batch, self.held_out)
        return predict_held_out(self.model, self.batch, self.fit, self.search.path[-1], resolution)

    def between_samples(
        self, batch: Batch, runs: Sequence[Run]
    ) -> Float[np.ndarray, "runs n"] | None:
        """Return what other rates between the samples of some runs would change, if anything."""
        return change_between_samples(
            self.model, batch, runs, self.fit.theta, self.active, self.error
        )


@dataclass(frozen=True)
class FinalConstants:
    """What is known of the constants of the final model.

    Attributes
    ----------
    bounds
        95 % intervals by position, given the effects of the model.
    unknown
        What other rates between the samples of the fitted runs would change; None if nothing.
    coarse
        What that does to constants; None if nothing.
    by_mode
        Constants that may differ from mode to mode, by name.
    possible
        Constants far from the fit that these data do not exclude; see `profiled`.
    misread
        How else the fitted runs may have been read, with which the intervals hold too; None if not.
    """

    bounds: Bounds
    unknown: Float[np.ndarray, "runs n"] | None
    coarse: CoarseRates | None
    by_mode: Mapping[str, ConstantByMode]
    possible: Sequence[Float[np.ndarray, " p"]] = ()
    misread: Misread | None = None

    @property
    def misread_said(self) -> str:
        """How else the fitted runs may have been read, in a sentence; empty if not."""
        return "" if self.misread is None else not_ruled_out(self.misread)

    @property
    def rates_known(self) -> bool:
        """Whether what the rate did between its samples leaves the constants alone."""
        return self.coarse is None or not self.coarse.is_coarse


def final_fit(
    ended: SearchResult, fitted: Sequence[Run], held_out: Sequence[Run], order: Sequence[str]
) -> FinalFit:
    """Return the final fit of a search, in the steps that its effects need.

    Parameters
    ----------
    ended
        The search; it goes on with this fit.
    fitted, held_out
        The runs that were fitted, and those that only judge.
    order
        Names of the runs of the data set, in its order.
    """
    search = ended.search
    search.fit = on_finer_steps(search.model, search.batch, fitted, search.fit, search.active)
    held_batch = search.held_batch
    if held_batch is not None:
        held_out = with_own_instants(search.model, search.fit.theta, held_out)
        held_batch = make_batch(held_out)
    return FinalFit(search, ended.carried, fitted, held_out, held_batch, order)


def final_constants(final: FinalFit, apart: Mapping[str, ConstantByMode]) -> FinalConstants:
    """Return what is known of the constants of a final model.

    Parameters
    ----------
    apart
        What is known of each mode's constant where one for all modes explains the records.
    """
    search, model, batch, fit = final.search, final.model, final.batch, final.fit
    bounds = intervals(model, batch, fit, final.shifts)
    profile = profiled(search.problem, fit, bounds, _constants(final))
    repeats = repeats_among(final.fitted)
    small = small_faults(final.fitted_readings, 0.0 if repeats is None else repeats.error)
    bounds = with_small_faults(profile.bounds, fit, model, small)
    bounds, otherwise = holding_misreading(bounds, fit, final.fitted_readings, model)
    unknown, coarse = final.between_samples(batch, final.fitted), None
    if unknown is not None:
        coarse, bounds = coarse_rates(model, batch, final.fitted, fit, bounds, unknown)
    freer = freer_fits(model, batch, fit, search.degrees, search.prior)
    count = len(fit.free)  # factors of loadings come after the constants
    beside = None if small is None else small.about_the_fit[:count, :count]
    by_mode = constants_by_mode(model, batch, fit, bounds, search.degrees, freer, beside)
    return FinalConstants(
        bounds, unknown, coarse, {**by_mode, **apart}, profile.possible, otherwise
    )


def _constants(final: FinalFit) -> list[int]:
    """Return positions of fitted constants, without what varies them and the instants of steps."""
    model, instants = final.model, final.model.instants
    varying = {at for name in model.declared.by_mode_slices for at in model.varying(name)}
    return [
        at
        for at in final.fit.free
        if at not in varying and not instants.start <= at < instants.stop
    ]
