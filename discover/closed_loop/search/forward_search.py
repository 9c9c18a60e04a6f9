"""Forward search for effects, one stage at a time, on one set of runs."""

from collections.abc import Callable, Sequence

import numpy as np

from discover.closed_loop.judging.numerical_resolution import NumericalResolution
from discover.closed_loop.results.candidate_score import CandidateScore
from discover.closed_loop.search.checkpoint import SearchCheckpoint
from discover.closed_loop.search.current_model import CurrentModel
from discover.closed_loop.search.moves.exchanging import ask_for_aliases, reexamine
from discover.closed_loop.search.moves.looking_ahead import look_ahead
from discover.closed_loop.search.moves.one_law import put_one_law_in_place
from discover.closed_loop.search.moves.taking_out import (
    drop_undecided_effects,
    drop_what_modes_explain,
    refuse,
    restore_left_open,
)
from discover.closed_loop.search.scoring.refitting import Choice, choose, prune
from discover.dataset import Run
from discover.effects import AbstractEffect
from discover.forward import make_batch
from discover.inference.evidence import INDISTINGUISHABLE
from discover.inference.fit_uncertainty import intervals
from discover.statistics import HALF_BAND
from discover.statistics.residual import STRUCTURE

_ROUNDS = 3


class Search(CurrentModel):
    """A forward search: adds effects to the current model while one earns its place."""

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

    def _choose_degrees_again(self, say: Callable[[str], None]) -> bool:
        """Choose again beside the effects that were found; return whether that changed anything.

        A degree was chosen when they were missing, and may have stood for a part of them.
        """
        if not self.active or not self.choose_degrees():
            return False
        self.without_aliases = set(self.active)
        self.fit_path()
        self.leave_out()
        chosen = (f"{name} of degree {found.degree}" for name, found in self.degrees.items())
        say(f"constants by mode: {', '.join(chosen)}")
        return True

    def run(self, max_effects: int, say: Callable[[str], None], whole: bool = True) -> None:
        """Add effects until none earns its place, and see that each still deserves its own.

        What then has a value at the end of its physical range, or one that the data leave open, is
        taken out again, and the search goes on without it.

        Parameters
        ----------
        max_effects
            Largest number of effects.
        say
            Called with a line of text now and then.
        whole
            Whether whole runs are fitted. At small strain alone no effects are added that only
            together earn their places, nor does one constant differ from another's by mode.
        """
        chosen_again = 0
        while True:
            self._add_all(max_effects, say, whole)
            refused = refuse(self)
            if not refused:
                if whole and chosen_again < _ROUNDS and self._choose_degrees_again(say):
                    chosen_again += 1
                    self.rounds = 0
                    self.checkpoint.save(self)
                    continue
                break
            self.rounds = 0
            say(f"no finding: {self.not_named[refused]}")
            self.checkpoint.save(self)
        restored = restore_left_open(self)
        if restored:
            say(f"put back, for what stands in its place is far less likely: {restored}")
        if whole:
            drop_what_modes_explain(self, say)
        for name in self.active:
            if name in self.without_aliases:
                ask_for_aliases(self, name)

    def _add_all(self, max_effects: int, say: Callable[[str], None], whole: bool) -> None:
        while self.rounds < _ROUNDS:
            while len(self.active) < max_effects:
                name = self.advance()
                if name is None and whole and not self.explained:
                    name = look_ahead(self, max_effects)
                if name is None:
                    say("no further candidate earns its place")
                    break
                say(f"{name}: error {self.error:.4f}, runs left out {self.left_out:.4f}")
                self.checkpoint.save(self)
            self.rounds += 1
            if not reexamine(self) and not (whole and put_one_law_in_place(self)):
                break
            say(f"exchanged: {', '.join(self.active)}: error {self.error:.4f}")
            self.checkpoint.save(self)
        dropped = drop_undecided_effects(self)
        if dropped:
            # not kept: a search that goes on from before drops the same again
            say(f"dropped, as zero is in the interval: {', '.join(dropped)}")

    def advance(self) -> str | None:
        """Add the effect that earns its place, and return its name, or None."""
        attribution, choices = self.choices_beside(self.fit, self.active)
        chosen = choose(self.model, choices, self.left_out)
        self.rankings.append(_ordered([*attribution.leading, *attribution.rest]))
        if chosen is None:
            return None
        # what cannot be told from noise gives no reason to add anything
        if self.tolerated.random(self.fit, self.active) and not self._was_no_noise(chosen):
            return None
        name = chosen.candidate.effect
        self.aliases[name] = chosen.candidate.aliases
        self.support[name] = chosen.candidate.evidence or 0.0
        self.without_aliases = set(self.active)
        kept = [*self.active, name]
        self.fit = self.sharpened(chosen.fit)
        if name in self.degrees:
            self.choose_degrees()
        self.polish()
        self.fit, self.active = prune(self.problem, self.fit, kept, self.established)
        if len(self.active) < len(kept):
            self.without_aliases = set(self.active)
            # the stages must tell how the final model is reached, so they are fitted again
            self.fit_path()
        else:
            self.path.append(self.fit.theta)
        self.leave_out()
        return name

    def _was_no_noise(self, choice: Choice) -> bool:
        """Return whether an effect leaves so little that what passed for noise was a misfit.

        A smooth misfit looks like noise of a high correlation. But the noise is no larger than what
        the effect leaves, if that is noise. The evidence counts as few samples as noise so
        correlated is worth.
        """
        error, left = (float(np.mean(fit.run_errors)) for fit in (self.fit, choice.fit))
        if error <= STRUCTURE * left:
            return False
        effective = self.problem.independent_samples(self.fit)
        return self.problem.evidence(self.fit, choice.fit, effective) > INDISTINGUISHABLE

    def adopt(self, other: "Search") -> None:
        """Take over the effects that another search established, refitted to these runs."""
        self.established = tuple(other.active)
        self.active = list(other.active)
        self.aliases |= other.aliases
        self.support |= other.support
        self.rankings += other.rankings[: len(other.active)]
        bounds = intervals(other.model, other.batch, other.fit)
        for name in other.active:
            for at in self.model.positions(name):
                deviation = (bounds[at][1] - bounds[at][0]) / (2.0 * HALF_BAND)
                if deviation > 0.0:
                    self.known[at] = (float(other.fit.theta[at]), deviation)
        values = other.fit.theta.copy()
        if self.degrees:
            # at small strain nothing tells a constant of one mode from another's
            own = self.model.declared.size
            values[:own] = self.fit.theta[:own]
        self.fit = self.fitted(self.active, values)
        self.polish()
        self.fit_path()
        self.leave_out()


def _ordered(ranking: Sequence[CandidateScore]) -> tuple[CandidateScore, ...]:
    def key(candidate: CandidateScore):
        known = candidate.evidence if candidate.evidence is not None else -np.inf
        return (-known, -candidate.reduction)

    return tuple(sorted(ranking, key=key))
