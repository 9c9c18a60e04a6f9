"""What the tests of reports share."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def no_pictures(monkeypatch):
    """Leave pictures of comparisons out where only words are asked for."""
    module = "discover.report.comparison.report.comparison_pictures"
    monkeypatch.setattr(module, lambda *_: ([], []))
