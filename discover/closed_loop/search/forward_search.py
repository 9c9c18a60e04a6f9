"""Forward search for effects, one stage at a time, on one set of runs."""

from collections.abc import Callable, Sequence

import numpy as np

from discover.closed_loop.judging.numerical_resolution import NumericalResolution
from discover.closed_loop.judging.tolerated_misfit import ToleratedMisfit
from discover.closed_loop.results.candidate_score import CandidateScore
from discover.closed_loop.search.attribution import Attribution, attribute
from discover.closed_loop.search.augment import (
    BARE_MENTION,
    IMPROVEMENT,
    Choice,
    aliases_of,
    choose,
    drop_undecided,
    evidence,
    prune,
    refit,
    simplest,
    taken_out,
)
from discover.closed_loop.search.checkpoint import SearchCheckpoint
from discover.closed_loop.search.degrees import choose_degrees, positions_of
from discover.closed_loop.search.first_starts import first_starts
from discover.closed_loop.search.left_out import left_out_errors
from discover.closed_loop.search.mode_dependence import names_not_needed
from discover.closed_loop.search.physical_range import at_an_end, undetermined
from discover.closed_loop.search.state import SearchState
from discover.dataset import Run
from discover.effects import AbstractEffect, ModeDependence
from discover.errors import InputError
from discover.forward import AugmentedModel, Batch, make_batch
from discover.forward.least_squares import (
    NO_PRIOR,
    Fit,
    Prior,
    fit_batch,
    intervals,
    jacobians,
)
from discover.statistics.residual import summarise

_ROUNDS, _POLISHES = 3, 5

LEADERS = 8
"""Candidates with signatures of their own that are refitted at each stage."""

_COMPARED = 16


class Search(SearchState):
    """A forward search, with its state.

    Parameters
    ----------
    model
        The declared model with all candidates.
    batch
        Runs that are fitted.
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

    def candidate(self, effect: AbstractEffect) -> bool:
        """Whether an effect may be added."""
        known = effect.name in {known.name for known in self.model.declared.effects}
        refused = effect.name in self.refused or isinstance(effect, ModeDependence)
        return not known and not refused and self.admitted(effect)

    @property
    def prior(self) -> Prior:
        """What small strains said of parameters, weighed against the current misfit.

        The misfit counts as noise on as many samples as its correlation leaves independent: while
        a law is still missing it cannot move an instrument's parameter that is known.
        """
        if not self.known:
            return NO_PRIOR
        effective = summarise(self.fit.residual, np.asarray(self.batch.weight)).effective_samples
        size = float(np.sqrt(self.fit.cost / effective))
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

    def restricted(
        self, runs: Sequence[Run], admitted: Callable[[AbstractEffect], bool], name: str
    ) -> "Search":
        """Return a new search on other samples among fewer candidates, kept under its own name."""
        batch = make_batch(runs)
        return Search(
            self.model,
            batch,
            None,
            self.n_candidates,
            admitted,
            self.tolerated.on(NumericalResolution(self.model, batch, runs)),
            SearchCheckpoint(self.checkpoint.store, f"{self.checkpoint.name}_{name}"),
        )

    def resume(self) -> bool:
        """Go on from the last stage that was kept, and return whether there was one."""
        return self.checkpoint.restore(self)

    def positions(self, active: Sequence[str]) -> list[int]:
        """Return what is fitted with these effects, constants by mode as chosen."""
        own = [position for name in active for position in self.model.positions(name)]
        fitted = [*self.model.free_positions, *own]
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

        Raises
        ------
        InputError
            If it cannot be integrated through the runs.
        """
        free = self.model.free_positions
        starts = first_starts(self.model)
        fits = fit_batch(self.model, self.batch, starts, [free] * len(starts))
        usable = [fit for fit in fits if fit.usable]
        self.fit = min(usable, key=lambda fit: fit.cost, default=fits[0])
        if not self.fit.usable:
            raise InputError(
                "The declared model cannot be integrated through the fitted runs: its stress runs "
                "away. Check its parameters, modes and units."
            )
        if by_mode:
            self._choose_degrees()
        self.path = [self.fit.theta]
        self._leave_out()

    def _choose_degrees(self) -> bool:
        """Choose how constants by mode depend on the time, and return whether that is new."""
        before = {name: found.degree for name, found in self.degrees.items()}
        if before:
            self.fit, self.degrees = choose_degrees(
                self.model, self.batch, self.fit, self.degrees, self.prior
            )
        return before != {name: found.degree for name, found in self.degrees.items()}

    def _choose_degrees_again(self, say: Callable[[str], None]) -> bool:
        """Choose again beside the effects that were found; return whether that changed anything.

        A degree was chosen when they were missing, and may have stood for a part of them.
        """
        if not self.active or not self._choose_degrees():
            return False
        self.unasked = set(self.active)
        self._fit_path()
        self._leave_out()
        chosen = (f"{name} of degree {found.degree}" for name, found in self.degrees.items())
        say(f"constants by mode: {', '.join(chosen)}")
        return True

    def run(self, max_effects: int, say: Callable[[str], None], look_ahead: bool = True) -> None:
        """Add effects until none earns its place, and see that each still deserves its own.

        What then has a value at the end of its physical range, or one that the data leave open, is
        taken out again, and the search goes on without it.
        """
        chosen_again = 0
        while True:
            self._add_all(max_effects, say, look_ahead)
            refused = self._refuse()
            if not refused:
                if look_ahead and chosen_again < _ROUNDS and self._choose_degrees_again(say):
                    chosen_again += 1
                    self.rounds = 0
                    self.checkpoint.save(self)
                    continue
                break
            self.rounds = 0
            say(f"no finding: {self.not_named[refused]}")
            self.checkpoint.save(self)
        if look_ahead:
            self._hold_against_modes(say)
        for name in self.active:
            if name in self.unasked:
                self._ask_for_aliases(name)

    def _hold_against_modes(self, say: Callable[[str], None]) -> None:
        """Take out effects that constants that differ from mode to mode make needless.

        Asked only where the names would explain the data: elsewhere nobody is to believe them.
        """
        names = [name for name in self.active if name not in self.settled]
        if not names or not self.explained:
            return
        needless = names_not_needed(self.model, self.batch, self.fit, names, self.prior)
        if not needless:
            return
        for name in needless:
            self.refused.add(name)
            self.not_named[name] = (
                f"{name} fits, but is not needed where the constants of the law differ from one "
                "relaxation mode to the next"
            )
        self.active = [name for name in self.active if name not in needless]
        self.unasked = set(self.active)
        self.fit = self._fit(self.active, self.fit.theta)
        self._fit_path()
        self._leave_out()
        say(f"not needed where constants differ from mode to mode: {', '.join(needless)}")

    def _refuse(self) -> str:
        """Take out one effect whose parameters are no finding, and return its name."""
        names = [name for name in reversed(self.active) if name not in self.settled]
        if not names:
            return ""
        bounds = intervals(self.model, self.batch, self.fit)
        longest = self.batch.longest
        for name in names:
            reason = at_an_end(self.model, self.fit.theta, [name]) or undetermined(
                self.model, self.fit.theta, bounds, name, longest
            )
            if not reason:
                continue
            self.not_named[name] = reason
            self.refused.add(name)
            self.fit = self._without(name)
            self.active.remove(name)
            self.unasked = set(self.active)
            self._fit_path()
            self._leave_out()
            return name
        return ""

    def _add_all(self, max_effects: int, say: Callable[[str], None], look_ahead: bool) -> None:
        while self.rounds < _ROUNDS:
            while len(self.active) < max_effects:
                name = self.advance()
                if name is None and look_ahead and not self.explained:
                    name = self.look_ahead(max_effects)
                if name is None:
                    say("no further candidate earns its place")
                    break
                say(f"{name}: error {self.error:.4f}, runs left out {self.left_out:.4f}")
                self.checkpoint.save(self)
            self.rounds += 1
            if not self.reexamine():
                break
            say(f"exchanged: {', '.join(self.active)}: error {self.error:.4f}")
            self.checkpoint.save(self)
        dropped = self._drop_undecided()
        if dropped:
            # not kept: a search that goes on from before drops the same again
            say(f"dropped, as zero is in the interval: {', '.join(dropped)}")

    def _drop_undecided(self) -> list[str]:
        """Take out effects of which the whole leaves open whether they are there; name them."""
        fit, kept = drop_undecided(
            self.model, self.batch, self.fit, self.active, self.n_candidates, self.settled,
            self.prior,
        )  # fmt: skip
        dropped = [name for name in self.active if name not in kept]
        if dropped:
            self.fit, self.active = fit, kept
            self.unasked = set(kept)
            self._fit_path()
            self._leave_out()
        return dropped

    def look_ahead(self, max_effects: int) -> str | None:
        """Add several effects at once that only together earn their places; return their names.

        While two effects are missing, what the second leaves looks like correlated noise and hides
        the evidence for the first. So the best is taken on trust, and the next; the whole must
        then pay for all its members, and each of them is asked again.
        """
        before, left_out, active = self.fit, self.left_out, list(self.active)
        fit, kept = before, list(active)
        while len(kept) < max_effects:
            _, choices = self.choices_beside(fit, kept)
            if not choices:
                break
            best = max(choices, key=lambda choice: choice.candidate.evidence or -np.inf)
            fit = best.fit
            kept.append(best.candidate.effect)
            added = len(kept) - len(active)
            weight = np.asarray(self.batch.weight)
            effective = summarise(fit.residual, weight).effective_samples
            support = evidence(before, fit, weight, effective, self.n_candidates, added)
            errors = left_out_errors(self.model, self.batch, fit, self.prior)
            if added < 2 or support <= BARE_MENTION or np.mean(errors) >= IMPROVEMENT * left_out:
                continue
            fit = self._sharpened(fit)
            self.fit = fit
            self.fit, self.active = prune(
                self.model, self.batch, fit, kept, self.n_candidates, self.settled, self.prior
            )
            new = [name for name in self.active if name not in active]
            for name in new:
                self.aliases[name] = ()
                self.support[name] = support / len(new)
            self._fit_path()
            self._leave_out()
            # the first was taken on trust, with the others still missing
            for name in new[:-1]:
                self._exchange(name)
            self.unasked = set(self.active)
            return ", ".join(name for name in self.active if name not in active)
        return None

    def reexamine(self) -> bool:
        """Ask of each effect but the last whether another serves better now; say if one does.

        An effect was chosen when those after it were still missing, and may have stood for a part
        of them. Another serves better if it has more evidence and predicts runs left out better.
        What was settled at small strain gives way only where the whole is then explained, for the
        misfit of a law still missing cannot judge the instrument, and only to what gains more than
        small strains said for it.
        """
        asked = list(self.active)
        if self.active and not self.settled:
            asked = [name for name in asked if name != self.active[-1]]
        exchanged = False
        for name in asked:
            exchanged |= self._exchange(name)
        return exchanged

    def _ask_for_aliases(self, name: str) -> None:
        """Refit the final model with each leading candidate in the place of an effect."""
        own, choices = self._in_place_of(name)
        if own is not None:
            self.aliases[name] = aliases_of(own, choices)
            self.unasked.discard(name)

    def _in_place_of(self, name: str) -> tuple[Choice | None, list[Choice]]:
        """Return an effect of the model after a refit, and with it all that could be instead.

        None where its own refit fails, or where the law runs away without it: then nothing can be
        ranked from there.
        """
        without = self._without(name)
        if not without.usable:
            return None, []
        others = [other for other in self.active if other != name]

        def rival(effect: AbstractEffect) -> bool:
            return effect.name != name and self.candidate(effect)

        leading = attribute(self.model, self.batch, without, others, LEADERS, rival).leading
        current = CandidateScore(name, "", 1.0, 0.0, start=self.fit.theta.copy())
        asked = [current, *leading][:_COMPARED]
        choices = refit(self.model, self.batch, without, asked, self.n_candidates, self.prior)
        choices = self.possible(choices, others)
        return next((c for c in choices if c.candidate is current), None), choices

    def _exchange(self, name: str) -> bool:
        others = [other for other in self.active if other != name]
        own_choice, choices = self._in_place_of(name)
        if own_choice is None:
            return False
        current = own_choice.candidate
        # evidence alone would let a term in that fits a little better and predicts worse
        expected = np.mean(own_choice.left_out)
        able = [c for c in choices if c is own_choice or np.mean(c.left_out) < expected]
        best = simplest(able, self.model)
        if (best.candidate.evidence or 0.0) < (current.evidence or 0.0):
            best = own_choice
        explained = self.tolerated.explained(best.fit, [*others, best.candidate.effect])
        gain = (best.candidate.evidence or 0.0) - (current.evidence or 0.0)
        if name in self.settled and not (explained and gain > self.support[name]):
            return False
        self.aliases[name] = aliases_of(best, choices)
        self.unasked.discard(name)
        if best.candidate is current:
            return False
        new = best.candidate.effect
        self.aliases[new] = self.aliases.pop(name)
        self.support[new] = self.support.pop(name)
        self.active[self.active.index(name)] = new
        self.unasked = {other for other in self.active if other != new}
        self.settled = tuple(n for n in self.settled if n != name)
        own = self.model.positions(name)
        self.known = {at: value for at, value in self.known.items() if at not in own}
        self.fit = self._sharpened(best.fit)
        self._polish()
        self._fit_path()
        self._leave_out()
        return True

    def _without(self, effect: str) -> Fit:
        """Return the current fit with an effect taken out and the others refitted."""
        theta, free = taken_out(self.model, self.fit, effect)
        fit = fit_batch(self.model, self.batch, [theta], [free], prior=self.prior)[0]
        if fit.usable:
            return fit
        residual = self.model.residuals([theta], self.batch)
        return Fit(
            theta,
            free,
            residual[0],
            jacobians(self.model, self.batch, [theta], residual, [free])[0],
        )

    def choices_beside(self, fit: Fit, others: Sequence[str]) -> tuple[Attribution, list[Choice]]:
        """Return what may be added to a fit with other effects: all as scored, and the refitted."""
        attribution = attribute(self.model, self.batch, fit, others, LEADERS, self.candidate)
        choices = refit(
            self.model, self.batch, fit, attribution.leading, self.n_candidates, self.prior
        )
        return attribution, self.possible(choices, others)

    def advance(self) -> str | None:
        """Add the effect that earns its place, and return its name, or None."""
        attribution, choices = self.choices_beside(self.fit, self.active)
        chosen = choose(self.model, choices, self.left_out)
        self.rankings.append(_ordered([*attribution.leading, *attribution.rest]))
        # what cannot be told from noise gives no reason to add anything
        if chosen is None or self.tolerated.random(self.fit, self.active):
            return None
        name = chosen.candidate.effect
        self.aliases[name] = chosen.candidate.aliases
        self.support[name] = chosen.candidate.evidence or 0.0
        self.unasked = set(self.active)
        kept = [*self.active, name]
        self.fit = self._sharpened(chosen.fit)
        if name in self.degrees:
            self._choose_degrees()
        self._polish()
        self.fit, self.active = prune(
            self.model, self.batch, self.fit, kept, self.n_candidates, self.settled, self.prior
        )
        if len(self.active) < len(kept):
            self.unasked = set(self.active)
            # the stages must tell how the final model is reached, so they are fitted again
            self._fit_path()
        else:
            self.path.append(self.fit.theta)
        self._leave_out()
        return name

    def adopt(self, other: "Search") -> None:
        """Take over the effects that another search established, refitted to these runs."""
        self.settled = tuple(other.active)
        self.active = list(other.active)
        self.aliases |= other.aliases
        self.support |= other.support
        self.rankings += other.rankings[: len(other.active)]
        bounds = intervals(other.model, other.batch, other.fit)
        for name in other.active:
            for at in self.model.positions(name):
                deviation = (bounds[at][1] - bounds[at][0]) / (2.0 * 1.96)
                if deviation > 0.0:
                    self.known[at] = (float(other.fit.theta[at]), deviation)
        values = other.fit.theta.copy()
        if self.degrees:
            # at small strain nothing tells a constant of one mode from another's
            own = self.model.declared.size
            values[:own] = self.fit.theta[:own]
        self.fit = self._fit(self.active, values)
        self._polish()
        self._fit_path()
        self._leave_out()

    def _fit(self, active: Sequence[str], values: np.ndarray) -> Fit:
        positions = self.positions(active)
        start = self.model.zero()
        start[positions] = values[positions]
        return fit_batch(self.model, self.batch, [start], [positions], prior=self.prior)[0]

    def _sharpened(self, fit: Fit) -> Fit:
        """Return a fit that only ranked candidates, carried on to the end."""
        again = fit_batch(self.model, self.batch, [fit.theta], [fit.free], prior=self.prior)[0]
        return again if again.usable else fit

    def _polish(self) -> None:
        """Fit again while a better fit weighs what is known otherwise."""
        for _ in range(_POLISHES if self.known else 0):
            before = self.fit.cost
            again = fit_batch(
                self.model, self.batch, [self.fit.theta], [self.fit.free], prior=self.prior
            )[0]
            if not again.usable:
                break
            self.fit = again
            if abs(again.cost - before) < 1e-3 * before:
                break

    def _fit_path(self) -> None:
        """Fit the stages that lead to the model again.

        An effect may make a law run away until a later one checks it; that stage then stays where
        the one before it was, for it explains nothing that could be said in numbers.
        """
        earlier: list[np.ndarray] = []
        for n in range(len(self.active)):
            fit = self._fit(self.active[:n], self.fit.theta)
            earlier.append(fit.theta if fit.usable or not earlier else earlier[-1])
        self.path = [*earlier, self.fit.theta]

    def _leave_out(self) -> None:
        self.left_out = float(
            np.mean(left_out_errors(self.model, self.batch, self.fit, self.prior))
        )

    def possible(self, choices: Sequence[Choice], others: Sequence[str]) -> list[Choice]:
        """Return the choices that a fluid or an instrument can be, and that predict every flow.

        What is at an end of its physical range cannot win; of the others in the model none may be
        driven there. All others are noted, for what they say beside the one that is chosen.
        """
        possible = []
        self.seen.explored.add(tuple(sorted(others)))
        for choice in choices:
            theta, name = choice.fit.theta, choice.candidate.effect
            if not self._predictable(theta):
                continue
            reason = at_an_end(self.model, theta, [name])
            if reason and (choice.candidate.evidence or 0.0) > BARE_MENTION:
                self.not_named.setdefault(name, reason)
            if not reason and not at_an_end(self.model, theta, others):
                possible.append(choice)
                self.seen.note([*others, name], choice.fit, np.asarray(self.batch.weight))
        return possible

    def _predictable(self, theta: np.ndarray) -> bool:
        # flows are commanded before they are measured: a law that cannot be integrated through a
        # held-out flow is no law of this fluid, and saying so uses none of its stresses
        held = self.held_batch
        return held is None or bool(np.all(np.isfinite(self.model.predict(theta, held))))


def _ordered(ranking: Sequence[CandidateScore]) -> tuple[CandidateScore, ...]:
    def key(candidate: CandidateScore):
        known = candidate.evidence if candidate.evidence is not None else -np.inf
        return (-known, -candidate.reduction)

    return tuple(sorted(ranking, key=key))
