"""The command ``discover``."""

from discover.cli.app import app, main

__all__ = ["app", "main"]
