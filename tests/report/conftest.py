"""What the tests of reports share."""

import pytest
from fewer_hypotheses import without_pictures


@pytest.fixture
def no_pictures(monkeypatch):
    without_pictures(monkeypatch)


@pytest.fixture
def loop_page(tmp_path, no_pictures):
    """Return what writes the page of a loop, without pictures, and gives its text."""
    from discover.report.loop import write_loop
    from discover.study import RunFolder

    def written(result):
        folder = RunFolder(tmp_path, "x", overwrite=True)
        return write_loop(result, folder, "n", "d").read_text("utf-8")

    return written
