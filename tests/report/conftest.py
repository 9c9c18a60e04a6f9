"""What the tests of reports share."""

import pytest
from fewer_hypotheses import without_pictures


@pytest.fixture
def no_pictures(monkeypatch):
    """Leave pictures out where only words are asked for."""
    without_pictures(monkeypatch)
