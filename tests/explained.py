"""The posterior of a problem by a search of the engine, without what commands do around it."""

from discover.inference import Posterior, Problem
from discover.inference.fits import Fitter
from discover.inference.posterior import posterior_of
from discover.inference.search import Search


def explain(problem: Problem, most: int = 3) -> Posterior:
    """Return the posterior of a problem, hypotheses being sets of up to so many effects."""
    return posterior_of(Search(Fitter(problem, problem.fitted), most).run())
