"""Factors on the records of loadings: how large they are, and whether too large for loadings."""

from collections.abc import Sequence
from dataclasses import dataclass

from scipy.stats import chi2

from discover.words import percent_of

TOO_FAR = 1e-3
"""Probability of factors so large, among loadings that differ as is said, up to which the model is
refuted. What is said is a guess, so that one in a hundred does not do."""

ADVICE = "repeat a run on a new loading, which tells by how much loadings differ"


@dataclass(frozen=True)
class LoadingFound:
    """The factor of one loading.

    Attributes
    ----------
    run
        Name of the run.
    held_out
        Whether no fit saw it; the factor is fitted to it all the same.
    factor, ci95
        On its record, and the 95 % interval; None where how uncertain the law is is not known.
    deviations
        By how many standard deviations of loadings, noise and constants together the factor that
        fits best differs from one.
    """

    run: str
    held_out: bool
    factor: float
    ci95: tuple[float, float] | None
    deviations: float


def too_far(found: Sequence[LoadingFound]) -> LoadingFound | None:
    """Return the farthest factor if all together are larger than loadings differ by, else None.

    Parameters
    ----------
    found
        The factors of all runs, each in units of what loadings are said to differ by.
    """
    sets = [[one for one in found if one.held_out is held] for held in (False, True)]
    chances = [chi2.sf(sum(one.deviations**2 for one in s), len(s)) for s in sets if s]
    if not chances or len(chances) * min(chances) > TOO_FAR:
        return None
    return max(found, key=lambda one: one.deviations)


def as_too_far(worst: LoadingFound, deviation: float, model: str = "the model") -> str:
    """Return in words that factors are larger than loadings differ by."""
    return (
        "loadings would have to differ by more than they are said to, "
        f"{percent_of(deviation)}: {worst.run} is read as {worst.factor:.3g} times {model}. What "
        "differs so from run to run may be the law"
    )
