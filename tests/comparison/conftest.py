"""What the tests of comparisons share."""

import sys
from pathlib import Path

import pytest

# data behind an instrument, made by scipy
sys.path.append(str(Path(__file__).parent))


@pytest.fixture
def verdict_alone(monkeypatch):
    """Leave out what stands beside the verdict of a comparison, and has tests of its own."""
    from discover.comparison import judgement, learning
    from discover.comparison.judging.next_measurement import NextMeasurement

    nothing = judgement._Beside((), None, ())
    monkeypatch.setattr(judgement, "_beside", lambda *_: nothing)
    monkeypatch.setattr(judgement, "next_measurement", lambda *_: NextMeasurement())
    monkeypatch.setattr(learning, "physics_of", lambda *_: {"checks": []})
