"""Compiled programs that a later start finds again without tracing them anew."""

from discover.programs.kept import compiled, forget_programs

__all__ = ["compiled", "forget_programs"]
