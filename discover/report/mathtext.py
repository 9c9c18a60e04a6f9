"""LaTeX of effects as SVG, for formulas that come as text."""

import html
import io
import re

from matplotlib.figure import Figure

from discover.equations.markup import plain
from discover.report.plots.style import INK, Picture, only_settings

_REPLACEMENTS = (
    (r"\mathrel{+}=", r"\,+\!=\,"),
    (r"\mathrel{-}=", r"\,-\!=\,"),
    (r"\operatorname{tr}", r"\mathrm{tr}\,"),
    (r"\operatorname", r"\mathrm"),
    (r"\tfrac", r"\frac"),
    (r"\dfrac", r"\frac"),
    (r"\boldsymbol", r"\mathbf"),
    (r"\bm", r"\mathbf"),
    (r"\text{", r"\mathrm{"),
    (r"\;", r"\ "),
)


_TEXT = 12.0  # Size of text in points


def formula(latex: str, name: str, size: float = _TEXT) -> str:
    """Return a formula as inline SVG, or in plain signs where matplotlib cannot set it.

    `latex`: without dollar signs. `name`: unique on the page. `size`: of letters in points; larger
    than text, fractions are displayed.
    """
    text = latex.strip().strip("$")
    for old, new in _REPLACEMENTS:
        text = text.replace(old, new)
    text = text.replace(r"\frac", r"\dfrac") if size > _TEXT else text
    buffer = io.StringIO()
    try:
        with only_settings({"svg.fonttype": "path", "svg.hashsalt": "discover"}):
            drawing = Figure(figsize=(0.01, 0.01))
            drawing.text(0, 0, f"${text}$", fontsize=size, color=INK)
            drawing.savefig(
                buffer,
                format="svg",
                bbox_inches="tight",
                pad_inches=0.02,
                transparent=True,
                metadata={"Date": None, "Creator": None},
            )
    except (ValueError, RuntimeError):
        return f"<code>{html.escape(plain(latex))}</code>"
    # matplotlib leaves the source in a comment
    drawn = re.sub(r"<!--.*?-->", "", buffer.getvalue(), flags=re.S)
    picture = Picture(name, plain(latex), drawn)
    height = picture.svg.split('height="')[1].split('"')[0]
    return picture.inline.replace("<svg ", f'<svg class="formula" style="height:{height}" ', 1)
