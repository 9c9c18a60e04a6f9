"""LaTeX of effects as SVG, for formulas that come as text."""

import html
import io

import matplotlib as mpl
from matplotlib.figure import Figure

from discover.report.plots.style import INK, Picture

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
    (r"\left", ""),
    (r"\right", ""),
    (r"\;", r"\ "),
)


def formula(latex: str, name: str) -> str:
    """Return a formula as inline SVG, or as its source where matplotlib cannot set it.

    Parameters
    ----------
    latex
        Without dollar signs.
    name
        Unique on the page.
    """
    text = latex.strip().strip("$")
    for old, new in _REPLACEMENTS:
        text = text.replace(old, new)
    drawing = Figure(figsize=(0.01, 0.01))
    try:
        drawing.text(0, 0, f"${text}$", fontsize=12, color=INK)
        buffer = io.StringIO()
        with mpl.rc_context({"svg.fonttype": "path", "svg.hashsalt": "discover"}):
            drawing.savefig(
                buffer,
                format="svg",
                bbox_inches="tight",
                pad_inches=0.02,
                transparent=True,
                metadata={"Date": None, "Creator": None},
            )
    except (ValueError, RuntimeError):
        return f"<code>{html.escape(latex)}</code>"
    picture = Picture(name, latex, buffer.getvalue())
    height = picture.svg.split('height="')[1].split('"')[0]
    return picture.inline.replace("<svg ", f'<svg class="formula" style="height:{height}" ', 1)
