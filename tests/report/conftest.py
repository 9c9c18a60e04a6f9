"""What the tests of reports share."""

import pytest


@pytest.fixture
def no_pictures(monkeypatch):
    """Leave pictures of comparisons out where only words are asked for."""
    module = "discover.report.comparison.report.comparison_pictures"
    monkeypatch.setattr(module, lambda *_: ([], []))
