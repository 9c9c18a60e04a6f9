"""Pictures of time–temperature superposition: the overlap, van Gurp's plot, and the shifts."""

from collections.abc import Iterator

import numpy as np

from discover.dataset.linear.linear_spectra import predicted, spectrum_of
from discover.dataset.linear.linear_tests import CREEP, RELAXATION, SWEEP
from discover.dataset.linear.superposition import Superposition
from discover.report.plots.style import (
    BEFORE,
    NETWORK,
    SPARSE,
    Picture,
    figure,
    legend_above,
    make_logarithmic,
    picture,
)
from discover.statistics import HALF_BAND

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
            _predictions(found, kind, panel)
            panel.set(yscale="log", xlabel="t/a_T (s)", ylabel=symbol)
            make_logarithmic(panel.xaxis)
        if len(found.celsius) <= 10:
            handles, labels = axes[0, 0].get_legend_handles_labels()
            drawing.legend(handles, labels, loc="outside upper center", ncols=5)
        caption = (
            f"Tables over time as at {found.reference:g} °C, averages evenly spaced in log time, a "
            "mark for each temperature."
        )
        if found.master(SWEEP) is not None:
            caption += " The line is what the modes of the moved sweeps predict."
        return picture(drawing, "over_time", caption)


def _predictions(found: Superposition, kind: str, panel) -> None:
    """Draw what the modes of the moved sweeps say, over the times that they reach."""
    master = found.master(SWEEP)
    if master is None:
        return
    times = np.geomspace(1.0 / master.argument[-1], 1.0 / master.argument[0], 200)
    measured = [found.moved(kind, degrees).argument for degrees, *_ in _marked(found, kind)]
    ends = min(one[0] for one in measured), max(one[-1] for one in measured)
    times = times[(times >= ends[0]) & (times <= ends[1])]
    values = predicted(spectrum_of(master), kind, times)[0]
    panel.plot(times, values, color=BEFORE, lw=1.2, label="from the sweeps")


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
