"""One look for all pictures, and SVG that follows the page between light and dark."""

import html
import io
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from jaxtyping import Bool, Float
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter

from discover.dataset.run_table import wave_of
from discover.learners.registry import LEARNERS

COLOURS = {
    "paper": ("#ffffff", "#16181b"),
    "ink": ("#1c1d1f", "#e8e9eb"),
    "soft": ("#5a5d63", "#a5a9b0"),
    "line": ("#d8dadd", "#3a3e44"),
    "card": ("#f5f6f7", "#1f2226"),
    "accent": ("#0072b2", "#56b4e9"),
    "truth": ("#1c1d1f", "#f2f3f5"),
    "before": ("#75787e", "#949aa2"),
    "sparse": ("#d55e00", "#ff8b3d"),
    "network": ("#0072b2", "#56b4e9"),
    "measured": ("#6b6e74", "#9da2aa"),
    "green": ("#009e73", "#2fc79c"),
    "purple": ("#b5558d", "#e39cc5"),
    "yellow": ("#b87f00", "#f0b840"),
    "grid": ("#e2e4e7", "#33373d"),
    "shade": ("#eef0f2", "#2c3138"),
}
"""Name of the CSS variable, without dashes → its value in light and in dark."""


def style_sheet() -> str:
    """Return the CSS that sets every colour, and changes it where a reader prefers the dark."""
    light, dark = (
        " ".join(f"--{name}:{pair[i]};" for name, pair in COLOURS.items()) for i in range(2)
    )
    # what is printed is printed on white, whatever the screen
    return (
        f":root {{ {light} }}\n"
        f"@media screen and (prefers-color-scheme: dark) {{ :root {{ {dark} }} }}"
    )


# Stand-ins, each a value of its own: CSS variables of the palette take their place where a picture
# follows light and dark.
_VARIABLES = {
    "#101112": "truth",
    "#909192": "before",
    "#d55e00": "sparse",
    "#0072b2": "network",
    "#707172": "measured",
    "#009e73": "green",
    "#cc79a7": "purple",
    "#e69f00": "yellow",
    "#202122": "ink",
    "#d0d1d2": "grid",
    "#e0e1e2": "shade",
}
TRUTH, BEFORE, SPARSE, NETWORK, MEASURED, GREEN, PURPLE, YELLOW, INK, GRID, SHADE = _VARIABLES

_EARLY = 0.1  # share of a run that holds half of its samples, were they spaced evenly 0.5
_DECADES = 30.0

_LEARNER_STYLES: dict[str, dict[str, Any]] = {
    "tensor_sindy": {"color": SPARSE, "linestyle": "--", "linewidth": 1.8},
    "tbnn_ude": {"color": NETWORK, "linestyle": ":", "linewidth": 2.2},
}
_OTHERS = (PURPLE, YELLOW, GREEN)  # Colours of learners of users' own, in their order

CHOSEN_STYLE: dict[str, Any] = {"color": SPARSE, "linestyle": "-"}
RIVAL_STYLES: tuple[dict[str, Any], ...] = (
    {"color": NETWORK, "linestyle": "--"},
    {"color": GREEN, "linestyle": "-."},
    {"color": PURPLE, "linestyle": ":"},
    {"color": YELLOW, "linestyle": (0, (5, 1))},
    {"color": BEFORE, "linestyle": (0, (1, 1))},
)
"""Of what the data do not tell from the law that was chosen, in its order."""

TRUTH_STYLE = {"color": TRUTH, "linewidth": 1.3}
BEFORE_STYLE = {"color": BEFORE, "linewidth": 1.0, "linestyle": "-."}

_SETTINGS = {
    "svg.fonttype": "none",
    "svg.hashsalt": "discover",
    "font.family": "sans-serif",
    "font.size": 9.0,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.titlesize": 9.5,
    "axes.titlecolor": INK,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "savefig.facecolor": "none",
    "legend.frameon": False,
    "axes.unicode_minus": True,
}


def learner_style(name: str) -> dict[str, Any]:
    """Return how the curves of a learner are drawn."""
    if name in _LEARNER_STYLES:
        return _LEARNER_STYLES[name]
    place = list(LEARNERS).index(name) if name in LEARNERS else 0
    colour = _OTHERS[place % len(_OTHERS)]
    return {"color": colour, "linestyle": (0, (5, 1, 1, 1)), "linewidth": 1.8}


def learner_colour(name: str) -> str:
    """Return the CSS variable that holds the colour of a learner."""
    return f"--{_VARIABLES[learner_style(name)['color']]}"


@dataclass(frozen=True)
class Picture:
    """A figure as SVG.

    `axes`: of each panel its box in the SVG's own units and the ends of its axes, for a page that
        reads values off: ``box`` (left, top, width, height), ``x`` and ``y`` (low, high,
        logarithmic). An axis of names has no ends.
    `switched`: names of curves that a page can hide; the elements of the i-th have ids
        ``run{i}-...``.
    """

    name: str  # file name without extension
    caption: str  # what it shows and how to read it
    svg: str  # a stand-alone SVG document
    axes: tuple[dict, ...] = ()
    switched: tuple[str, ...] = ()

    @property
    def inline(self) -> str:
        """The SVG for a page: colours by CSS variable, identifiers unique to this picture.

        For those who do not see it, it is an image named by its caption.
        """
        text = self._with_variables()
        prefix = re.sub(r"[^A-Za-z0-9]", "-", self.name)
        text = re.sub(r'\bid="', f'id="{prefix}-', text)
        text = text.replace("url(#", f"url(#{prefix}-").replace('href="#', f'href="#{prefix}-')
        text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.S)
        # the page decides the width
        for size in ("height", "width"):
            text = re.sub(rf'(<svg[^>]*?) {size}="[^"]*"', r"\1", text, count=1)
        description = html.escape(self.caption or self.name, quote=True)
        told = f'role="img" aria-label="{description}"'
        if self.axes:
            read = json.dumps({"axes": self.axes, "switched": self.switched})
            told += f' data-read="{html.escape(read, quote=True)}"'
        return text.replace("<svg ", f"<svg {told} ", 1)

    @property
    def adaptive(self) -> str:
        """The SVG as a file that follows light and dark by itself, for pages of others."""
        start = self.svg.index("<svg")
        text = self._with_variables()
        end = text.index(">") + 1
        title = f"<title>{html.escape(self.caption)}</title>"
        return f"{self.svg[:start]}{text[:end]}{title}<style>{style_sheet()}</style>{text[end:]}"

    def _with_variables(self) -> str:
        text = self.svg[self.svg.index("<svg") :]
        for colour, variable in _VARIABLES.items():
            text = text.replace(colour, f"var(--{variable})")
        return text


@contextmanager
def only_settings(settings: Mapping[str, Any]) -> Iterator[None]:
    """Draw with these settings and matplotlib's defaults, whatever the session or a file asked for.

    A ``matplotlibrc`` of the working directory may be anybody's, and a page is the same everywhere.
    """
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(settings)  # pyright: ignore[reportArgumentType, reportCallIssue]
        yield


@contextmanager
def figure(rows: int, columns: int, width: float = 9.0, height: float = 2.6) -> Iterator[tuple]:
    """Yield a figure and its axes, shape (rows, columns).

    The figure is not pyplot's: a notebook that writes a report keeps its own pictures and backend.

    `width`, `height`: of the whole figure and of one row, in inches.
    """
    with only_settings(_SETTINGS):
        drawing = Figure(figsize=(width, height * rows), layout="constrained")
        yield drawing, drawing.subplots(rows, columns, squeeze=False)


@contextmanager
def panels_of(
    count: int, columns: int = 4, width: float = 9.0, height: float = 2.6
) -> Iterator[tuple]:
    """Yield a figure, its axes, and `count` panels, so many side by side; the rest are hidden."""
    columns = min(columns, count)
    with figure(-(-count // columns), columns, width, height) as (drawing, axes):
        for panel in axes.ravel()[count:]:
            panel.set_visible(False)
        yield drawing, axes, axes.ravel()[:count]


Curve = tuple[Sequence[float] | np.ndarray, Sequence[float] | np.ndarray, Mapping[str, Any]]
"""Abscissae, ordinates, and the style of the line as `matplotlib.axes.Axes.plot` takes it."""


@dataclass(frozen=True)
class Panel:
    """What one panel shows.

    `settings`: labels, scales and limits, as `matplotlib.axes.Axes.set` takes them. `bands`: what
    is shaded, by abscissae, lower and upper ends, and the style of the shade.
    """

    curves: Sequence[Curve]
    settings: Mapping[str, Any]
    bands: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray, Mapping[str, Any]]] = ()


def row_of_panels(
    name: str, caption: str, panels: Sequence[Panel], width: float = 10.0, height: float = 3.2,
    columns: int = 4,
) -> "Picture":  # fmt: skip
    """Return a picture of panels side by side, with one legend of so many columns at most.

    `width`, `height`: in inches, of all of it and without the legend.
    """
    with figure(1, len(panels), width, height) as (drawing, axes):
        for panel, one in zip(axes[0], panels, strict=True):
            for along, low, high, style in one.bands:
                shade_between(panel, along, low, high, **style)
            for along, values, style in one.curves:
                panel.plot(along, values, **style)
            panel.set(**one.settings)
            if one.settings.get("xscale") == "log":
                panel.xaxis.set_minor_formatter(NullFormatter())
        legend_above(drawing, axes, columns)
        return picture(drawing, name, caption)


def label_rows(axes, labels: Sequence[str]) -> None:
    """Label the ordinates of panels once a row, and where something else is drawn than before."""
    for place, (panel, label) in enumerate(zip(axes.ravel(), labels, strict=False)):
        if place % axes.shape[1] == 0 or label != labels[place - 1]:
            panel.set_ylabel(label)


def legend_above(drawing: Figure, axes, columns: int = 4) -> None:
    """Put one legend for all panels above them, in as many columns as the figure is wide."""
    entries = {}
    for panel in axes.ravel():
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    for count in range(min(columns, len(entries)), 0, -1):
        legend = drawing.legend(
            list(entries.values()), list(entries), loc="outside upper center", ncols=count
        )
        if count == 1 or legend.get_window_extent().width <= drawing.bbox.width:
            return
        legend.remove()


def literal(text: str) -> str:
    """Return text from a file so that no part of it is taken for a formula."""
    return text.replace("$", r"\$")


def picture(drawing: Figure, name: str, caption: str, switched: tuple[str, ...] = ()) -> Picture:
    """Return the figure as SVG, the same bytes every time."""
    buffer = io.StringIO()
    # as savefig does, which draws once more before, to no effect on these figures
    canvas = FigureCanvasSVG(drawing)
    canvas.print_svg(buffer, metadata={"Date": None, "Creator": None})
    panels = tuple(_place_of(panel) for panel in drawing.axes if panel.get_visible())
    return Picture(name, caption, buffer.getvalue(), panels, switched)


def _place_of(panel) -> dict:
    """Return where a panel stands in the SVG, whose unit is the point, and between which values."""
    width, height = 72.0 * panel.figure.get_size_inches()
    box = panel.get_position()
    corner = (box.x0 * width, (1.0 - box.y1) * height, box.width * width, box.height * height)
    place: dict = {"box": [round(float(value), 2) for value in corner]}
    for axis, ends in ((panel.xaxis, panel.get_xlim()), (panel.yaxis, panel.get_ylim())):
        if not isinstance(axis.get_major_locator(), FixedLocator):  # names instead of numbers
            logarithmic = axis.get_scale() == "log"
            place[axis.axis_name] = [*(float(f"{end:.6g}") for end in ends), logarithmic]
    return place


def runs_through_decades(
    times: Float[np.ndarray, " n"], shear_rate: Float[np.ndarray, " n"]
) -> bool:
    """Whether logarithmic time is the natural axis: decades of it, at one rate or sampled so.

    A rate in 1/s that was measured rises before it is constant; samples that crowd at early times,
    in s, say the same.
    """
    positive = times[times > 0]
    if not positive.size or positive[-1] <= _DECADES * positive[0]:
        return False
    size = np.max(np.abs(shear_rate))
    constant = size > 0 and np.ptp(shear_rate) <= 1e-6 * size
    return bool(constant or np.median(positive) < _EARLY * positive[-1])


def make_logarithmic(axis) -> None:
    """Make an axis logarithmic, with labels at decades only."""
    axis.axes.set(**{f"{axis.axis_name}scale": "log"})
    axis.set_minor_formatter(NullFormatter())


# Ratio of the ends of a logarithmic axis below which decades alone do not say where one is
_FEW_DECADES = 20.0


def make_percentage(axis) -> None:
    """Make an axis of per cents logarithmic, with plain numbers; more of them where it is short."""
    make_logarithmic(axis)

    def between(value: float, position: int | None = None) -> str:
        low, high = axis.get_view_interval()
        # between 2 and 5 there may be no number that is either
        digits = "25" if high > 3.0 * low else "23456789"
        wanted = high < _FEW_DECADES * low and f"{value:e}"[0] in digits
        return f"{value:g}" if wanted else ""

    axis.set_major_formatter(FuncFormatter(lambda value, position: f"{value:g}"))
    axis.set_minor_formatter(FuncFormatter(between))


def last_cycle(
    times: Float[np.ndarray, " n"], shear_rate: Float[np.ndarray, " n"]
) -> Bool[np.ndarray, " n"] | None:
    """Return which samples lie in the last cycle of a rate, a little more so that it closes.

    `times`: in s, increasing. `shear_rate`: in 1/s. None where it does not oscillate.
    """
    wave = wave_of(times, shear_rate)
    return None if wave is None else times >= times[-1] - 1.02 * 2.0 * np.pi / wave[0]


def about_middle(
    strain: Float[np.ndarray, " n"], cycle: Bool[np.ndarray, " n"]
) -> Float[np.ndarray, " n"]:
    """Return the strain about the middle of the range that it has in a cycle."""
    return strain - 0.5 * (strain[cycle].max() + strain[cycle].min())


def shade_between(
    panel,
    along: Float[np.ndarray, " n"],
    low: Float[np.ndarray, " n"],
    high: Float[np.ndarray, " n"],
    **style,
) -> None:
    """Shade what lies between two curves, also where `along` goes back and forth.

    There a fill between the curves as a whole would shade the inside of a loop and a bar where it
    begins and ends, and not what the band sweeps.
    """
    if np.all(np.diff(along) >= 0.0):
        panel.fill_between(along, low, high, **style)
        return
    before, after = np.stack([along, low], axis=-1), np.stack([along, high], axis=-1)
    forth = np.stack([before[:-1], before[1:], after[1:], after[:-1], before[:-1]], axis=1)
    forth = forth[np.all(np.isfinite(forth), axis=(1, 2))]
    # all in one sense, for pieces of opposite senses that overlap would take each other out
    back = forth[:, 1, 0] < forth[:, 0, 0]
    forth[back] = forth[back, ::-1]
    codes = [Path.MOVETO, Path.LINETO, Path.LINETO, Path.LINETO, Path.CLOSEPOLY]
    path = Path(forth.reshape(-1, 2), codes * len(forth))
    panel.add_patch(PathPatch(path, **style))
