"""The search for effects: which are scored, refitted, taken, exchanged and taken out again."""

from discover.closed_loop.search.forward_search import Search

__all__ = ["Search"]
