"""Reports on results that a program holds, as the text of one page."""

import hashlib
import json
from pathlib import Path
from typing import Any

from discover.comparison.comparison import Comparison
from discover.loop.loop_result import LoopResult
from discover.report.comparison.report import write_comparison
from discover.report.loop.report import write_loop
from discover.report.page import made_by
from discover.study.run_folder import RunFolder

_PAGE = "report.html"


class _PageAlone(RunFolder):
    """Takes what a report writes and keeps the page; there is no folder."""

    def __init__(self, fingerprint: str):
        self.fingerprint = fingerprint
        self.page = ""

    def write(self, name: str, text: str) -> Path:
        if name == _PAGE:
            self.page = text
        return Path(name)


def comparison_page(comparison: Comparison) -> str:
    """Return the report on a comparison as one page."""
    kept = _PageAlone(_fingerprint(comparison.to_json()))
    relaxes = comparison.known is None or comparison.known.linear_relaxation
    run = made_by(kept.fingerprint, "discover.compare(...) in Python", (), "")
    write_comparison(comparison, kept, relaxes, run=run)
    return kept.page


def loop_page(result: LoopResult) -> str:
    """Return the report on a closed loop as one page."""
    kept = _PageAlone(_fingerprint(result.to_json()))
    run = made_by(kept.fingerprint, "discover.close_loop(...) in Python", (), "")
    write_loop(result, kept, result.title or "closed loop", result.described, run=run)
    return kept.page


def _fingerprint(content: dict[str, Any]) -> str:
    text = json.dumps(content, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]
