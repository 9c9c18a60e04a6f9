"""What a search for effects knows between two stages."""

import numpy as np

from discover.closed_loop.results.candidate_score import CandidateScore
from discover.closed_loop.search.seen_sets import SeenSets
from discover.forward import AugmentedModel
from discover.inference.by_mode.degrees import Degree
from discover.inference.least_squares import Fit


class SearchState:
    """The state of a search, before its first stage.

    Parameters
    ----------
    model
        The declared model with all candidates; it does not change.

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
    established
        Effects that small strains showed.
    known
        Mean and standard deviation of parameters determined there, by position.
    rounds
        How often the whole was examined again.
    not_named
        Effects that fitted best only with a value that they cannot have, or that the data leave
        open; and why, in a sentence without its stop.
    refused
        Those of them that were in the model and are no candidates any more.
    left_open
        Those of them of which nothing but the data's silence about a constant speaks.
    seen
        Every set of effects that was fitted.
    without_aliases
        Effects whose aliases were found beside others than those that are in the model now.
    degrees
        Degree in log λ of each constant by mode, and the evidence for each degree.
    least_degrees
        Degrees below which none of them is taken, by name.
    """

    fit: Fit  # the first stage makes it

    def __init__(self, model: AugmentedModel):
        self.model = model
        self.rounds = 0
        self.active: list[str] = []
        self.established: tuple[str, ...] = ()
        self.rankings: list[tuple[CandidateScore, ...]] = []
        self.aliases: dict[str, tuple[str, ...]] = {}
        self.support: dict[str, float] = {}
        self.path: list[np.ndarray] = []
        self.left_out = float("inf")
        self.known: dict[int, tuple[float, float]] = {}
        self.not_named: dict[str, str] = {}
        self.refused: set[str] = set()
        self.left_open: set[str] = set()
        self.without_aliases: set[str] = set()
        self.seen = SeenSets()
        self.degrees = {name: Degree() for name in model.declared.by_mode}
        self.least_degrees: dict[str, int] = {}
