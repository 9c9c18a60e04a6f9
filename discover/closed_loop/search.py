"""Forward search for effects, one stage at a time, on one set of runs."""

from collections.abc import Callable, Sequence

import numpy as np

from discover.closed_loop.attribution import CandidateScore, attribute
from discover.closed_loop.augment import choose, prune, refit
from discover.closed_loop.augmented_model import AugmentedModel
from discover.closed_loop.least_squares import Fit, fit_batch, leave_one_run_out
from discover.closed_loop.run_batch import RunBatch
from discover.effects import AbstractEffect
from discover.errors import InputError

LEADERS = 8
"""Candidates with signatures of their own that are refitted at each stage."""


class Search:
    """The state of a search.

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

    Attributes
    ----------
    fit
        The current fit.
    active
        Effects in it, in the order in which they came.
    path
        Parameter vectors of the declared model and after each effect.
    rankings
        Candidates at each stage, the strongest evidence first.
    aliases, support
        Aliases and evidence of each effect when it was added.
    left_out
        Mean error of runs left out.
    """

    def __init__(
        self,
        model: AugmentedModel,
        batch: RunBatch,
        held_batch: RunBatch | None,
        n_candidates: int,
        admitted: Callable[[AbstractEffect], bool],
    ):
        self.model, self.batch, self.held_batch = model, batch, held_batch
        self.n_candidates, self.admitted = n_candidates, admitted
        self.active: list[str] = []
        self.settled: tuple[str, ...] = ()
        self.rankings: list[tuple[CandidateScore, ...]] = []
        self.aliases: dict[str, tuple[str, ...]] = {}
        self.support: dict[str, float] = {}
        self.fit: Fit
        self.path: list[np.ndarray] = []
        self.left_out = float("inf")

    @property
    def error(self) -> float:
        """Mean relative error of the fitted runs."""
        return float(np.mean(self.fit.run_errors))

    def restricted(self, batch: RunBatch, admitted: Callable[[AbstractEffect], bool]) -> "Search":
        """Return a new search on other samples among fewer candidates."""
        return Search(self.model, batch, None, self.n_candidates, admitted)

    def start(self) -> None:
        """Fit the declared model.

        Raises
        ------
        InputError
            If it cannot be integrated through the runs.
        """
        free = self.model.declared.free_positions
        self.fit = fit_batch(self.model, self.batch, [self.model.zero()], [free])[0]
        if not self.fit.usable:
            raise InputError(
                "The declared model cannot be integrated through the fitted runs: its stress runs "
                "away. Check its parameters, modes and units."
            )
        self.path = [self.fit.theta]
        self._leave_out()

    def advance(self) -> str | None:
        """Add the effect that earns its place, and return its name, or None."""
        attribution = attribute(
            self.model, self.batch, self.fit, self.active, LEADERS, self.admitted
        )
        choices = refit(self.model, self.batch, self.fit, attribution.leading, self.n_candidates)
        choices = [choice for choice in choices if self._predictable(choice.fit.theta)]
        chosen = choose(choices, self.left_out)
        self.rankings.append(_ordered([*attribution.leading, *attribution.rest]))
        if chosen is None:
            return None
        name = chosen.candidate.effect
        self.aliases[name] = chosen.candidate.aliases
        self.support[name] = chosen.candidate.evidence or 0.0
        kept = [*self.active, name]
        self.fit, self.active = prune(
            self.model, self.batch, chosen.fit, kept, self.n_candidates, self.settled
        )
        if len(self.active) < len(kept):
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
        self.fit = self._fit(self.active, other.fit.theta)
        self._fit_path()
        self._leave_out()

    def _fit(self, active: Sequence[str], values: np.ndarray) -> Fit:
        positions = [
            *self.model.declared.free_positions,
            *(p for name in active for p in self.model.positions(name)),
        ]
        start = self.model.zero()
        start[positions] = values[positions]
        return fit_batch(self.model, self.batch, [start], [positions])[0]

    def _fit_path(self) -> None:
        earlier = [self._fit(self.active[:n], self.fit.theta) for n in range(len(self.active))]
        self.path = [*(fit.theta for fit in earlier), self.fit.theta]

    def _leave_out(self) -> None:
        self.left_out = float(np.mean(leave_one_run_out(self.model, self.batch, self.fit)))

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
