"""Pictures of a comparison: stresses in each flow, and oscillations over Wi and De."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

import numpy as np
from matplotlib.figure import Figure

from discover.comparison.comparison import Comparison
from discover.comparison.flows import QUANTITIES, Flow
from discover.learners.registry import learner_title
from discover.report.plots import style as look
from discover.report.wording import percent
from discover.words import FIGURE_SYMBOLS, listed

START_UP_SHOWN = 10.0

# Values within this factor are shown within it above and below
_NARROW = 4.0

# A strain of creep that goes through more than one and a half decades is drawn in decades
_DECADES = 1.5 * np.log(10.0)


def units(comparison: Comparison) -> tuple[str, str, str]:
    """Return labels of stress, time and rate units: scaled for computed data, SI for measured."""
    if comparison.noise is not None:
        return " / G", "t / λ", "λγ̇"
    return " (Pa)", "t (s)", "γ̇ (1/s)"


def curves(comparison: Comparison, flow: Flow):
    """Yield label, style and stresses of everything known in a flow, in drawing order."""
    before = comparison.before[flow.key]
    if before is not None:
        yield "before (known part alone)", look.BEFORE_STYLE, before
    if flow.reference:
        label = "truth" if flow.is_truth else "measured"
        style = (
            look.TRUTH_STYLE
            if flow.is_truth
            else {"color": look.MEASURED, "marker": ".", "ls": "none"}
        )
        yield label, style, flow.reference
    for name, outcome in comparison.outcomes.items():
        prediction = outcome.predictions[flow.key]
        if prediction is not None:
            yield learner_title(name), look.learner_style(name), prediction


def flow_picture(comparison: Comparison, flow: Flow) -> look.Picture:
    """Return σ12, N1 and N2 in an oscillation: against time, against strain and against rate."""
    stress_unit, time_label, rate_label = units(comparison)
    cycle = look.last_cycle(flow.times, flow.rate)
    last = np.ones(flow.times.size, dtype=bool) if cycle is None else cycle
    strain = look.about_middle(flow.strain, last)[last]
    closed = {"elastic": (strain, "strain γ"), "viscous": (flow.rate[last], rate_label)}
    shown = [q for q in QUANTITIES if any(q in s for _, _, s in curves(comparison, flow))]
    seen = "no learner saw this flow."
    if flow.name in {one.name for one in comparison.flows_of("training")}:
        seen = "the learners saw σ₁₂ of this flow in the shaded times, and nothing else of it."
    with look.figure(len(shown), 3, width=10.0, height=2.1) as (drawing, axes):
        for row, quantity in zip(axes, shown, strict=True):
            _draw_stress(row[0], comparison, flow, quantity, slice(None), flow.times)
            if flow.training_end is not None and flow.training_end < flow.times[-1]:
                span = flow.times[0], flow.training_end
                row[0].axvspan(*span, color=look.SHADE, lw=0, label="training times", zorder=0)
            _mark_open(row[0], comparison, flow, quantity)
            for panel, (along, _) in zip(row[1:], closed.values(), strict=True):
                _draw_stress(panel, comparison, flow, quantity, last, along)
            row[0].set_ylabel(FIGURE_SYMBOLS[quantity] + stress_unit)
        axes[-1, 0].set_xlabel(time_label)
        beyond = "" if comparison.placement(flow).inside else ", beyond range"
        axes[0, 0].set_title(look.literal(flow.title) + beyond)
        for column, (kind, (_, label)) in enumerate(closed.items(), 1):
            axes[0, column].set_title(f"{kind} Lissajous curve, last cycle")
            axes[-1, column].set_xlabel(label)
        look.legend_above(drawing, axes)
        return look.picture(
            drawing,
            f"flow_{flow.name}",
            f"{flow.title}: {seen} It lies {comparison.placement(flow).text}. "
            "Left, stresses against time; beyond the times shaded grey the prediction runs past "
            "the length of the training series. Middle and right, the last cycle against strain "
            "and against shear rate. Shaded in orange is the 95 % band of all laws "
            "that the data allow; no band is drawn for undetermined quantities. Some curves of the "
            "known part alone run off the plot.",
        )


def start_up_picture(comparison: Comparison, flow: Flow) -> look.Picture:
    """Return σ12, N1 and N2 in start-up, or else what was recorded, such as the strain of creep."""
    stress_unit, _, _ = units(comparison)
    quantities = QUANTITIES if flow.records_shear_stress else QUANTITIES[:1]
    seen = "no learner saw this flow."
    if all(one.oscillatory for one in comparison.flows_of("training")):
        seen = "a kind of flow that training, all oscillatory, did not contain."
    with look.figure(1, len(quantities), height=2.9) as (drawing, axes):
        shown = flow.times <= max(START_UP_SHOWN, float(flow.times[1]))
        if not flow.is_truth:
            shown = np.ones_like(shown)
        for panel, quantity in zip(axes[0], quantities, strict=True):
            _draw_stress(panel, comparison, flow, quantity, shown, flow.along[shown])
            _mark_open(panel, comparison, flow, quantity)
            drawn = quantity if flow.records_shear_stress else flow.protocol.quantity
            panel.set_ylabel(FIGURE_SYMBOLS[drawn] + ("" if flow.records_strain else stress_unit))
            panel.set_xlabel(_axis_of(comparison, flow))
            _set_scales(panel, flow, quantity)
        look.legend_above(drawing, axes)
        return look.picture(
            drawing,
            f"flow_{flow.name}",
            f"{flow.title}: {seen} It lies {comparison.placement(flow).text}.",
        )


def training_picture(comparison: Comparison) -> look.Picture:
    """Return the data that the learners saw, and how they fit them."""
    flows = comparison.flows_of("training")
    kinds = {flow.protocol.quantity for flow in flows}
    recorded = listed([symbol for kind, symbol in FIGURE_SYMBOLS.items() if kind in kinds])
    with drawn_records(comparison, flows) as drawing:
        return look.picture(
            drawing, "training", f"The only data that the learners saw: {recorded} of these runs."
        )


@contextmanager
def drawn_records(comparison: Comparison, flows: Sequence[Flow]) -> Iterator[Figure]:
    """Yield a figure with a panel for each flow: what was recorded of it, and every learner."""
    stress_unit, _, _ = units(comparison)
    with look.panels_of(len(flows), height=1.8) as (drawing, axes, panels):
        for panel, flow in zip(panels, flows, strict=True):
            recorded = flow.measured
            if recorded is None and flow.kind != "training" and flow.is_record:
                recorded = flow.reference.get("sigma12")
            if recorded is not None:
                panel.plot(flow.along, recorded, ".", color=look.MEASURED, ms=2.5, label="data")
            for name, outcome in comparison.outcomes.items():
                prediction = outcome.predictions[flow.key]
                if prediction is not None:
                    style = {**look.learner_style(name), "label": learner_title(name)}
                    panel.plot(flow.along, prediction["sigma12"], **style)
            _draw_band(panel, comparison, flow, "sigma12", slice(None), flow.along)
            panel.set_title(look.literal(flow.title), fontsize=8)
            _set_scales(panel, flow, "sigma12", truth_too=True)
            if flow.is_of_states:
                panel.set_xlabel(_axis_of(comparison, flow))
        for panel, flow in zip(axes[-1], flows[axes[:-1].size :], strict=False):
            panel.set_xlabel(_axis_of(comparison, flow))
        units_of = ["" if flow.records_strain else stress_unit for flow in flows]
        symbols = [FIGURE_SYMBOLS[flow.protocol.quantity] for flow in flows]
        look.label_rows(axes, [f"{one}{unit}" for one, unit in zip(symbols, units_of, strict=True)])
        look.legend_above(drawing, axes)
        yield drawing


def _draw_stress(panel, comparison: Comparison, flow: Flow, quantity: str, shown, along) -> None:
    """Draw all that is known of a stress against what is given of the samples shown."""
    for label, style, stresses in curves(comparison, flow):
        if quantity in stresses:
            panel.plot(along, stresses[quantity][shown], label=label, **style)
    _draw_band(panel, comparison, flow, quantity, shown, along)
    _frame(panel, comparison, flow, quantity, shown)


def _draw_band(panel, comparison: Comparison, flow: Flow, quantity: str, shown, along) -> None:
    """Shade what the data leave open: the band of the posterior, and the members of an ensemble."""
    limits = []
    network = comparison.outcomes.get("tbnn_ude")
    members = None if network is None else network.bands.get(flow.key)
    if members is not None:
        label = "networks that fit as well"
        colour = look.learner_style("tbnn_ude")["color"]
        limits.append((members.low[quantity], members.high[quantity], colour, label))
    band = comparison.determined_band(flow)
    if band is not None and np.any(np.isfinite(band.low[quantity])):
        limits.append((band.low[quantity], band.high[quantity], look.SPARSE, "95 % band"))
    for low, high, colour, label in limits:
        look.shade_between(
            panel, along, low[shown], high[shown],
            color=colour, alpha=0.18, linewidth=0, label=label,
        )  # fmt: skip


def _axis_of(comparison: Comparison, flow: Flow) -> str:
    """Return the label of what a flow is drawn against."""
    _, time_label, rate_label = units(comparison)
    if flow.protocol.control == "oscillation":
        return flow.drawn[0]
    return rate_label if flow.is_of_states else time_label


def _set_scales(panel, flow: Flow, quantity: str, truth_too: bool = False) -> None:
    """Show decades of rate, amplitude or time, and of what was recorded where it has one sign."""
    if _in_decades(flow, quantity):
        panel.set_yscale("log")
        panel.autoscale(axis="y")
        low, high = panel.get_ylim()
        if high < _NARROW * low:  # within a decade the labels of an axis would crowd
            panel.set_ylim(low / _NARROW, high * _NARROW)
    in_time = not flow.is_of_states and (truth_too or not flow.is_truth)
    # in creep the stress is constant, and not the rate
    pace = np.ones_like(flow.times) if flow.records_strain else flow.rate
    if flow.is_of_states or (in_time and look.runs_through_decades(flow.times, pace)):
        look.make_logarithmic(panel.xaxis)


def _in_decades(flow: Flow, quantity: str) -> bool:
    if flow.is_of_states:
        return quantity != "N2"
    strain = flow.reference.get("sigma12") if flow.records_strain else None
    return strain is not None and bool(np.min(strain) > 0.0) and np.ptp(np.log(strain)) > _DECADES


def _mark_open(panel, comparison: Comparison, flow: Flow, quantity: str) -> None:
    """Say in a panel that these data leave the quantity open, so that no missing band is narrow."""
    if any(statement.leaves_open(quantity, flow) for statement in comparison.statements):
        panel.annotate(
            "not determined by these data", (0.98, 0.97), xycoords="axes fraction",
            ha="right", va="top", fontsize=7, color=look.INK,
        )  # fmt: skip


def _frame(panel, comparison: Comparison, flow: Flow, quantity: str, shown) -> None:
    """Let truth and learners, not what came before, decide the range."""
    if _in_decades(flow, quantity):
        return  # in decades what came before hides nothing
    values = [
        stresses[quantity][shown]
        for label, _, stresses in curves(comparison, flow)
        if quantity in stresses and not label.startswith("before")
    ]
    if quantity == "N2" and "N1" in flow.reference:
        # a small N2 would look large: always at least a hundredth of N1
        values.append(0.01 * np.nanmax(np.abs(flow.reference["N1"])) * np.array([-1.0, 1.0]))
    joined = np.concatenate(values) if values else np.zeros(1)
    joined = joined[np.isfinite(joined)]
    joined = joined if joined.size else np.zeros(1)
    low, high = float(np.min(joined)), float(np.max(joined))
    margin = 0.15 * (high - low) or 1.0
    panel.set_ylim(low - margin, high + margin)


def third_harmonic(stress: np.ndarray) -> float:
    """Return I₃/I₁ of one cycle, sampled evenly with the end equal to the beginning.

    Zero for an ellipse.
    """
    spectrum = np.abs(np.fft.rfft(stress[:-1]))
    return float(spectrum[3] / spectrum[1]) if spectrum[1] > 0 else 0.0


def high_deborah_picture(comparison: Comparison) -> look.Picture | None:
    """Return Lissajous curves that become elliptical as De grows."""
    stress_unit, _, rate_label = units(comparison)
    panels = []
    for flow in comparison.flows_of("high_deborah"):
        # the first sample is rest at t = 0, the others one late cycle
        drawn = [
            (flow.rate[1:], stresses["sigma12"][1:], {**style, "label": label})
            for label, style, stresses in curves(comparison, flow)
            if "sigma12" in stresses
        ]
        harmonic = third_harmonic(flow.reference["sigma12"][1:])
        deborah = float(np.max(np.asarray(flow.protocol.frequencies)))
        settings = {
            "title": f"De = {deborah:g}, I₃/I₁ = {100 * harmonic:.2g} %",
            "xlabel": f"shear rate {rate_label}",
            "ylabel": "" if panels else "σ₁₂" + stress_unit,
        }
        panels.append(look.Panel(drawn, settings))
    caption = (
        "γ̇ = 3 cos(De t), one cycle after the transient. As De grows the stress has no time to "
        "change the structure within a cycle, and the strain, 3/De, falls: the curve becomes an "
        "ellipse (quasi-linear LAOS) although the rate is large. A law that contains the shear "
        "rate explicitly (Johnson–Segalman) distorts it at any De once the strain exceeds one. "
        "I₃/I₁ is the third harmonic of the truth over the first."
    )
    return look.row_of_panels("high_deborah", caption, panels, 9.0, 2.8) if panels else None


_STRONGEST = 0.55  # more would drown the number in the cell
_TOLD = 10.0  # a larger relative error is no more than that in a cell
_LOWEST, _HIGHEST = 1e-4, 1.0  # Relative errors at which the colour of a cell begins and ends

Cells = Mapping[tuple[float, float], float | None]


def error_map_picture(comparison: Comparison) -> look.Picture | None:
    """Return the error of the known part and of each learner over Wi and De."""
    if not comparison.flows_of("pipkin"):
        return None
    rows = {"before": "before", **{n: learner_title(n) for n in comparison.outcomes}}
    with look.figure(len(rows), 3, width=10.0, height=2.5) as (drawing, axes):
        for row, (who, title) in zip(axes, rows.items(), strict=True):
            table = comparison.error_map(who)
            for panel, quantity in zip(row, QUANTITIES, strict=True):
                cells = {place: errors[quantity] for place, errors in table.items()}
                _draw_cells(panel, cells, look.NETWORK)
                panel.set_title(f"{FIGURE_SYMBOLS[quantity]}, {title}")
                _mark_training(panel, comparison, cells)
        _label(axes)
        look.legend_above(drawing, axes)
        return look.picture(
            drawing,
            "pipkin_error",
            "Pipkin map of error: relative L2 error in one late cycle of γ̇ = Wi cos(De t), N₂'s "
            "relative to N₁; a dash where the law diverges. Open circles: flows whose σ₁₂ the "
            "learners saw. Away from them a law is an extrapolation.",
        )


def _draw_cells(panel, cells: Cells, colour: str) -> None:
    """Draw one number a cell, the deeper the larger on a logarithmic scale."""
    weissenberg, deborah = _axes_of(cells)
    span = np.log(_HIGHEST / _LOWEST)
    for (wi, de), value in cells.items():
        x, y = deborah.index(de), weissenberg.index(wi)
        share = 0.0 if value is None else np.log(max(value, 1e-300) / _LOWEST) / span
        strength = float(np.clip(share, 0.0, 1.0))
        panel.bar(x, 1.0, 1.0, y - 0.5, color=colour, alpha=strength * _STRONGEST, linewidth=0)
        text = "∞" if value == np.inf else percent(value).replace(" %", "")
        if value is not None and _TOLD < value < np.inf:
            text = f"> {100 * _TOLD:.0f}"  # a rival on its way to running away
        panel.text(x, y - 0.12, text, ha="center", va="center", fontsize=8, color=look.INK)
    panel.set_xticks(range(len(deborah)), [f"{v:g}" for v in deborah])
    panel.set_yticks(range(len(weissenberg)), [f"{v:g}" for v in weissenberg])
    panel.set_xlim(-0.5, len(deborah) - 0.5)
    panel.set_ylim(-0.5, len(weissenberg) - 0.5)
    panel.grid(False)


def _axes_of(cells: Cells) -> tuple[list[float], list[float]]:
    return sorted({wi for wi, _ in cells}), sorted({de for _, de in cells})


def _mark_training(panel, comparison: Comparison, cells: Cells) -> None:
    """Mark the flows of training above the numbers, between cells where they lie on none."""
    weissenberg, deborah = (np.asarray(v) for v in _axes_of(cells))
    for flow in comparison.flows_of("training"):
        if flow.oscillatory and flow.frequency:
            x = np.interp(np.log(flow.frequency), np.log(deborah), np.arange(deborah.size))
            y = np.interp(np.log(flow.amplitude), np.log(weissenberg), np.arange(weissenberg.size))
            panel.plot(
                x, y + 0.28, "o", ms=4.5, mfc="none", mew=1.0, color=look.TRUTH,
                label="trained on (σ₁₂)",
            )  # fmt: skip


def _label(axes) -> None:
    for panel in axes[-1]:
        panel.set_xlabel("De = λω")
    for panel in axes[:, 0]:
        panel.set_ylabel("Wi = λγ̇₀")
    for panel in axes.ravel():
        panel.annotate(
            "%", (1.0, 1.02), xycoords="axes fraction", ha="right", fontsize=8, color=look.INK
        )
