"""Pictures of a data folder as it was read: every test, and how tests agree with one another."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.ticker import EngFormatter

from discover.dataset import Dataset, LinearSweep, RelaxationSpectrum, Run
from discover.dataset.run_table import run_line
from discover.report.plots import style as look
from discover.report.plots.loop.runs import THOUSANDS, shortened
from discover.report.wording import percent
from discover.words import FIGURE_SYMBOLS, counted

_MOST_RUNS = 24  # Panels of runs, beyond which a page is too long to look through
_POINTS: dict[str, Any] = {"ls": "", "ms": 3.5, "mfc": "none", "mew": 0.9}
_MOST_POINTS = 300


def data_pictures(dataset: Dataset, spectrum: RelaxationSpectrum | None) -> list[look.Picture]:
    """Return what can be drawn of a data set, the tests that say most of the columns first."""
    drawn = [_runs(dataset.runs)] if len(dataset) else []
    sweep, tables = dataset.linear_sweep, dataset.material_functions
    if sweep is not None:
        drawn.append(_linear_sweep(sweep, spectrum))
    if "amplitude_sweep" in tables:
        drawn.append(_amplitude_sweep(tables["amplitude_sweep"], sweep))
    if "flow_curve" in tables:
        drawn.append(_flow_curve(tables["flow_curve"], sweep))
    if over_time := [tables[kind] for kind in ("relaxation", "creep") if kind in tables]:
        drawn.append(_over_time(over_time))
    return drawn


def _runs(runs: Sequence[Run]) -> look.Picture:
    shown = runs[:_MOST_RUNS]
    with look.panels_of(len(shown), width=10.0, height=2.1) as (drawing, axes, panels):
        for panel, run in zip(panels, shown, strict=True):
            _draw_run(panel, run)
        for panel in axes[-1]:
            panel.set_xlabel("time (s)")
        units = ["" if run.quantity == "strain" else " (Pa)" for run in shown]
        symbols = [FIGURE_SYMBOLS[run.quantity] for run in shown]
        look.label_rows(axes, [f"{one}{unit}" for one, unit in zip(symbols, units, strict=True)])
        look.legend_above(drawing, axes)
        more = f" The first {len(shown)} of {len(runs)} runs." if len(runs) > len(shown) else ""
        return look.picture(
            drawing,
            "runs",
            "Every run: what was recorded (left axes) and what was imposed (right axes, dashed: a "
            "rate in 1/s, or a stress in Pa)." + more,
        )


def _draw_run(panel, run: Run) -> None:
    every = slice(None, None, max(1, len(run) // _MOST_POINTS))
    time = run.time[every]
    given_stress = run.protocol.control == "stress"
    panel.plot(time, run.recorded[every], color=look.NETWORK, lw=1.4, label="recorded")
    for quantity, colour in zip(run.also_recorded, (look.SPARSE, look.GREEN), strict=False):
        values = run.observing(quantity).recorded[every]
        panel.plot(time, values, color=colour, lw=1.0, label=FIGURE_SYMBOLS[quantity])
    other = panel.twinx()
    imposed = run.stress if given_stress else run.rate
    other.plot(time, imposed[every], color=look.BEFORE, lw=1.0, ls="--", label="imposed")
    other.tick_params(axis="y", labelcolor=look.BEFORE, labelsize=6.5)
    other.grid(visible=False)
    panel.plot([], [], color=look.BEFORE, lw=1.0, ls="--", label="imposed")
    low, high = float(np.min(imposed)), float(np.max(imposed))
    if high - low <= 1e-6 * max(abs(low), abs(high)):
        size = abs(high) or 1.0
        # in the middle, so that it hides neither end of what was recorded
        other.set_ylim(high - size, high + size)
        other.set_yticks([high], [f"{high:.3g}"])
    if look.runs_through_decades(run.time, np.ones_like(run.time) if given_stress else run.rate):
        look.make_logarithmic(panel.xaxis)
    if float(np.max(np.abs(run.recorded))) > THOUSANDS:
        panel.yaxis.set_major_formatter(EngFormatter(sep=""))  # 200k
    panel.tick_params(labelsize=7)
    panel.set_title(f"{look.literal(shortened(run.name))}\n{run_line(run)['flow']}", fontsize=8)


_LOGARITHMIC = {"xscale": "log", "yscale": "log"}
_DOTTED = {"lw": 0.8, "ls": ":"}


def _moduli(along, storage, loss, suffix: str = "", **style: Any) -> list[look.Curve]:
    both = (("G′", storage, "o", look.NETWORK), ("G″", loss, "s", look.SPARSE))
    return [
        (along, values, {"color": colour, "marker": marker, "label": symbol + suffix, **style})
        for symbol, values, marker, colour in both
    ]


def _decades_where_positive(values: Float[np.ndarray, " n"]) -> dict[str, str]:
    """Return a logarithmic scale of ordinates, unless some have no place on it."""
    return {"yscale": "log"} if np.all(values > 0.0) else {}


def _linear_sweep(sweep: LinearSweep, spectrum: RelaxationSpectrum | None) -> look.Picture:
    omega = sweep.angular_frequency
    curves = _moduli(omega, *sweep.measured, **_POINTS)
    labels = {"xlabel": "ω (rad/s)", "ylabel": "G′, G″ (Pa)"}
    panels = [look.Panel(curves, {**_LOGARITHMIC, **labels})]
    caption = "lve.csv: G′ and G″ against frequency."
    if spectrum is not None:
        dense = np.geomspace(omega[0], omega[-1], 200)
        for values, colour in zip(spectrum.moduli(dense), (look.NETWORK, look.SPARSE), strict=True):
            curves.append((dense, values, {"color": colour, "lw": 1.0}))
        curves.append(([], [], {"color": look.BEFORE, "lw": 1.0, "label": "modes"}))
        times, moduli = spectrum.relaxation_time, spectrum.modulus
        ends = float(np.min(moduli)), float(np.max(moduli))
        edges = ([1.0 / edge] * 2 for edge in (omega[0], omega[-1]))
        modes: list[look.Curve] = [
            (edge, ends, {"color": look.BEFORE, **_DOTTED}) for edge in edges
        ]
        modes.append((times, moduli, {"color": look.GREEN, "marker": "D", **_POINTS}))
        labels = {"xlabel": "λ (s)", "ylabel": "G of each mode (Pa)"}
        panels.append(look.Panel(modes, {**_LOGARITHMIC, **labels}))
        caption += (
            f" Lines: the {counted(len(spectrum), 'mode')} found from it, off by "
            f"{percent(spectrum.relative_error)} (root mean square). Right: modulus and time of "
            "each; dotted, the ends of the sweep, beyond which it says nothing of them."
        )
    return look.row_of_panels("linear_sweep", caption, panels)


def _amplitude_sweep(run: Run, sweep: LinearSweep | None) -> look.Picture:
    assert run.strain is not None
    assert run.storage_modulus is not None
    assert run.loss_modulus is not None
    omega, strain = run.angular_frequency, run.strain
    groups = np.unique(np.round(omega, 9))
    curves: list[look.Curve] = []
    for value in groups:
        at = np.isclose(omega, value)
        suffix = f", {value:.3g} rad/s" if len(groups) < 4 else ""
        style = {**_POINTS, "ls": "-", "lw": 0.6}
        moduli = run.storage_modulus[at], run.loss_modulus[at]
        curves += _moduli(strain[at], *moduli, suffix, **style)
    caption = "amplitude_sweep.csv: the moduli of the first harmonic against strain amplitude."
    if sweep is not None:
        edges = sweep.angular_frequency
        inside = groups[(groups >= edges[0]) & (groups <= edges[-1])]
        ends = float(np.min(strain)), float(np.max(strain))
        for values, colour in zip(sweep.measured, (look.NETWORK, look.SPARSE), strict=True):
            for level in np.interp(np.log(inside), np.log(edges), values):
                curves.append((ends, [level, level], {"color": colour, **_DOTTED}))
        caption += " Dotted: lve.csv at these frequencies, which small strains should meet."
    scale = _decades_where_positive(np.concatenate([run.storage_modulus, run.loss_modulus]))
    labels = {"xlabel": "strain amplitude γ₀", "ylabel": "G′, G″ (Pa)"}
    panel = look.Panel(curves, {"xscale": "log", **scale, **labels})
    return look.row_of_panels("amplitude_sweep", caption, [panel])


def _flow_curve(run: Run, sweep: LinearSweep | None) -> look.Picture:
    marked = {"color": look.NETWORK, "marker": "o", **_POINTS}
    stresses: list[look.Curve] = [(run.rate, run.stress, {**marked, "label": "σ₁₂"})]
    for quantity, colour in zip(run.also_recorded, (look.SPARSE, look.GREEN), strict=False):
        style = {"color": colour, "marker": "^", "label": FIGURE_SYMBOLS[quantity], **_POINTS}
        stresses.append((run.rate, run.observing(quantity).recorded, style))
    steady = run.stress / run.rate
    viscosities: list[look.Curve] = [(run.rate, steady, {**marked, "label": "η = σ₁₂/γ̇"})]
    caption = "flow_curve.csv: steady stress, and steady viscosity (right)."
    if sweep is not None:
        size = np.hypot(*sweep.measured) / sweep.angular_frequency
        style = {"color": look.GREEN, "lw": 1.2, "label": "|η*| of lve.csv"}
        viscosities.append((sweep.angular_frequency, size, style))
        caption += (
            " Right, the complex viscosity at ω equal to the shear rate: most melts and solutions "
            "follow it (Cox and Merz 1958); a constant factor between the two is a unit or a "
            "loading, and gels and suspensions need not follow it."
        )
    scales = {"xscale": "log", **_decades_where_positive(run.stress)}
    left = {**scales, "xlabel": "shear rate (1/s)", "ylabel": "stress (Pa)"}
    right = {**scales, "xlabel": "γ̇ (1/s) or ω (rad/s)", "ylabel": "viscosity (Pa s)"}
    return look.row_of_panels(
        "flow_curve", caption, [look.Panel(stresses, left), look.Panel(viscosities, right)]
    )


def linear_function(run: Run) -> tuple[str, Float[np.ndarray, " n"], str]:
    """Return symbol, values and unit of a linear function in time, as its file holds it."""
    if run.quantity == "strain":
        return "J", run.recorded / run.stress, "1/Pa"
    return "G", run.recorded / np.asarray(run.strain), "Pa"


def _over_time(runs: Sequence[Run]) -> look.Picture:
    panels = []
    for run in runs:
        symbol, values, unit = linear_function(run)
        labels = {
            "xlabel": "time (s)",
            "ylabel": f"{symbol} ({unit})",
            "title": look.literal(run.name),
        }
        curve = run.time, values, {"color": look.NETWORK, "marker": "o", **_POINTS}
        panels.append(look.Panel([curve], {**_LOGARITHMIC, **labels}))
    caption = "Linear material functions in time, as they were read."
    return look.row_of_panels("over_time", caption, panels, width=5.0 * len(runs))
