"""Room for programs: a system lets a process hold only so many pieces of mapped memory."""

import gc
from pathlib import Path

import jax

_PIECES = Path("/proc/self/maps")  # on Linux; other systems have no such limit
_LIMIT = Path("/proc/sys/vm/max_map_count")
_SHARE = 0.5  # of the limit: the rest is for programs that are made before the next look


def is_crowded() -> bool:
    """Return whether this process has mapped half of the pieces of memory that it may.

    Each compiled program takes some twenty. A process that goes on past the limit (65,530 by
    default, some fifteen comparisons of unlike studies) is ended by the compiler without an error.
    """
    try:
        with _PIECES.open("rb") as pieces:
            return sum(1 for _ in pieces) > _SHARE * int(_LIMIT.read_text())
    except (OSError, ValueError):
        return False


def drop_all() -> None:
    """Drop every program that this process holds; those in use stay until they end."""
    jax.clear_caches()
    gc.collect()
