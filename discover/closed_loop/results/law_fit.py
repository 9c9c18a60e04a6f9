"""A named law fitted to the runs, beside others of which one is chosen."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from discover.closed_loop.results.error_pair import ErrorPair
from discover.laws import LAWS


@dataclass(frozen=True)
class LawFit:
    """A named law fitted to the runs, with the modes and the instrument of the declared model.

    Attributes
    ----------
    law
        Key of `LAWS`.
    parameters
        Its constants.
    at_end
        Those of them that a fit drove to an end of their range, where they are no finding.
    error
        Mean relative errors of the runs fitted and held out; None where it cannot be integrated
        through the fitted ones.
    behind
        By how much its information criterion is above that of the best law; None likewise.
    is_told_apart
        Whether the runs tell it from the best law: whether it fits them worse. One that fits as
        well and is passed over for its further constants is not told apart.
    """

    law: str
    parameters: Mapping[str, float]
    at_end: tuple[str, ...] = ()
    error: ErrorPair | None = None
    behind: float | None = None
    is_told_apart: bool = True

    @property
    def title(self) -> str:
        """Name as a rheologist writes it, with the constants."""
        return LAWS[self.law].described(self.parameters)

    def to_json(self) -> dict[str, Any]:
        """Return the fit as ``loop.json`` holds it."""
        return {**asdict(self), "title": LAWS[self.law].title}
