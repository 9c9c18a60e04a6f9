"""Parts of a page, each drawn by itself: a sentence stands for one that cannot be drawn."""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

_log = logging.getLogger(__name__)
_LONGEST = 200

Part = TypeVar("Part")


@dataclass(frozen=True)
class Missing:
    """A part of a page that could not be drawn."""

    title: str  # the part, as the subject of a sentence
    reason: str  # what went wrong

    @property
    def sentence(self) -> str:
        """What the page says in place of the part."""
        return f"{self.title} could not be drawn: {self.reason}."


def attempt(title: str, draw: Callable[[], Part]) -> Part | Missing:
    """Return a part of a page, or what stands in its place where it cannot be drawn.

    A report comes after minutes or hours of computing, and its numbers lie in JSON already. No
    fault of one picture or table is worth the rest of the page. The logger of this module has the
    traceback, at level debug.

    `title`: the part, as the subject of a sentence. `draw`: makes it.
    """
    try:
        return draw()
    except Exception as error:
        _log.debug("%s could not be drawn", title, exc_info=True)
        text = " ".join(str(error).split())[:_LONGEST].rstrip(". ")
        return Missing(title, f"{type(error).__name__}, {text}" if text else type(error).__name__)
