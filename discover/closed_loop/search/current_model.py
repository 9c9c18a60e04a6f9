"""The model that a search has reached: its fit, and fits with and without one effect."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from discover.closed_loop.judging.tolerated_misfit import ToleratedMisfit
from discover.closed_loop.search.checkpoint import SearchCheckpoint
from discover.closed_loop.search.first_starts import first_starts
from discover.closed_loop.search.scoring.attribution import Attribution, attribute
from discover.closed_loop.search.scoring.left_out import left_out_errors
from discover.closed_loop.search.scoring.physical_range import at_an_end
from discover.closed_loop.search.scoring.refitting import Choice, refit
from discover.closed_loop.search.state import SearchState
from discover.dataset.run_table import kind_of_record
from discover.effects import AbstractEffect, ModeDependence
from discover.errors import InputError
from discover.forward import AugmentedModel, Batch
from discover.inference.by_mode.degrees import choose_degrees, has_added_mode, positions_of
from discover.inference.evidence import BARE_MENTION
from discover.inference.least_squares import NO_PRIOR, Fit, Prior
from discover.inference.problem import FitProblem

_POLISHES = 5

LEADERS = 8
"""Candidates with signatures of their own that are refitted at each stage."""


class CurrentModel(SearchState):
    """The model that a search has reached, and what can be fitted beside it.

    Parameters
    ----------
    model
        The declared model with all candidates.
    held_batch
        Flows through which a chosen law must be integrable; their stresses are not looked at.
    n_candidates
        Number of candidates, the price of choosing among which every effect must pay.
    admitted
        Which effects are candidates.
    tolerated
        What a complete model may leave of the data.
    checkpoint
        Keeps the search after each stage; by default nothing is kept.
    """

    def __init__(
        self,
        model: AugmentedModel,
        batch: Batch,
        held_batch: Batch | None,
        n_candidates: int,
        admitted: Callable[[AbstractEffect], bool],
        tolerated: ToleratedMisfit,
        checkpoint: SearchCheckpoint | None = None,
    ):
        self.checkpoint = checkpoint or SearchCheckpoint(None, "")
        super().__init__(model)
        self.batch, self.held_batch = batch, held_batch
        self.n_candidates, self.admitted = n_candidates, admitted
        self.tolerated = tolerated
        kinds = [kind_of_record(run) for run in tolerated.resolution.runs]
        alone = tuple(i for i, kind in enumerate(kinds) if kinds.count(kind) == 1)
        self._problem = FitProblem(model, batch, n_candidates, alone=alone)

    def candidate(self, effect: AbstractEffect) -> bool:
        """Whether an effect may be added."""
        known = effect.name in {known.name for known in self.model.declared.effects}
        refused = effect.name in self.refused or isinstance(effect, ModeDependence)
        return not known and not refused and self.admitted(effect)

    @property
    def problem(self) -> FitProblem:
        """What is fitted to what, and with what known."""
        return replace(self._problem, prior=self.prior)

    @property
    def prior(self) -> Prior:
        """What small strains said of parameters, weighed against the current misfit.

        The misfit counts as noise on as many samples as its correlation leaves independent: while
        a law is still missing it cannot move an instrument's parameter that is known.
        """
        if not self.known:
            return NO_PRIOR
        size = float(np.sqrt(self.fit.cost / self._problem.independent_samples(self.fit)))
        return Prior(
            tuple(self.known),
            tuple(mean for mean, _ in self.known.values()),
            tuple(size / deviation for _, deviation in self.known.values()),
        )

    @property
    def error(self) -> float:
        """Mean relative error of the fitted runs."""
        return float(np.mean(self.fit.run_errors))

    @property
    def explained(self) -> bool:
        """Whether what is left is what a complete model may leave."""
        return self.tolerated.explained(self.fit, self.active)

    def positions(self, active: Sequence[str]) -> list[int]:
        """Return what is fitted with these effects, constants by mode as chosen."""
        own = [position for name in active for position in self.model.positions(name)]
        fitted = [*self.model.free_positions, *own]
        if self.model.adding_modes and not has_added_mode(self.model, fitted):
            return fitted
        present = {
            name: found
            for name, found in self.degrees.items()
            if self.model.constant(name)[1] in fitted
        }
        return [*fitted, *positions_of(self.model, present)]

    def start(self, by_mode: bool = True) -> None:
        """Fit the declared model, from several starts where its misfit may have several minima.

        Parameters
        ----------
        by_mode
            Whether constants may differ from mode to mode, as far as the model says so.
        """
        self.fit = self._problem.best_fit(first_starts(self.model), self.model.free_positions)
        if not self.fit.usable:
            raise InputError(
                "The declared model cannot be integrated through the fitted runs: its stress runs "
                "away. Check its parameters, modes and units."
            )
        if by_mode:
            self.choose_degrees()
        self.path = [self.fit.theta]
        self.leave_out()

    def choose_degrees(self) -> bool:
        """Choose how constants by mode depend on the time, and return whether that is new."""
        before = {name: found.degree for name, found in self.degrees.items()}
        if before:
            self.fit, self.degrees = choose_degrees(
                self.problem, self.fit, self.degrees, self.least_degrees
            )
        return before != {name: found.degree for name, found in self.degrees.items()}

    def without(self, effect: str) -> Fit:
        """Return the current fit with an effect taken out and the others refitted."""
        theta, free = self.problem.without(self.fit, effect)
        fit = self.problem.fit(theta, free)
        if fit.usable:
            return fit
        return self.problem.at(theta, free)

    def choices_beside(
        self,
        fit: Fit,
        others: Sequence[str],
        among: Callable[[AbstractEffect], bool] | None = None,
    ) -> tuple[Attribution, list[Choice]]:
        """Return what may be added to a fit with other effects: all as scored, and the refitted."""
        admitted = among or self.candidate
        attribution = attribute(self.model, self.batch, fit, others, LEADERS, admitted)
        choices = refit(self.problem, fit, attribution.leading)
        return attribution, self.possible(choices, others)

    def fitted(self, active: Sequence[str], values: np.ndarray) -> Fit:
        """Return the fit with these effects, from values of all parameters."""
        positions = self.positions(active)
        start = self.model.zero()
        start[positions] = values[positions]
        return self.problem.fit(start, positions)

    def sharpened(self, fit: Fit) -> Fit:
        """Return a fit that only ranked candidates, carried on to the end."""
        again = self.problem.fit(fit.theta, fit.free)
        return again if again.usable else fit

    def polish(self) -> None:
        """Fit again while a better fit weighs what is known otherwise."""
        for _ in range(_POLISHES if self.known else 0):
            before = self.fit.cost
            again = self.problem.fit(self.fit.theta, self.fit.free)
            if not again.usable:
                break
            self.fit = again
            if abs(again.cost - before) < 1e-3 * before:
                break

    def fit_path(self) -> None:
        """Fit the stages that lead to the model again.

        An effect may make a law run away until a later one checks it; that stage then stays where
        the one before it was, for it explains nothing that could be said in numbers.
        """
        earlier: list[np.ndarray] = []
        for n in range(len(self.active)):
            fit = self.fitted(self.active[:n], self.fit.theta)
            earlier.append(fit.theta if fit.usable or not earlier else earlier[-1])
        self.path = [*earlier, self.fit.theta]

    def leave_out(self) -> None:
        """Compute the error of runs left out anew."""
        self.left_out = float(np.mean(left_out_errors(self.problem, self.fit)))

    def take(self, fit: Fit, active: Sequence[str]) -> None:
        """Go on with a fit that has these effects, none of which was asked for its aliases yet."""
        self.fit, self.active = fit, list(active)
        self.without_aliases = set(active)
        self.fit_path()
        self.leave_out()

    def weigh_each_effect(self) -> None:
        """Tell the evidence for each effect that was taken; aliases were asked for none of them."""
        effective = self.problem.independent_samples(self.fit)
        for name in self.active:
            without = self.without(name)
            gain = self.problem.evidence(without, self.fit, effective) if without.usable else 0.0
            self.support[name] = gain
            self.aliases.setdefault(name, ())

    def possible(self, choices: Sequence[Choice], others: Sequence[str]) -> list[Choice]:
        """Return the choices that a fluid or an instrument can be, and that predict every flow.

        What is at an end of its physical range cannot win; of the others in the model none may be
        driven there. All others are noted, for what they say beside the one that is chosen.
        """
        possible = []
        self.seen.explored.add(tuple(sorted(others)))
        for choice in choices:
            theta, name = choice.fit.theta, choice.candidate.effect
            if not self.predicts_held_out(theta):
                continue
            reason = at_an_end(self.model, theta, [name])
            if reason and (choice.candidate.evidence or 0.0) > BARE_MENTION:
                self.not_named.setdefault(name, reason)
            if not reason and not at_an_end(self.model, theta, others):
                possible.append(choice)
                self.seen.note([*others, name], choice.fit, np.asarray(self.batch.weight))
        return possible

    def predicts_held_out(self, theta: np.ndarray) -> bool:
        """Return whether a law can be integrated through the flows that were held out."""
        # flows are commanded before they are measured: a law that cannot be integrated through a
        # held-out flow is no law of this fluid, and saying so uses none of its stresses
        held = self.held_batch
        return held is None or bool(np.all(np.isfinite(self.model.predict(theta, held))))
