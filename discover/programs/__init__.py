"""Functions as programs: compiled by JAX, and in lanes as machine code that starts share."""

import discover.compilation_cache  # noqa: F401  before equinox, see there: no call back, so it can be kept
from discover.programs.compiler import compiled, in_threads, on_device

__all__ = ["compiled", "in_threads", "on_device"]
