"""The answer in words: its first line, and a few lines of text."""

from dataclasses import dataclass
from typing import Any

from discover.answer import modes_in_words, sentences
from discover.answer.error_table import errors
from discover.answer.fields import AnswerFields


@dataclass(frozen=True)
class Answer(AnswerFields):
    """Answer of a comparison, of a closed loop, of a fit: the law that one can use.

    Page, JSON, summary and text on the console are written from it.

    Examples
    --------
    >>> from discover.answer import Answer, Constant, Mode, Range
    >>> answer = Answer(
    ...     "Giesekus", "giesekus", (Constant("alpha", 0.2, (0.199, 0.201)),), (Mode(1.0, 1.0),),
    ...     error=0.01, noise=0.01, fits_to_the_noise=True,
    ...     range=Range((1.0, 2.0), (0.25, 1.0)),
    ... )
    >>> answer.headline.partition(". ")[0]
    'Giesekus, α = 0.200 (95 % CI 0.199–0.201)'
    >>> answer.adequate
    True
    """

    @property
    def headline(self) -> str:
        """First line: law, constants, how well it describes, where to use it."""
        return sentences.headline(self)

    @property
    def lines(self) -> list[str]:
        """Answer in a few lines of text, for a terminal and for headers of exported files."""
        found = [self.headline, *(one.text for one in errors(self) if self.title)]
        found += [modes_in_words.shifted(self), sentences.suspects(self), self.alternative]
        return [line for line in [*found, f"Next: {self.next_test}" * bool(self.next_test)] if line]


class HasAnswer:
    """A result with an `answer`, and what follows from it."""

    @property
    def answer(self) -> Answer:
        """The law that one can use."""
        raise NotImplementedError

    @property
    def use(self) -> dict[str, Any] | None:
        """What a simulation needs: law, constants, modes, range, expected error."""
        return self.answer.use

    @property
    def adequate(self) -> bool | None:
        """Whether the discrepancy is within the tolerance; None where nothing is said of it."""
        return self.answer.adequate
