"""Pictures of a data folder as it was read: every test, and how tests agree with one another."""

from collections.abc import Iterator, Sequence

import numpy as np
from jaxtyping import Float
from matplotlib.ticker import EngFormatter

from discover.dataset.dataset import Dataset
from discover.dataset.linear.linear_tests import CREEP, RELAXATION, SWEEP
from discover.dataset.linear.superposition import Superposition
from discover.dataset.linear_viscoelasticity import LinearSweep, RelaxationSpectrum
from discover.dataset.run import Run
from discover.dataset.run_table import run_line
from discover.report.plots.loop.runs import THOUSANDS, shortened
from discover.report.plots.style import (
    BEFORE,
    GREEN,
    NETWORK,
    SPARSE,
    Picture,
    figure,
    label_rows,
    legend_above,
    literal,
    make_logarithmic,
    panels_of,
    picture,
    runs_through_decades,
)
from discover.report.wording import percent
from discover.statistics import HALF_BAND
from discover.words import FIGURE_SYMBOLS, counted

_MOST_RUNS = 24
"""Panels of runs, beyond which a page is too long to look through."""

_POINTS = {"ls": "", "ms": 3.5, "mfc": "none", "mew": 0.9}
_MOST_POINTS = 300


def data_pictures(dataset: Dataset, spectrum: RelaxationSpectrum | None) -> list[Picture]:
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


def _runs(runs: Sequence[Run]) -> Picture:
    shown = runs[:_MOST_RUNS]
    with panels_of(len(shown), width=10.0, height=2.1) as (drawing, axes, panels):
        for panel, run in zip(panels, shown, strict=True):
            _draw_run(panel, run)
        for panel in axes[-1]:
            panel.set_xlabel("time (s)")
        units = ["" if run.quantity == "strain" else " (Pa)" for run in shown]
        symbols = [FIGURE_SYMBOLS[run.quantity] for run in shown]
        label_rows(axes, [f"{one}{unit}" for one, unit in zip(symbols, units, strict=True)])
        legend_above(drawing, axes)
        more = f" The first {len(shown)} of {len(runs)} runs." if len(runs) > len(shown) else ""
        return picture(
            drawing,
            "runs",
            "Every run: what was recorded (left axes) and what was imposed (right axes, dashed: a "
            "rate in 1/s, or a stress in Pa)." + more,
        )


def _draw_run(panel, run: Run) -> None:
    every = slice(None, None, max(1, len(run) // _MOST_POINTS))
    time = run.time[every]
    given_stress = run.protocol.control == "stress"
    panel.plot(time, run.recorded[every], color=NETWORK, lw=1.4, label="recorded")
    for quantity, colour in zip(run.beside, (SPARSE, GREEN), strict=False):
        values = run.observing(quantity).recorded[every]
        panel.plot(time, values, color=colour, lw=1.0, label=FIGURE_SYMBOLS[quantity])
    other = panel.twinx()
    imposed = run.stress if given_stress else run.rate
    other.plot(time, imposed[every], color=BEFORE, lw=1.0, ls="--", label="imposed")
    other.tick_params(axis="y", labelcolor=BEFORE, labelsize=6.5)
    other.grid(visible=False)
    panel.plot([], [], color=BEFORE, lw=1.0, ls="--", label="imposed")
    low, high = float(np.min(imposed)), float(np.max(imposed))
    if high - low <= 1e-6 * max(abs(low), abs(high)):
        size = abs(high) or 1.0
        # in the middle, so that it hides neither end of what was recorded
        other.set_ylim(high - size, high + size)
        other.set_yticks([high], [f"{high:.3g}"])
    if runs_through_decades(run.time, np.ones_like(run.time) if given_stress else run.rate):
        make_logarithmic(panel.xaxis)
    if float(np.max(np.abs(run.recorded))) > THOUSANDS:
        panel.yaxis.set_major_formatter(EngFormatter(sep=""))  # 200k
    panel.tick_params(labelsize=7)
    panel.set_title(f"{literal(shortened(run.name))}\n{run_line(run)['flow']}", fontsize=8)


def _moduli(panel, along, storage, loss, suffix: str = "", **style) -> None:
    for symbol, values, marker, colour in (
        ("G′", storage, "o", NETWORK),
        ("G″", loss, "s", SPARSE),
    ):
        panel.plot(along, values, color=colour, marker=marker, label=symbol + suffix, **style)


def _linear_sweep(sweep: LinearSweep, spectrum: RelaxationSpectrum | None) -> Picture:
    omega = sweep.angular_frequency
    with figure(1, 2, width=10.0, height=3.2) as (drawing, axes):
        panel, modes = axes[0]
        _moduli(panel, omega, sweep.storage_modulus, sweep.loss_modulus, **_POINTS)
        panel.set(xscale="log", yscale="log", xlabel="ω (rad/s)", ylabel="G′, G″ (Pa)")
        caption = "lve.csv: G′ and G″ against frequency."
        if spectrum is None:
            modes.set_visible(False)
        else:
            dense = np.geomspace(omega[0], omega[-1], 200)
            for values, colour in zip(spectrum.moduli(dense), (NETWORK, SPARSE), strict=True):
                panel.plot(dense, values, color=colour, lw=1.0)
            panel.plot([], [], color=BEFORE, lw=1.0, label="modes")
            modes.plot(
                spectrum.relaxation_time, spectrum.modulus, color=GREEN, marker="D", **_POINTS
            )
            modes.set(xscale="log", yscale="log", xlabel="λ (s)", ylabel="G of each mode (Pa)")
            for edge in (1.0 / omega[0], 1.0 / omega[-1]):
                modes.axvline(edge, color=BEFORE, lw=0.8, ls=":")
            caption += (
                f" Lines: the {counted(len(spectrum), 'mode')} found from it, off by "
                f"{percent(spectrum.relative_error)} (root mean square). Right: modulus and time "
                "of each; dotted, the ends of the sweep, beyond which it says nothing of them."
            )
        legend_above(drawing, axes)
        return picture(drawing, "linear_sweep", caption)


def _amplitude_sweep(run: Run, sweep: LinearSweep | None) -> Picture:
    assert run.strain is not None
    assert run.storage_modulus is not None
    assert run.loss_modulus is not None
    omega = run.angular_frequency
    with figure(1, 1, width=10.0, height=3.2) as (drawing, axes):
        panel = axes[0, 0]
        groups = np.unique(np.round(omega, 9))
        for value in groups:
            at = np.isclose(omega, value)
            suffix = f", {value:.3g} rad/s" if len(groups) < 4 else ""
            style = {**_POINTS, "ls": "-", "lw": 0.6}
            moduli = run.storage_modulus[at], run.loss_modulus[at]
            _moduli(panel, run.strain[at], *moduli, suffix, **style)
        caption = "amplitude_sweep.csv: the moduli of the first harmonic against strain amplitude."
        if sweep is not None:
            edges = sweep.angular_frequency
            inside = groups[(groups >= edges[0]) & (groups <= edges[-1])]
            for values, colour in ((sweep.storage_modulus, NETWORK), (sweep.loss_modulus, SPARSE)):
                levels = np.interp(np.log(inside), np.log(edges), values)
                for level in levels:
                    panel.axhline(level, color=colour, lw=0.8, ls=":")
            caption += " Dotted: lve.csv at these frequencies, which small strains should meet."
        panel.set(xscale="log", xlabel="strain amplitude γ₀", ylabel="G′, G″ (Pa)")
        _decades_where_positive(panel, np.concatenate([run.storage_modulus, run.loss_modulus]))
        legend_above(drawing, axes)
        return picture(drawing, "amplitude_sweep", caption)


def _decades_where_positive(panel, values: Float[np.ndarray, " n"]) -> None:
    """Make the axis of values logarithmic, unless some have no place on it."""
    if np.all(values > 0.0):
        panel.set_yscale("log")


def _flow_curve(run: Run, sweep: LinearSweep | None) -> Picture:
    with figure(1, 2, width=10.0, height=3.2) as (drawing, axes):
        panel, viscosity = axes[0]
        panel.plot(run.rate, run.stress, color=NETWORK, marker="o", label="σ₁₂", **_POINTS)
        for quantity, colour in zip(run.beside, (SPARSE, GREEN), strict=False):
            values = run.observing(quantity).recorded
            panel.plot(
                run.rate,
                values,
                color=colour,
                marker="^",
                label=FIGURE_SYMBOLS[quantity],
                **_POINTS,
            )
        panel.set(xscale="log", xlabel="shear rate (1/s)", ylabel="stress (Pa)")
        _decades_where_positive(panel, run.stress)
        viscosity.plot(
            run.rate, run.stress / run.rate, color=NETWORK, marker="o", label="η = σ₁₂/γ̇", **_POINTS
        )
        caption = "flow_curve.csv: steady stress, and steady viscosity (right)."
        if sweep is not None:
            omega = sweep.angular_frequency
            size = np.hypot(sweep.storage_modulus, sweep.loss_modulus) / omega
            viscosity.plot(omega, size, color=GREEN, lw=1.2, label="|η*| of lve.csv")
            caption += (
                " Right, the complex viscosity at ω equal to the shear rate: most melts and "
                "solutions follow it (Cox and Merz 1958); a constant factor between the two is a "
                "unit or a loading, and gels and suspensions need not follow it."
            )
        viscosity.set(xscale="log", xlabel="γ̇ (1/s) or ω (rad/s)", ylabel="viscosity (Pa s)")
        _decades_where_positive(viscosity, run.stress)
        legend_above(drawing, axes)
        return picture(drawing, "flow_curve", caption)


def linear_function(run: Run) -> tuple[str, Float[np.ndarray, " n"], str]:
    """Return symbol, values and unit of a linear function in time, as its file holds it."""
    if run.quantity == "strain":
        return "J", run.recorded / run.stress, "1/Pa"
    return "G", run.recorded / np.asarray(run.strain), "Pa"


def _over_time(runs: Sequence[Run]) -> Picture:
    with figure(1, len(runs), width=5.0 * len(runs), height=3.0) as (drawing, axes):
        for panel, run in zip(axes[0], runs, strict=True):
            symbol, values, unit = linear_function(run)
            panel.plot(run.time, values, color=NETWORK, marker="o", **_POINTS)
            panel.set(
                xscale="log",
                yscale="log",
                xlabel="time (s)",
                ylabel=f"{symbol} ({unit})",
                title=literal(run.name),
            )
        return picture(
            drawing, "over_time", "Linear material functions in time, as they were read."
        )


_MARKERS = "os^vD<>ph*"
_SHIFTED_POINTS = {"ls": "", "ms": 3.5, "mfc": "none", "mew": 0.8}
_TABLES = {RELAXATION: ("G/b_T (Pa)", NETWORK), CREEP: ("J b_T (1/Pa)", SPARSE)}
_LINES = {"WLF": ("-", NETWORK), "Arrhenius": ("--", SPARSE)}


def superposition_pictures(found: Superposition) -> list[Picture]:
    """Return the pictures of a superposition."""
    pictures = [_overlap(found), _van_gurp(found)] if SWEEP in found.tests else []
    if any(kind != SWEEP for kind in found.tests):
        pictures.append(_functions_over_time(found))
    return [*pictures, _shifts(found)]


def _labels(found: Superposition) -> list[tuple[str, str]]:
    return [
        (f"{degrees:g} °C", _MARKERS[i % len(_MARKERS)]) for i, degrees in enumerate(found.celsius)
    ]


def _marked(found: Superposition, kind: str) -> Iterator[tuple[float, str, str]]:
    """Yield temperature, label and marker of the moved tests of a kind."""
    for degrees, (label, marker) in zip(found.celsius.tolist(), _labels(found), strict=True):
        if degrees in found.tests[kind]:
            yield degrees, label, marker


def _overlap(found: Superposition) -> Picture:
    with figure(1, 2, width=10.0, height=3.8) as (drawing, axes):
        for degrees, label, marker in _marked(found, SWEEP):
            moved = found.moved(SWEEP, degrees).sweep
            for panel, values, colour in (
                (axes[0, 0], moved.storage_modulus, NETWORK),
                (axes[0, 1], moved.loss_modulus, SPARSE),
            ):
                style = {**_SHIFTED_POINTS, "marker": marker, "color": colour}
                panel.plot(moved.angular_frequency, values, label=label, **style)
        for panel, symbol in zip(axes[0], ("G′", "G″"), strict=True):
            panel.set(yscale="log", xlabel="ω a_T (rad/s)", ylabel=f"{symbol}/b_T (Pa)")
            make_logarithmic(panel.xaxis)
        if len(found.celsius) <= 10:
            handles, labels = axes[0, 0].get_legend_handles_labels()
            drawing.legend(handles, labels, loc="outside upper center", ncols=5)
        caption = f"All sweeps as at {found.reference:g} °C, a mark for each temperature."
        return picture(drawing, "overlap", caption)


def _van_gurp(found: Superposition) -> Picture:
    with figure(1, 2, width=10.0, height=3.4) as (drawing, axes):
        for degrees, _, marker in _marked(found, SWEEP):
            storage, loss = found.tests[SWEEP][degrees].values
            style = {**_SHIFTED_POINTS, "marker": marker, "color": NETWORK}
            axes[0, 0].plot(np.hypot(storage, loss), np.degrees(np.arctan2(loss, storage)), **style)
            axes[0, 1].plot(storage, loss, **style)
        axes[0, 0].set(xscale="log", xlabel="|G*| (Pa)", ylabel="δ (°)")
        axes[0, 1].set(xscale="log", yscale="log", xlabel="G′ (Pa)", ylabel="G″ (Pa)")
        caption = (
            "As measured, without any shift: phase angle against complex modulus (van Gurp and "
            "Palmen 1998), and G″ against G′ (Cole and Cole). Where one curve is not the "
            "continuation of the next, no shift in time makes them one; a shift along |G*| alone "
            "is b_T."
        )
        return picture(drawing, "van_gurp", caption)


def _functions_over_time(found: Superposition) -> Picture:
    kinds = [kind for kind in found.tests if kind != SWEEP]
    with figure(1, len(kinds), width=10.0, height=3.8) as (drawing, axes):
        for panel, kind in zip(axes[0], kinds, strict=True):
            symbol, colour = _TABLES[kind]
            for degrees, label, marker in _marked(found, kind):
                moved = found.moved(kind, degrees)
                style = {**_SHIFTED_POINTS, "marker": marker, "color": colour}
                panel.plot(moved.argument, moved.values[0], label=label, **style)
            panel.set(yscale="log", xlabel="t/a_T (s)", ylabel=symbol)
            make_logarithmic(panel.xaxis)
        if len(found.celsius) <= 10:
            handles, labels = axes[0, 0].get_legend_handles_labels()
            drawing.legend(handles, labels, loc="outside upper center", ncols=5)
        caption = (
            f"Tables over time as at {found.reference:g} °C, averages evenly spaced in log time, a "
            "mark for each temperature."
        )
        return picture(drawing, "over_time", caption)


def _shifts(found: Superposition) -> Picture:
    with figure(1, 1, width=10.0, height=3.2) as (drawing, axes):
        panel = axes[0, 0]
        style = {"ms": 5, "mfc": "none", "mew": 0.8, "marker": "o", "color": BEFORE}
        half = HALF_BAND * found.error[:, 0]
        panel.errorbar(found.celsius, found.log_shift, half, label="a_T", lw=1.0, ls="", **style)
        dense = np.linspace(found.celsius[0], found.celsius[-1], 200)
        for law in found.laws:
            line, colour = _LINES[law.name]
            values = law.log_shift(dense, found.reference)
            panel.plot(dense, values, color=colour, ls=line, lw=1.2, label=law.name)
        panel.set(xlabel="temperature (°C)", ylabel="log₁₀ a_T")
        legend_above(drawing, axes)
        return picture(drawing, "shifts", "Shift factors, with 95 %, and the laws fitted to them.")
