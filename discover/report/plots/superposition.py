"""Pictures of time–temperature superposition: the overlap, van Gurp's plot, and the shifts."""

import numpy as np

from discover.dataset.superposition import Superposition
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

_MARKERS = "os^vD<>ph*"
_POINTS = {"ls": "", "ms": 3.5, "mfc": "none", "mew": 0.8}
_LINES = {"WLF": ("-", NETWORK), "Arrhenius": ("--", SPARSE)}


def superposition_pictures(found: Superposition) -> list[Picture]:
    """Return the pictures of a superposition.

    Parameters
    ----------
    found
        Sweeps and shifts.
    """
    return [_overlap(found), _van_gurp(found), _shifts(found)]


def _labels(found: Superposition) -> list[tuple[str, str]]:
    return [
        (f"{degrees:g} °C", _MARKERS[i % len(_MARKERS)]) for i, degrees in enumerate(found.celsius)
    ]


def _overlap(found: Superposition) -> Picture:
    with figure(1, 2, width=10.0, height=3.8) as (drawing, axes):
        for at, (label, marker) in enumerate(_labels(found)):
            moved = found.moved(at)
            for panel, values, colour in (
                (axes[0, 0], moved.storage_modulus, NETWORK),
                (axes[0, 1], moved.loss_modulus, SPARSE),
            ):
                style = {**_POINTS, "marker": marker, "color": colour}
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
        for sweep, (_, marker) in zip(found.sweeps, _labels(found), strict=True):
            storage, loss = sweep.storage_modulus, sweep.loss_modulus
            style = {**_POINTS, "marker": marker, "color": NETWORK}
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


def _shifts(found: Superposition) -> Picture:
    with figure(1, 1, width=10.0, height=3.2) as (drawing, axes):
        panel = axes[0, 0]
        style = {**_POINTS, "ms": 5, "marker": "o", "color": BEFORE}
        panel.plot(found.celsius, found.log_shift, label="a_T", **style)
        dense = np.linspace(found.celsius[0], found.celsius[-1], 200)
        for law in found.laws:
            line, colour = _LINES[law.name]
            values = law.log_shift(dense, found.reference)
            panel.plot(dense, values, color=colour, ls=line, lw=1.2, label=law.name)
        panel.set(xlabel="temperature (°C)", ylabel="log₁₀ a_T")
        legend_above(drawing, axes)
        return picture(drawing, "shifts", "Shift factors, and the laws fitted to them.")
