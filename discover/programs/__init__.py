"""Compiled programs that a later start finds again without tracing them anew."""

import discover.compilation_cache  # noqa: F401  before equinox, see there: no call back, so it can be kept
from discover.programs.program_cache import compiled, forget_programs
from discover.programs.threads import in_threads, on_device

__all__ = ["compiled", "forget_programs", "in_threads", "on_device"]
