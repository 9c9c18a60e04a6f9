"""Whether a page needs anything but itself, and runs nothing but the script of this package."""

import re
from pathlib import Path

import discover.report

TEMPLATES = Path(discover.report.__file__).parent / "templates"
SCRIPT = (TEMPLATES / "figures.js").read_text("utf-8").removesuffix("\n")
BESIDE = ("predictions.csv", "comparison.json", "loop.json")


def stands_alone(text: str) -> bool:
    """Return whether nothing is loaded and no script but ours runs; data are no script."""
    outside = set(re.findall(r"""(?:src|href)\s*=\s*["'](?!#)([^"']*)""", text)) - {*BESIDE}
    text = re.sub(r'<script type="application/json" [^>]*>[^<]*</script>', "", text)
    text = text.replace(f"<script>{SCRIPT}</script>", "", 1)
    asks = ("url(http", "@import", "<script", "fetch(", "XMLHttpRequest", "eval(")
    return not outside and not any(one in text for one in asks)
